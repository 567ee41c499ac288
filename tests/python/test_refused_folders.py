"""A folder that could not take the results is refused before the work: exit 2, one line, what stood there
stands there still."""

import contextlib
import ctypes
import json
import re
import sys
from pathlib import Path

import pytest

import exactarm as ea
from exactarm import cli
from exactarm.commands.execute import parse
from exactarm.commands.listing import find_commands, import_command
from exactarm.commands.output import ALWAYS, PICTURES, OutputFolder, may_write
from exactarm.errors import InputError

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from robustness.short_runs import RUNS, environment, prepare, words_of


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("samples")
    prepare(made)
    return made


def idle(command: str, monkeypatch):
    """The command's module, its work taken out."""
    module = import_command(command)

    def work(_):
        raise AssertionError("the work has begun")

    monkeypatch.setattr(module, "run", work)
    return module


def one_line(words, capsys) -> str:
    assert cli.main(words) == 2
    told = capsys.readouterr().err
    assert re.fullmatch(r"exactarm: error: [^\n]+\n", told), told
    return told


@pytest.mark.parametrize("command", RUNS)
@pytest.mark.slow
def test_a_file_of_the_user_is_found_before_the_work(command, folder, tmp_path, monkeypatch, capsys):
    words = words_of(command, folder, tmp_path / "out")
    module = idle(command, monkeypatch)
    (tmp_path / "out").mkdir()
    for pattern in may_write(module, parse(module, words[1:])):
        if pattern in PICTURES:  # they give way: below
            continue
        mine = tmp_path / "out" / pattern.replace("[[]", "[").replace("*", "mine")
        mine.parent.mkdir(exist_ok=True)
        mine.write_text("mine")
        told = one_line(words, capsys)
        assert f"{mine}: would be overwritten by the result of the same name; expected another --out" in told
        assert mine.read_text() == "mine"
        mine.unlink()
    assert [path.name for path in (tmp_path / "out").iterdir()] == []


@pytest.mark.slow
def test_a_picture_of_the_user_among_the_plots_stays_and_no_run_is_refused(tmp_path):
    first = ea.calibrate("ur10", ea.example("ur10/series_B"), threads=1)
    first.save(tmp_path)
    plots = tmp_path / "plots"
    (plots / "my_sketch.svg").write_text("mine")
    (plots / "error_histogram.svg").unlink()
    (plots / "error_histogram.svg").mkdir()  # not even a file
    listed = (tmp_path / ".written").read_text().replace("plots/error_per_row.png\n", "")
    (tmp_path / ".written").write_text(listed)  # as if no run had written it
    (tmp_path / "result.json").unlink()  # which names it, too
    (plots / "error_per_row.png").write_text("mine too")
    first.save(tmp_path)
    assert (plots / "my_sketch.svg").read_text() == "mine"
    assert (plots / "error_per_row.png").read_text() == "mine too"
    assert (plots / "error_per_row_2.png").read_bytes().startswith(b"\x89PNG")
    named = json.loads((tmp_path / "result.json").read_text())["files"]
    assert {"plots/error_per_row_2.png", "plots/parameters.svg"} <= set(named)
    assert not {"plots/error_per_row.png", "plots/my_sketch.svg"} & set(named)
    first.save(tmp_path)  # again: the numbered picture is a run's own now
    assert not (plots / "error_per_row_3.png").exists()


def _file(out):
    out.write_text("x")


def _under_a_file(out):
    out.parent.write_text("x")


def _dangling(out):
    out.symlink_to(out.parent / "nowhere" / "x")


def _folder_of_that_name(out):
    (out / "report.html").mkdir(parents=True)


def _dangling_result(out):
    out.mkdir()
    (out / "residuals.csv").symlink_to("nowhere")


def _plots_file(out):
    out.mkdir()
    (out / "plots").write_text("x")


def _plots_elsewhere(out):
    out.mkdir()
    (out.parent / "elsewhere").mkdir()
    (out / "plots").symlink_to("../elsewhere")


def _own_result(out):
    out.mkdir()
    (out / "result.json").write_text('{"of": "another program"}')


def _locked_list(out):
    (out / ".written").mkdir(parents=True)


OBSTACLES = {
    _file: "expected a folder", _under_a_file: "expected a folder", _dangling: "expected a folder",
    _folder_of_that_name: "report.html: is a folder where a result is to be written",
    _dangling_result: "residuals.csv: would be overwritten",
    _plots_file: "plots: stands where a folder of plots is to be written",
    _plots_elsewhere: "plots: stands where a folder of plots is to be written",
    _own_result: "result.json: would be overwritten",
    _locked_list: "expected a folder",
}


