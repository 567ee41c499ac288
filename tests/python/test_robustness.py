"""The trials of tests/robustness in short form; `make robustness` does ten thousand. A failure names its
seed:

    python tests/robustness/run.py --count 1 --seed N
"""

import sys
from pathlib import Path

import numpy as np
import pytest

from exactarm.errors import InputError

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.mutations import WAYS, mildly_spoiled, spoiled
from robustness.samples import samples
from robustness.trials import COMMANDS, READERS, run_trial

FIRST_SEED = 7000
READER_TRIALS, COMMAND_TRIALS = 400, 12


@pytest.fixture(scope="module")
def valid():
    return samples()


def test_the_samples_are_read_as_they_are(valid, tmp_path):
    for name, content in valid.items():
        (tmp_path / name).write_bytes(content)
    for name, read in READERS.items():
        read(tmp_path / name)
    asked = {word.lstrip("*") for words in COMMANDS for word in words if "." in word}
    assert asked <= set(valid) | {"racer-7-1.4"}


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_every_way_spoils_any_file(valid, way):
    random = np.random.default_rng(1)
    changed = [way(content, random) != content for content in valid.values() for _ in range(5)]
    assert any(changed) and way(b"", random) is not None


def test_the_same_seed_spoils_a_file_the_same_way(valid):
    one, other = (spoiled(valid["poses.csv"], np.random.default_rng(5)) for _ in range(2))
    assert one == other != valid["poses.csv"]


@pytest.mark.slow
def test_spoiled_files_are_read_or_refused_in_one_line(valid, tmp_path):
    trials = [run_trial(FIRST_SEED + k, tmp_path / "trial", valid, commands=0.0)
              for k in range(READER_TRIALS)]
    assert [f"seed {trial.seed}, {trial.what}: {trial.failure}" for trial in trials if trial.failure] == []


@pytest.mark.slow
def test_commands_on_spoiled_files_end_well_or_in_one_line(valid, tmp_path):
    trials = [run_trial(FIRST_SEED + k, tmp_path / "trial", valid, commands=1.0)
              for k in range(COMMAND_TRIALS)]
    assert [f"seed {trial.seed}, {trial.what}: {trial.failure}" for trial in trials if trial.failure] == []
    assert {trial.code for trial in trials} >= {2}


def test_a_trial_sees_a_fault(valid, tmp_path, monkeypatch):
    def fail(path):
        raise KeyError("oops")

    monkeypatch.setattr("robustness.trials.READERS", {"poses.csv": fail})
    trial = run_trial(FIRST_SEED, tmp_path / "trial", valid, commands=0.0)
    assert trial.failure == "KeyError: 'oops'"


def test_a_mild_change_leaves_a_file_that_is_mostly_read(valid, tmp_path):
    random, read = np.random.default_rng(6), 0
    for _ in range(40):
        (tmp_path / "poses.csv").write_bytes(mildly_spoiled(valid["poses.csv"], random))
        try:
            READERS["poses.csv"](tmp_path / "poses.csv")
            read += 1
        except InputError:
            continue
    assert 20 < read and mildly_spoiled(valid["poses.csv"], random) != valid["poses.csv"]
