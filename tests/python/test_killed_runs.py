"""Runs that are killed at any moment, and two at once: never a result that is not whole, never one run's file
with another's."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from exactarm import cli
from exactarm.commands.listing import find_commands
from exactarm.files.examples import data_path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.kills import not_whole
from robustness.short_runs import RUNS

DATA = [str(data_path("ur10/series_B.csv")), str(data_path("ur10/series_C.parquet"))]
KILLS, SEED = 5, 4  # moments; EXACTARM_KILLS=200 for a night
LONGEST_S = 3.0  # about what the command takes


PROGRAM = Path(__file__).parents[1] / "robustness/kills.py"  # in a process of its own: it forks
PATIENCE_S = 600.0  # of a loaded machine


@contextmanager
def started(out: Path, data: str) -> Iterator[subprocess.Popen]:
    """A run that does not outlive its test."""
    words = [sys.executable, "-m", "exactarm", "evaluate", "ur10", data, "--out", str(out), "--quiet",
             "--threads", "1"]
    paths = {"PYTHONPATH": str(Path(cli.__file__).parents[1]), "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(words, env=os.environ | paths, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                          text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def whole(out: Path) -> bool:
    """Whether there is a result; if so, all its files are there and its own."""
    assert not_whole(out) == []
    return (out / "result.json").exists()


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("killed") / "out"
    with started(folder, DATA[0]) as process:
        assert process.wait(PATIENCE_S) == 0 and whole(folder)
    return folder


@pytest.mark.slow
def test_a_run_killed_at_any_moment_leaves_a_whole_result_or_none(out):
    random = np.random.default_rng(SEED)
    for number in range(int(os.environ.get("EXACTARM_KILLS", KILLS))):
        with started(out, DATA[number % 2]):
            time.sleep(random.uniform(0.0, LONGEST_S))
        whole(out)
    with started(out, DATA[0]) as process:
        assert process.wait(PATIENCE_S) == 0 and whole(out)
    assert not (out / ".partial").exists()


@pytest.mark.slow
def test_of_two_runs_into_one_folder_one_is_refused(out):
    codes, said = [], []
    with started(out, DATA[0]) as first, started(out, DATA[1]) as second:
        for process in (first, second):
            said.append(process.communicate(timeout=PATIENCE_S)[1])
            codes.append(process.returncode)
    assert whole(out)
    assert sorted(codes) in ([0, 2], [0, 0])  # both, where the machine ran them one after the other
    assert all(("another run is writing here" in text) == (code == 2) for code, text in zip(codes, said))


def test_every_command_has_a_short_run():
    assert set(RUNS) == set(find_commands())


def test_a_file_that_is_missing_or_of_another_run_is_seen(tmp_path):
    (tmp_path / "result.json").write_text('{"files": {"robot.toml": "0"}}')
    assert len(not_whole(tmp_path)) == 1
    (tmp_path / "robot.toml").write_text("name = 'other'")
    assert len(not_whole(tmp_path)) == 1
    (tmp_path / "result.json").write_text('{"files": {"robot')
    assert len(not_whole(tmp_path)) == 1


@pytest.fixture(scope="module")
def kills_of_all(tmp_path_factory):
    """(output of the program that kills every command in turn, its exit code)."""
    # of one seed: the moments of a command hang on it and the command's place in RUNS, not on those before
    words = ["--count", os.environ.get("EXACTARM_KILLS", "2"), "--seed", str(SEED)]
    folder = tmp_path_factory.mktemp("kills")
    paths = {"PYTHONPATH": str(Path(cli.__file__).parents[1]), "TMPDIR": str(folder)}
    done = subprocess.run([sys.executable, str(PROGRAM), *words], env=os.environ | paths, capture_output=True,
                          text=True, timeout=len(RUNS) * PATIENCE_S)
    return done.stdout + done.stderr, done.returncode


@pytest.mark.slow
@pytest.mark.parametrize("command", RUNS)
def test_any_command_killed_at_any_moment_leaves_a_whole_result_or_none(command, kills_of_all):
    told, code = kills_of_all
    said = rf"^{command}: [1-9]\d* kills, \d+ after its end, 0 left what is not whole$"
    assert re.search(said, told, re.MULTILINE), told
    assert code == 0, told
