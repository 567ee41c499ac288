"""What holds for every command, by its short run: the same bits on any number of threads, for any size of
blocks and any order of Python's sets, the same numbers by the instructions of another processor, no file
outside its folders, no network, no program; one owner of a folder; a full disk is one line."""

import json
import os
import re
import shutil
import subprocess
import sys
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import exactarm as ea
from exactarm import cli
from exactarm.commands.execute import parse
from exactarm.commands.listing import import_command
from exactarm.commands.output import WRITTEN, OutputFolder, may_write
from exactarm.commands.plain import plain
from exactarm.diagnose import fitted, self_test
from exactarm.first_aid import misfit
from exactarm.identify import evaluate
from exactarm.robot_file import shipped_robots
from exactarm.verify import held_out

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.same_numbers import EQUAL, differences
from robustness.short_runs import OTHER_PROCESSOR, RUNS, environment, prepare, words_of

PACKAGE = Path(cli.__file__).parents[1]
ROBUSTNESS = Path(__file__).parents[1] / "robustness"
WATCHED, FULL_DISK = ROBUSTNESS / "watched.py", ROBUSTNESS / "full_disk.py"
PARTS = {"batch": ["*/*"], "demo": ["*/*"]}  # folders that commands of their own write
CHANGES = ("run", "seconds", "files", "asked", "pdf")  # keys of result.json that a second run has anew
PLANNED_IN = r"iterations and [0-9.]+ \w*s\b"  # how long a plan took, in a verdict


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("commands")
    prepare(made)
    (made / "tmp").mkdir()
    return made


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """Where all runs that are compared write, one after the other."""
    return tmp_path_factory.mktemp("compared") / "out"


def run(command: str, folder: Path, out: Path, program: list[str], threads: int, **variables: str):
    words = words_of(command, folder, out)
    words[words.index("--threads") + 1] = str(threads)
    return subprocess.run(
        [sys.executable, *program, *words], env=environment(PACKAGE, folder) | variables, text=True,
        capture_output=True, timeout=1800,
    )


def lasting(value: object) -> object:
    """The same without what a second run has anew."""
    if isinstance(value, dict):
        return {key: lasting(item) for key, item in value.items() if key not in CHANGES}
    return [lasting(item) for item in value] if isinstance(value, list) else value


def content(out: Path) -> dict[str, object]:
    """Every file below `out` that another run has to give again, without times."""
    found: dict[str, object] = {}
    for path in sorted(out.rglob("*")):
        name = str(path.relative_to(out))
        if path.name == "result.json":
            text = re.sub(PLANNED_IN, "iterations and TIME", path.read_text().replace(str(out), "OUT"))
            found[name] = lasting(json.loads(text))
        elif path.suffix in (".csv", ".svg", ".src", ".script", ".urdf"):
            found[name] = path.read_bytes()
        elif path.suffix == ".toml":
            text = path.read_text().replace(str(out), "OUT")
            found[name] = re.sub(r'(date|run|sha256) = "[^"]*"', r"\1", text)
    return found


def watched(command: str, folder: Path, out: Path, threads: int) -> dict[str, object]:
    """What a run leaves that may touch nothing but its folders and write nothing but what it declares."""
    done = run(command, folder, out, [str(WATCHED), f"{folder}{os.pathsep}{out.parent}"], threads,
               PYTHONHASHSEED=str(threads), TMPDIR=str(folder / "tmp"))
    assert (done.returncode, done.stderr) == (0, "")
    module, words = import_command(command), words_of(command, folder, out)
    declared = may_write(module, parse(module, words[1:])) + PARTS.get(command, [])
    written = [path.relative_to(out).as_posix() for path in out.rglob("*")
               if path.is_file() and path.name != WRITTEN]
    assert [name for name in written if not any(fnmatch(name, each) for each in declared)] == []
    found = content(out)
    shutil.rmtree(out)
    assert len(found) > 0
    return found


@pytest.fixture(scope="module")
def in_one_thread(folder, out):
    """command -> what its watched run in one thread leaves; every command runs once."""
    return cache(lambda command: watched(command, folder, out, 1))


@pytest.mark.slow
@pytest.mark.parametrize("command", RUNS)
def test_a_command_gives_the_same_bits_and_touches_nothing_else(command, folder, out, in_one_thread):
    one, two = in_one_thread(command), watched(command, folder, out, 2)
    assert one.keys() == two.keys()
    assert [name for name in one if one[name] != two[name]] == []


