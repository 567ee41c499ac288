"""bench/diagnosis_time.py counts what a process used, and compares two checkouts on the same data."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "bench"))

import diagnosis_time  # noqa: E402
from exactarm.data.dataset import read_dataset  # noqa: E402
from exactarm.robot_file import load_robot  # noqa: E402


def test_a_command_is_measured_as_the_system_accounts_for_it():
    used = diagnosis_time.run(TOP, ["--version"])
    assert 0.0 < used["processor_seconds"] < 60.0 and 5.0 < used["peak_MB"] < 2000.0


@pytest.mark.slow
def test_a_command_that_fails_ends_the_measurement(tmp_path):
    with pytest.raises(SystemExit, match="ended with 2"):
        diagnosis_time.run(TOP, ["diagnose", "no such robot", "nothing.csv", "--out", str(tmp_path / "out")])


def test_ratio_is_of_the_other_checkout_to_this_one():
    one = {"processor_seconds": 2.0, "peak_MB": 100.0, "rms": 1e-4, "effects": ["backlash 2"]}
    other = one | {"processor_seconds": 6.0, "peak_MB": 400.0}
    assert "ratio 3.00, memory 4.00" in diagnosis_time.line("few", {"this": one, "that": other})


@pytest.mark.slow
def test_minute_between_encoders_is_read_as_gear_runs_at_a_thousand_hertz(tmp_path, monkeypatch):
    monkeypatch.setattr(diagnosis_time, "RUN_S", 0.5)
    robot, data = diagnosis_time.between_encoders(tmp_path)
    table = pd.read_csv(data)
    assert np.median(np.diff(table["time_s"])) == pytest.approx(1e-3)
    read = read_dataset([data], load_robot(robot))
    assert read.kind == "gear_run" and np.unique(read.run).size == diagnosis_time.RUNS
    assert diagnosis_time.RUNS * 10.0 == 60.0  # a minute