@pytest.mark.parametrize("obstacle", OBSTACLES)
def test_what_stands_in_the_way_is_found_before_the_work(obstacle, tmp_path, monkeypatch, capsys):
    out = tmp_path / "parent" / "out"
    if obstacle is not _under_a_file:
        out.parent.mkdir()
    obstacle(out)
    idle("calibrate", monkeypatch)
    told = one_line(["calibrate", "ur10", "ur10/series_B", "--out", str(out)], capsys)
    assert OBSTACLES[obstacle] in told


@pytest.mark.parametrize("out", ["/proc/x", "", " ", "x" * 300, "a\0b"])
def test_a_folder_that_cannot_be_made_is_found_before_the_work(out, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    idle("calibrate", monkeypatch)
    told = one_line(["calibrate", "ur10", "ur10/series_B", "--out", out], capsys)
    assert "expected" in told and list(tmp_path.iterdir()) == []


def test_a_result_that_the_run_reads_is_found_before_the_work(tmp_path, monkeypatch, capsys):
    """As `calibrate out/robot.toml ... --out out`: the file is of an earlier run and an input of this one."""
    result = ea.export("ur10", format="urdf")
    result.save(tmp_path)
    idle("gear", monkeypatch)
    words = ["gear", str(tmp_path / "robot.urdf"), "kr300/run_A", "--out", str(tmp_path)]
    assert "robot.urdf: would be overwritten" in one_line(words, capsys)
    assert (tmp_path / "result.json").exists()  # a refused run costs no earlier result


def test_functions_with_a_folder_refuse_it_before_the_work(tmp_path, monkeypatch):
    (tmp_path / "summary.parquet").write_text("mine")
    monkeypatch.setattr("exactarm.commands.batch.run_job", lambda *_: pytest.fail("the work has begun"))
    with pytest.raises(InputError, match="summary.parquet: would be overwritten"):
        ea.batch([{"command": "export", "robot": "ur10", "format": "csv"}], tmp_path)
    result = ea.export("ur10", format="csv")
    (tmp_path / "parameters.csv").write_text("mine")
    monkeypatch.setattr("exactarm.commands.publish.draw", lambda *_: pytest.fail("the work has begun"))
    with pytest.raises(InputError, match="parameters.csv: would be overwritten"):
        result.save(tmp_path)


def test_what_comes_into_the_way_during_the_work_is_found_at_its_end(tmp_path):
    with OutputFolder(tmp_path, ["a.csv", *ALWAYS]) as folder:
        folder.write_text("a.csv", "result")
        folder.write_result({})
        (tmp_path / "a.csv").mkdir()
        with pytest.raises(InputError, match=r"a\.csv: is a folder where a result is to be written"):
            folder.publish()
        (tmp_path / "a.csv").rmdir()
        (tmp_path / "a.csv").write_text("mine")
        with pytest.raises(InputError, match=r"a\.csv: would be overwritten"):
            folder.publish()


# -- read-only folders -------------------------------------------------------------------------------------
DAC_OVERRIDE = 1 << 1  # the capability by which root writes into what is read-only
THIS_THREAD = (ctypes.c_uint32 * 2)(0x20080522, 0)  # version 3: two words of each of three sets
PR_GET_SECUREBITS, PR_SET_SECUREBITS, NO_SETUID_FIXUP = 27, 28, 1 << 2  # else access() asks what root might


@contextlib.contextmanager
def as_a_user():
    """Permissions bind what runs here, though it is root."""
    libc, sets = ctypes.CDLL(None), (ctypes.c_uint32 * 6)()
    assert libc.capget(THIS_THREAD, sets) == 0
    effective, bits = sets[0], libc.prctl(PR_GET_SECUREBITS, 0, 0, 0, 0)
    try:
        libc.prctl(PR_SET_SECUREBITS, bits | NO_SETUID_FIXUP, 0, 0, 0)  # a user has no right to, nor need
        sets[0] = effective & ~DAC_OVERRIDE
        assert libc.capset(THIS_THREAD, sets) == 0
        yield
    finally:
        sets[0] = effective
        assert libc.capset(THIS_THREAD, sets) == 0
        libc.prctl(PR_SET_SECUREBITS, bits, 0, 0, 0)


@pytest.fixture
def told_to_a_user(folder, monkeypatch, capsys):
    """Exit code and stderr of each line, in the folder `where`, where permissions bind."""
    for name, value in environment(Path(cli.__file__).parents[1], folder).items():
        monkeypatch.setenv(name, value)

    def told(lines: list[list[str]], where: Path) -> list[tuple[int, str]]:
        monkeypatch.chdir(where)
        with as_a_user():
            return [(cli.main(words), capsys.readouterr().err) for words in lines]

    return told


@contextlib.contextmanager
def read_only(*folders: Path):
    for each in folders:
        each.chmod(0o555)
    try:
        yield
    finally:
        for each in folders:
            each.chmod(0o755)


def files(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_every_command_refuses_a_read_only_folder_and_leaves_the_result_in_it(folder, tmp_path,
                                                                              told_to_a_user):
    ea.export("ur10", format="urdf").save(tmp_path / "out")
    (tmp_path / "out/plots").mkdir()
    (tmp_path / "out/.partial").mkdir()  # of a run that was killed
    before = files(tmp_path)
    for shut, said in (("out", "out: cannot write here"), ("out/plots", "plots: stands where a folder")):
        names = [name for name in RUNS if shut == "out" or PICTURES[0] in may_write(
            import_command(name), parse(import_command(name), words_of(name, folder, tmp_path)[1:]))]
        with read_only(tmp_path / shut, tmp_path):
            told = told_to_a_user([words_of(name, folder, tmp_path / "out") for name in names], tmp_path)
        for name, (code, line) in zip(names, told, strict=True):
            assert code == 2 and line.count("\n") == 1 and said in line, (name, line)
        assert len(names) >= 8 and files(tmp_path) == before


@pytest.mark.slow
@pytest.mark.drawn
def test_a_read_only_working_folder_is_no_obstacle(folder, tmp_path, told_to_a_user):
    (tmp_path / "cwd").mkdir()
    names = ["export", "merge", "accept", "evaluate", "simulate"]
    with read_only(tmp_path / "cwd"):
        told = told_to_a_user([words_of(name, folder, tmp_path / name) for name in names], tmp_path / "cwd")
        shut = told_to_a_user([words_of("export", folder, Path("out"))], tmp_path / "cwd")
    assert told == [(0, "")] * len(names) and list((tmp_path / "cwd").iterdir()) == []
    assert all((tmp_path / name / "result.json").exists() for name in names)
    assert shut == [(2, "exactarm: error: out: cannot write here (Permission denied), expected a folder\n")]


def test_a_read_only_folder_of_one_job_stops_no_other(tmp_path, told_to_a_user):
    (tmp_path / "manifest.csv").write_text("name,command,robot,format\none,export,ur10,csv\n"
                                           "two,export,ur10,csv\n")
    words = ["batch", str(tmp_path / "manifest.csv"), "--out", str(tmp_path / "fleet"), "--quiet"]
    (tmp_path / "fleet/one").mkdir(parents=True)
    ea.export("ur10", format="urdf").save(tmp_path / "fleet/one")
    before = files(tmp_path / "fleet/one")
    with read_only(tmp_path / "fleet/one"):
        [(code, line)] = told_to_a_user([words], tmp_path)
    assert code == 1 and line.count("\n") == 1
    assert line.endswith("1 failed. one: "
                         f"{tmp_path}/fleet/one: cannot write here (Permission denied), expected a folder\n")
    assert files(tmp_path / "fleet/one") == before and (tmp_path / "fleet/two/result.json").exists()


def test_a_read_only_library_of_effects_is_one_line(folder, tmp_path, told_to_a_user):
    (folder / "effects").mkdir(exist_ok=True)
    with read_only(folder / "effects"):
        [(code, line)] = told_to_a_user([words_of("accept", folder, tmp_path / "out")], tmp_path)
    assert code == 2 and line.count("\n") == 1 and "effects: cannot be written (Permission denied)" in line
    assert not (tmp_path / "out/result.json").exists()


def test_every_command_says_what_it_writes():
    """`accept` writes into the library of effects alone. conftest.py holds in every test that nothing else is
    written."""
    silent = [name for name in find_commands() if not hasattr(import_command(name), "WRITES")]
    assert silent == ["accept"]


@pytest.mark.parametrize("there", [(), ("out",), ("out", "deep")])
def test_a_refused_run_leaves_no_folder_that_was_not_there(there, tmp_path, capsys):
    (tmp_path / "wrong.csv").write_text("q_1_rad,x_mm\n1,2\n")
    tmp_path.joinpath(*there).mkdir(parents=True, exist_ok=True)
    stood = sorted(tmp_path.rglob("*"))
    assert cli.main(["calibrate", "ur10", str(tmp_path / "wrong.csv"),
                     "--out", str(tmp_path / "out" / "deep")]) == 2
    assert "column y" in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == stood
