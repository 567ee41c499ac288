"""What the machine and the shell do to a run: full disks, closed streams, two runs at once. One line, exit 1
or 2, nothing half done."""

import fcntl
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from exactarm import cli
from exactarm.commands.output import OutputFolder
from exactarm.errors import InputError
from exactarm.files.examples import data_path
from test_cli import package, run  # noqa: F401

DATA = str(data_path("ur10/series_B.csv"))


def shell(line: str, **environment) -> subprocess.CompletedProcess:
    """`exactarm` as EXACTARM in a shell."""
    program = f"{sys.executable} -m exactarm"
    paths = {"PYTHONPATH": str(Path(cli.__file__).parents[1])}
    return subprocess.run(
        ["bash", "-c", line.replace("EXACTARM", program)],
        capture_output=True,
        text=True,
        errors="replace",
        env=os.environ | paths | environment,
    )


def test_a_second_run_into_the_same_folder_is_refused(tmp_path):
    with OutputFolder(tmp_path / "out") as first:
        first.write_text("a.txt", "of the first")
        with pytest.raises(InputError, match="another run is writing here"):
            with OutputFolder(tmp_path / "out"):
                pass
        first.write_result({})
        first.publish()
    assert (tmp_path / "out/a.txt").read_text() == "of the first"
    with OutputFolder(tmp_path / "out"):
        pass


def test_the_lock_of_a_killed_run_is_gone(tmp_path):
    holder = (
        "import sys, time; from pathlib import Path; from exactarm.commands.output import OutputFolder\n"
        "with OutputFolder(Path(sys.argv[1])): print('in', flush=True); time.sleep(60)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", holder, str(tmp_path)],
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(Path(cli.__file__).parents[1])},
    )
    assert process.stdout.readline() == b"in\n"
    with pytest.raises(InputError, match="another run"), OutputFolder(tmp_path):
        pass
    process.kill()
    process.wait()
    process.stdout.close()
    with OutputFolder(tmp_path):
        pass


