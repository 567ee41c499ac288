"""The frame of the command line: exit codes, one-line errors, whole or absent results."""

import hashlib
import io
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from exactarm import cli
from exactarm.commands.execute import parse, parser_of
from exactarm.commands.listing import find_commands, import_command

COMMAND = '''
import time
import numpy as np
from exactarm import _core
from exactarm.commands.arguments import add_files, add_robot
from exactarm.commands.result import CommandResult, estimate
from exactarm.errors import ComputationError, InputError
from exactarm.identify.statistics import summarise
from exactarm.report import Estimate, Report, Table

NAME = "weigh"
HELP = "weighs the robot"
WRITES = ("weights.csv",)

def add_arguments(parser):
    add_robot(parser)
    add_files(parser, least=0)
    parser.add_argument("--fail", default="")

def run(arguments):
    arguments.progress.stage("preparing")
    if arguments.fail == "input":
        raise InputError("not a number,\\nexpected metres", file="poses.csv", row=7, column="x_m")
    if arguments.fail == "computation":
        raise ComputationError("the fit did not converge")
    if arguments.fail == "core":
        _core.require_gear("gear 1", 0.0, _core.GearTable())
    if arguments.fail == "fault":
        raise KeyError("oops")
    arguments.progress.stage("weighing")
    while arguments.fail == "hang":
        time.sleep(0.05)
    report = Report("Weight", "The robot weighs 48 kg.",
                    (Table("Mass", ("link", "mass"), ((1, Estimate(12.0, 11.5, 12.5, "kg")),)),), tone="good")
    body = {"mass": estimate(np.float64(12.0), 11.5, np.inf), "error": summarise(np.array([3.0, 4.0])),
            "seeded": arguments.seed, "missing": float("nan"), "list": np.arange(2)}
    weights = {"link": [1, 2], "mass_kg": [12.0, np.nan]}
    return CommandResult(json=body, report=report, tables={"weights.csv": weights})
'''


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with one command in it, on the path of this and of child processes."""
    name = f"commands_of_{tmp_path.name}"
    folder = tmp_path / name
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "helper.py").write_text("NAME = 'not a command: it has no help'")
    (folder / "weigh.py").write_text(COMMAND)
    monkeypatch.syspath_prepend(str(tmp_path))
    return name


def run(package, *words):
    return cli.main([str(word) for word in words], package)


PATIENCE_S = 600.0  # of a loaded machine


@contextmanager
def child(package, out, *words):
    """The same in a process of its own, which does not outlive its test."""
    source = Path(cli.__file__).parents[1]
    path = os.pathsep.join([str(source), str(out.parent), os.environ.get("PYTHONPATH", "")])
    program = f"import sys; from exactarm.cli import main; sys.exit(main(package={package!r}))"
    with subprocess.Popen([sys.executable, "-c", program, "weigh", "nobody", "--out", str(out), *words],
                          env=os.environ | {"PYTHONPATH": path}, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        try:
            yield process
        finally:
            process.kill()


def test_a_run_writes_everything_and_says_the_verdict_first(package, tmp_path, capsys):
    data = tmp_path / "data.csv"
    data.write_text("x_m\n1\n2\n\n")
    assert run(package, "weigh", "nobody", "--out", tmp_path / "out", data, "--seed", "5") == 0
    printed = capsys.readouterr()
    assert printed.err == "" and printed.out.splitlines()[3] == "The robot weighs 48 kg."
    result = json.loads((tmp_path / "out/result.json").read_text())
    assert list(result)[:6] == ["exactarm", "command", "robot", "inputs", "seed", "seconds"]
    assert result["command"] == "weigh" and result["robot"] == "nobody" and result["seed"] == 5
    assert result["inputs"] == [
        {"file": str(data), "rows": 2, "sha256": hashlib.sha256(data.read_bytes()).hexdigest()}
    ]
    assert result["mass"] == {"value": 12.0, "ci95": [11.5, None]}
    assert result["error"] == {"n": 2, "mean": 3.5, "rms": pytest.approx(12.5**0.5), "max": 4.0, "min": 3.0,
                               "std": 0.5}
    assert result["missing"] is None and result["list"] == [0, 1]
    assert (tmp_path / "out/weights.csv").read_text() == "link,mass_kg\n1,12\n2,\n"
    assert "The robot weighs 48 kg." in (tmp_path / "out/report.html").read_text()
    written = ["report.html", "result.json", "weights.csv"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [".written", *written]
    assert sorted((tmp_path / "out/.written").read_text().split()) == written


def test_quiet_prints_nothing(package, tmp_path, capsys):
    assert run(package, "weigh", "nobody", "--out", tmp_path / "out", "--quiet") == 0
    printed = capsys.readouterr()
    assert printed.out == printed.err == ""


@pytest.mark.parametrize("words, code, line", [
    (["--fail", "input"], 2, "poses.csv, row 7, column x_m: not a number, expected metres"),
    (["--fail", "computation"], 1, "the fit did not converge"),
    (["--fail", "core"], 2, "nobody: gear 1"),
    (["--fail", "fault"], 1, "unexpected KeyError: 'oops' (a fault in exactarm; --debug prints the "
                             "traceback)"),
    (["--seed", "-3"], 2, "argument --seed: -3 is negative, expected 0 or more (see exactarm weigh --help)"),
    (["--threads", "two"], 2, "argument --threads: invalid whole number value: 'two' (see exactarm weigh "
                              "--help)"),
    (["--treads", "2"], 2, "unrecognized arguments: --treads 2; did you mean --threads? (see exactarm weigh "
                           "--help)"),
])
def test_an_error_is_one_line_and_leaves_no_result(package, tmp_path, capsys, words, code, line):
    out = tmp_path / "out"
    if words[0] == "--fail":
        assert run(package, "weigh", "nobody", "--out", out, "--quiet") == 0
    assert run(package, "weigh", "nobody", "--out", out, *words) == code
    errors = capsys.readouterr().err
    assert errors.startswith(f"exactarm: error: {line}") and errors.count("\n") == 1
    assert not (out / "result.json").exists() and not (out / ".partial").exists()


def test_in_a_pipe_stderr_holds_the_error_alone(package, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("exactarm.progress.PIPE_INTERVAL_S", -1.0)
    assert run(package, "weigh", "nobody", "--out", tmp_path / "out", "--fail", "input") == 2
    printed = capsys.readouterr()
    assert printed.out == "preparing\n"
    assert printed.err.count("\n") == 1 and printed.err.startswith("exactarm: error: ")


def test_a_notebook_whose_streams_cannot_be_reconfigured_gets_its_text(package, tmp_path, monkeypatch):
    said = io.StringIO()
    monkeypatch.setattr(sys, "stdout", said)
    monkeypatch.setattr(sys, "stderr", said)
    assert run(package, "weigh", "racer-7-1.4", "--out", tmp_path / "out") == cli.DONE
    assert "The robot weighs 48 kg." in said.getvalue()


def test_debug_prints_the_traceback(package, tmp_path, capsys):
    assert run(package, "weigh", "nobody", "--out", tmp_path / "out", "--fail", "fault", "--debug") == 1
    assert "Traceback (most recent call last)" in capsys.readouterr().err


def test_missing_arguments_and_unknown_commands_are_bad_input(package, tmp_path, capsys):
    assert run(package, "weigh", "nobody") == 2
    assert run(package, "weigh", "--out", tmp_path) == 2
    assert run(package, "lift") == 2
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(": ", 2)[2].split(" (")[0] for line in lines] == [
        "the following arguments are required: --out",
        "the following arguments are required: ROBOT",
        "unknown command 'lift', expected one of: weigh",
    ]


def test_a_file_in_place_of_the_folder_is_bad_input(package, tmp_path, capsys):
    (tmp_path / "out").write_text("mine")
    assert run(package, "weigh", "nobody", "--out", tmp_path / "out") == 2
    assert "expected a folder" in capsys.readouterr().err
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.slow
@pytest.mark.parametrize("number, code", [(signal.SIGINT, 130), (signal.SIGTERM, 130), (signal.SIGKILL, -9)])
def test_a_killed_run_leaves_no_result_not_even_an_old_one(package, tmp_path, number, code):
    out = tmp_path / "out"
    assert run(package, "weigh", "nobody", "--out", out, "--quiet") == 0
    with child(package, out, "--fail", "hang") as process:
        while (out / "result.json").exists() and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(number)
        _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == code
    assert not (out / "result.json").exists()
    if number != signal.SIGKILL:
        assert errors == "exactarm: error: interrupted; nothing was written\n"
        assert not (out / ".partial").exists()
    assert run(package, "weigh", "nobody", "--out", out, "--quiet") == 0
    assert not (out / ".partial").exists()


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
def test_an_import_that_was_broken_off_is_no_fault(package, tmp_path, capsys, number):
    """A library's own set-up turns the interrupt into an error of its own."""
    (tmp_path / package / "weigh.py").write_text(textwrap.dedent(f"""
        import os, signal, time
        NAME = 'weigh'
        HELP = 'weighs the robot'
        try:
            os.kill(os.getpid(), signal.{number})
            time.sleep(5.0)
        except KeyboardInterrupt:
            raise ImportError('initialization failed')
    """))
    assert run(package, "weigh", "nobody", "--out", tmp_path / "out") == 130
    assert capsys.readouterr().err == "exactarm: error: interrupted; nothing was written\n"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_help_lists_all_commands_without_importing_them(package, tmp_path, capsys):
    (tmp_path / package / "weigh.py").write_text("NAME = 'weigh'\nHELP = 'weighs the robot'\nraise "
                                                 "RuntimeError")
    assert run(package, "--help") == 0
    assert "  weigh  weighs the robot\n" in capsys.readouterr().out