@pytest.mark.slow
@pytest.mark.parametrize("command", RUNS)
def test_another_processor_gives_the_same_numbers(command, folder, out, in_one_thread):
    one = in_one_thread(command)
    done = run(command, folder, out, ["-m", "exactarm"], 1, **OTHER_PROCESSOR)
    assert (done.returncode, done.stderr) == (0, "")
    other = content(out)
    shutil.rmtree(out)
    one, other = ({name: told for name, told in each.items() if Path(name).name == "result.json"}
                  for each in (one, other))
    assert len(one) > 0
    assert [words for size, words in differences(one, other) if size > EQUAL] == []


@pytest.mark.slow
def test_the_watch_sees_what_leaves_the_folder(folder, tmp_path):
    done = run("accept", folder, tmp_path / "out", [str(WATCHED), str(tmp_path)], 1)
    assert done.returncode == 3 and str(folder / "effects") in done.stderr


@pytest.fixture(scope="module")
def on_full_disks(folder):
    """command -> what its run on a full disk does."""
    done = subprocess.run([sys.executable, str(FULL_DISK)], env=environment(PACKAGE, folder), text=True,
                          capture_output=True, timeout=1800)
    assert (done.returncode, done.stderr) == (0, "")
    return {each["command"]: each for each in map(json.loads, done.stdout.splitlines())}


@pytest.mark.slow
@pytest.mark.parametrize("command", RUNS)
def test_a_full_disk_is_one_line_and_no_result(command, on_full_disks):
    done = on_full_disks[command]
    assert done["code"] == 1 and done["told"].count("\n") == 1
    assert done["told"].startswith(f"exactarm: error: {done['out']}: ") and "fault" not in done["told"]
    if command != "batch":  # its result, were it small enough, would tell of the jobs that failed
        assert not done["left"]


@pytest.mark.parametrize("command", RUNS)
@pytest.mark.slow
def test_a_folder_of_another_run_or_one_that_is_read_only_is_refused(command, folder, tmp_path, capsys):
    with OutputFolder(tmp_path / "out"):
        assert cli.main(words_of(command, folder, tmp_path / "out")) == 2
    assert capsys.readouterr().err == (f"exactarm: error: {tmp_path}/out: another run is writing here; "
                                       "expected a folder of its own\n")
    assert cli.main(words_of(command, folder, Path("/proc/exactarm"))) == 2
    assert capsys.readouterr().err.startswith("exactarm: error: /proc/exactarm: cannot write here")


NO_NAME = "x" * 300  # longer than a file system's names


@pytest.mark.parametrize("command", RUNS)
@pytest.mark.slow
def test_a_name_that_no_file_can_have_is_bad_input(command, folder, tmp_path, capsys):
    words = words_of(command, folder, tmp_path / "out")
    places = [k for k, word in enumerate(words[: words.index("--out")])
              if Path(word).is_file() or word in shipped_robots()]
    assert places or command == "demo"
    circle = tmp_path / "circle"
    circle.symlink_to(circle)
    for place in [*places, words.index("--out") + 1]:
        for name in (NO_NAME, str(circle)):
            assert cli.main([*words[:place], name, *words[place + 1:]]) == 2, words[place]
            told = capsys.readouterr().err
            assert told.startswith(f"exactarm: error: {name}: ") and told.count("\n") == 1


BLOCKS = ((evaluate, "BLOCK_ROWS", 7), (held_out, "BLOCK_ROWS", 7), (misfit, "_MOST_TOGETHER", 50),
          (self_test, "_STRIP", 11))


@pytest.mark.parametrize("command", ["evaluate", *(pytest.param(name, marks=pytest.mark.slow)
                                                   for name in ("certify", "diagnose"))])
def test_the_size_of_the_blocks_gives_the_same_bits(command, folder, tmp_path, monkeypatch):
    found = []
    for blocks in ((), BLOCKS):
        for module, name, size in blocks:
            assert getattr(module, name) > size
            monkeypatch.setattr(module, name, size)
        assert cli.main(words_of(command, folder, tmp_path / "out")) == 0
        found.append(content(tmp_path / "out"))
        shutil.rmtree(tmp_path / "out")
    assert found[0]["result.json"]["robot"] and found[0].keys() == found[1].keys()
    assert [name for name in found[0] if found[0][name] != found[1][name]] == []


@pytest.mark.slow
def test_the_size_of_the_blocks_of_columns_changes_the_rounding_alone(monkeypatch):
    """Of a product with the same matrix, which adds up in another order where it is wider."""
    data = ea.read(ea.example("kr300/run_A"), "kr300", kind="gear_run")
    data, found = data.select(np.arange(0, len(data), 4)), []
    for size in (fitted._BLOCK_COLUMNS, 11):
        monkeypatch.setattr(fitted, "_BLOCK_COLUMNS", size)
        found.append(lasting(plain(ea.diagnose("kr300", data, threads=1).json)))
    assert [words for size, words in differences(*found) if size > EQUAL] == []