def test_a_file_system_without_locks_is_still_written_to(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with OutputFolder(tmp_path) as folder:
        folder.write_result({})
        folder.publish()
    assert (tmp_path / "result.json").exists()


def test_the_result_names_its_run_and_the_files_that_belong_to_it(package, tmp_path):  # noqa: F811
    assert run(package, "weigh", "nobody", "--out", tmp_path / "out", "--quiet") == 0
    result = json.loads((tmp_path / "out/result.json").read_text())
    assert sorted(result["files"]) == ["report.html", "weights.csv"]
    for name, sha256 in result["files"].items():
        assert hashlib.sha256((tmp_path / "out" / name).read_bytes()).hexdigest() == sha256
    assert result["run"] in (tmp_path / "out/report.html").read_text()


def test_a_result_never_replaces_a_file_that_it_was_made_from(package, tmp_path, capsys):  # noqa: F811
    mine = tmp_path / "weights.csv"
    mine.write_text("x_m\n1\n")
    assert run(package, "weigh", "nobody", mine, "--out", tmp_path) == 2
    assert "would be overwritten" in capsys.readouterr().err
    assert mine.read_text() == "x_m\n1\n" and not (tmp_path / "result.json").exists()


def test_a_result_never_replaces_a_file_that_no_run_has_written(package, tmp_path, capsys):  # noqa: F811
    """As `--out .` beside the user's own table; what an earlier run wrote is replaced, as before."""
    mine = tmp_path / "weights.csv"
    mine.write_text("mine\n")
    assert run(package, "weigh", "nobody", "--out", tmp_path) == 2
    assert f"{mine}: would be overwritten" in capsys.readouterr().err
    assert mine.read_text() == "mine\n" and not (tmp_path / "report.html").exists()
    mine.rename(tmp_path / "own.csv")
    for _ in range(2):
        assert run(package, "weigh", "nobody", "--out", tmp_path, "--quiet") == 0
    assert mine.read_text().startswith("link,mass_kg")
    (tmp_path / "result.json").unlink()  # as a run that was refused or killed leaves it
    assert run(package, "weigh", "nobody", "--out", tmp_path, "--quiet") == 0


def test_what_an_earlier_result_names_is_its_own(package, tmp_path):  # noqa: F811
    """A folder of an earlier version, or a copy without hidden files, has no list of what runs wrote."""
    assert run(package, "weigh", "nobody", "--out", tmp_path, "--quiet") == 0
    (tmp_path / ".written").unlink()
    assert run(package, "weigh", "nobody", "--out", tmp_path, "--quiet") == 0


@pytest.mark.parametrize("result", ["", "[]", '{"files": 3}', '{"files": "abc"}', "{" * 100_000, "\x00"])
def test_a_result_that_is_none_names_nothing(package, tmp_path, capsys, result):  # noqa: F811
    """And is another program's: ours are whole, and name us."""
    (tmp_path / "result.json").write_text(result)
    assert run(package, "weigh", "nobody", "--out", tmp_path, "--quiet") == 2
    assert "result.json: would be overwritten" in capsys.readouterr().err
    assert (tmp_path / "result.json").read_text() == result


@pytest.mark.parametrize("out", ["", "  "])
def test_a_folder_without_a_name_is_refused(package, capsys, out):  # noqa: F811
    assert run(package, "weigh", "nobody", "--out", out) == 2
    assert "argument --out: is empty, expected a folder" in capsys.readouterr().err


def test_a_robot_or_file_without_a_name_is_refused(tmp_path, capsys):
    assert cli.main(["evaluate", "", DATA, "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == "exactarm: error: argument '': is empty, expected a name or a file\n"


@pytest.mark.parametrize("folder", ["/proc/exactarm", "/dev/null/exactarm"])
def test_a_folder_that_cannot_be_made_is_bad_input(package, capsys, folder):  # noqa: F811
    assert run(package, "weigh", "nobody", "--out", folder) == 2
    assert f"exactarm: error: {folder}: cannot write here" in capsys.readouterr().err


def test_a_full_disk_is_one_line_and_no_result(package, tmp_path, capsys, monkeypatch):  # noqa: F811
    def full(self, name, columns):
        raise OSError(28, "No space left on device", name)

    monkeypatch.setattr(OutputFolder, "write_table", full)
    assert run(package, "weigh", "nobody", "--out", tmp_path / "out", "--quiet") == 1
    assert capsys.readouterr().err == "exactarm: error: weights.csv: No space left on device\n"
    assert not (tmp_path / "out").exists()


def test_too_little_memory_is_one_line(package, tmp_path, capsys, monkeypatch):  # noqa: F811
    def starve(self, name, columns):
        raise MemoryError("Unable to allocate 15.7 GiB")

    monkeypatch.setattr(OutputFolder, "write_table", starve)
    assert run(package, "weigh", "nobody", "--out", tmp_path / "out", "--quiet") == 1
    assert capsys.readouterr().err.startswith(
        "exactarm: error: not enough memory (Unable to allocate 15.7 GiB)"
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "stream, code, lines",
    [(">&-", 0, 0), (">/dev/full", 1, 1), (">&- 2>&-", 0, 0), ("2>/dev/full >/dev/null", 0, 0)],
)
def test_streams_that_are_closed_or_full_give_no_traceback(tmp_path, stream, code, lines):
    done = shell(f"EXACTARM evaluate ur10 {DATA} --out {tmp_path}/out {stream}")
    assert done.returncode == code and done.stderr.count("\n") == lines and "Traceback" not in done.stderr
    assert (tmp_path / "out/result.json").exists()


@pytest.mark.slow
def test_a_reader_that_leaves_is_no_fault(tmp_path):
    done = shell(f"EXACTARM evaluate ur10 {DATA} --out {tmp_path}/out | true; exit ${{PIPESTATUS[0]}}")
    assert done.returncode in (0, 1) and done.stderr == ""


@pytest.mark.slow
def test_a_path_that_is_no_text_is_refused_in_one_line(tmp_path):
    done = shell(
        rf"cp {DATA} $'{tmp_path}/\xff.csv'; EXACTARM evaluate ur10 $'{tmp_path}/\xff.csv' --out "
        rf"{tmp_path}/out",
        LANG="C",
    )
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert r"\udcff.csv: is no UTF-8 text" in done.stderr


@pytest.mark.slow
def test_an_error_line_stands_alone_where_the_home_cannot_be_written(tmp_path):
    home = tmp_path / "home"
    home.write_text("no folder")
    done = shell(
        f"EXACTARM evaluate ur10 {DATA} --out {tmp_path}/out --quiet", HOME=str(home), MPLCONFIGDIR=str(home)
    )
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "")


def test_a_name_from_a_file_does_not_steer_the_terminal():
    assert cli.visible("a\x1b]0;title\x07 b\n") == "a\\x1b]0;title\\x07 b\n"
    assert cli.visible("75 µm ± 3\t≤") == "75 µm ± 3\t≤"


def test_a_signal_while_the_folder_is_taken_leaves_nothing(tmp_path, monkeypatch):
    """Where an old result is removed: no `with` has begun that would end."""
    def interrupted(path, missing_ok=False):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(Path, "unlink", interrupted)
        with pytest.raises(KeyboardInterrupt):
            OutputFolder(tmp_path / "out").__enter__()
    assert not (tmp_path / "out/.partial").exists()
    with OutputFolder(tmp_path / "out"):  # the lock is free
        assert (tmp_path / "out/.partial").exists()
        with pytest.raises(InputError, match="another run is writing here"):
            OutputFolder(tmp_path / "out").__enter__()
        assert (tmp_path / "out/.partial").exists()