def test_help_imports_no_heavy_library():
    program = textwrap.dedent("""
        import sys
        from exactarm.cli import main
        main(["--help"])
        print([name for name in ("numpy", "scipy", "pandas", "matplotlib", "jinja2") if name in sys.modules])
    """)
    source = Path(cli.__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", program], env=os.environ | {"PYTHONPATH": str(source)},
                          capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_python_dash_m_is_the_command():
    source = Path(cli.__file__).parents[1]
    done = subprocess.run([sys.executable, "-m", "exactarm", "--version"], capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": str(source)})
    assert done.returncode == 0 and done.stdout.startswith("exactarm ")


@pytest.mark.parametrize("words, line", [
    (["evaluate", "ur10", "ur10/seires_B"], "did you mean the shipped ur10/series_B?"),
    (["evaluate", "ur10", "poses_deg.csv"], "did you mean it with q6_deg (--map q6_deg=q_6_deg)?"),
    (["calibrte"], "unknown command 'calibrte', did you mean calibrate?"),
    (["simulate", "ur10", "--effect", "backlsh joint=2 width_rad=1e-4"],
     "unknown effect 'backlsh'; did you mean backlash?"),
    (["calibrate", "ur10", "poses.csv"], "poses.csv, column thta_1_rad: is no quantity of a joint; did you "
                                         "mean theta_1_rad?"),
    (["calibrate", "ur10", "marked.csv"], "column sesion: would not be read; did you mean session?"),
    (["calibrate", "ur10", "joints.csv"], "did you mean it with joint_1_deg (--map joint_1_deg=q_1_deg)?"),
    (["plan", "ur10", "line", "--kind", "poses"], "unrecognized arguments: --kind poses"),
])
def test_what_is_misspelt_is_answered_with_what_was_meant(tmp_path, monkeypatch, capsys, words, line):
    monkeypatch.chdir(tmp_path)
    Path("poses.csv").write_text("thta_1_rad,x_m,y_m,z_m\n0,0,0,0\n")
    angles = ",".join(f"q_{axis}_deg" for axis in range(1, 6))
    Path("poses_deg.csv").write_text(f"{angles},q6_deg,x_m,y_m,z_m\n0,0,0,0,0,0,0,0,0\n")
    Path("marked.csv").write_text(f"sesion,{angles},q_6_deg,x_m,y_m,z_m\n1,0,0,0,0,0,0,0,0,0\n")
    theirs = ",".join(f"joint_{axis}_deg" for axis in range(1, 7))
    Path("joints.csv").write_text(f"{theirs},x_m,y_m,z_m\n0,0,0,0,0,0,0,0,0\n")
    out = ["--out", "out"] if len(words) > 1 else []
    assert cli.main([*words, *out]) == 2
    assert line in capsys.readouterr().err


def test_a_missing_option_that_was_misspelt_is_told(capsys):
    assert cli.main(["evaluate", "ur10", "ur10/series_B", "--ou", "x"]) == 2
    assert "did you mean --out for --ou?" in capsys.readouterr().err


@pytest.mark.parametrize("kind, value", [
    (None, "-10,-70,80,-20,90,12"), (None, "-.5"), (None, "-inf,0,0"), (float, "-1e-4"), (float, "-5"),
])
def test_every_option_takes_a_value_that_begins_with_a_minus(kind, value, tmp_path):
    checked = 0
    for module in map(import_command, find_commands()):
        actions = parser_of(module)._actions
        needed = [word for action in actions if action.required and action.dest != "out"
                  for word in (*action.option_strings, action.choices[0] if action.choices else "x")]
        for action in actions:
            if not action.option_strings or action.choices or action.nargs == 0 or action.type is not kind:
                continue
            given = [action.option_strings[0], *[value] * (action.nargs or 1)]
            found = vars(parse(module, [*needed, *given, "--out", str(tmp_path)]))[action.dest]
            assert (kind or str)(value) == (found[0] if isinstance(found, list) else found)
            checked += 1
    assert checked > 10


def test_the_overview_fits_80_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert cli.main(["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80 and any(line.startswith("  identifiable  ") for line in lines)


@pytest.mark.slow
def test_a_shell_completes_commands_and_their_options(capsys):
    assert cli.main(["--completion", "bash"]) == 0
    script = capsys.readouterr().out
    assert "calibrate" in script and "--robust" in script and "complete -" in script
    assert cli.main(["--completion", "fish"]) == 2
