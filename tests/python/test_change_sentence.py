"""Sentences that compare an error before and after say what the numbers say, in every command."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import exactarm as ea
from exactarm.cli import main
from exactarm.commands import calibrate as calibration
from exactarm.commands import diagnose_report, gear_report, identify
from exactarm.data.dataset import write_dataset
from exactarm.diagnose.verdict import sentence_of
from exactarm.identify.statistics import summarise
from exactarm.report.numbers import change
from exactarm.robot_file import write_robot
from test_consistent_inertia import bare_arm
from test_identify_dynamics import log_of, true_arm

BEFORE = 1.5e-3
CASES = {"falls from": 0.5e-3, "rises from": 2.5e-3, "stays at": 1.5e-3}


def summaries(value):
    return {"identification": summarise(np.full(5, value)), "validation": summarise(np.full(3, value))}


@pytest.mark.parametrize("word, after", CASES.items())
def test_the_words_of_a_change(word, after):
    assert change(BEFORE, after, "m").startswith(word)
    assert "1.5 mm" in change(BEFORE, after, "m") or "1.50 mm" in change(BEFORE, after, "m")


@pytest.mark.parametrize("before, after", [(0.0, 0.0), (1.0, 1.0049), (1.0, 0.9951), (float("nan"), 1.0)])
def test_what_reads_alike_is_no_change(before, after):
    assert change(before, after).startswith("stays")


def test_an_error_from_nothing_rises():
    assert change(0.0, 1e-6, "m").startswith("rises from 0")


def test_a_diagnosis_whose_error_rises_says_so():
    finding = SimpleNamespace(effect=SimpleNamespace(title="backlash of axis 2"), probability=0.99)
    for after, word in ((2.5e-3, "rises by 67 %"), (0.5e-3, "falls by 67 %"), (1.5e-3, "does not change")):
        said = sentence_of("explained", [finding], [], summaries(BEFORE), summaries(after), None, 1.0)
        assert word in said


@pytest.mark.slow
def test_identify_of_torques_that_turn_about(tmp_path):
    """Validation torques of the opposite sign: the model that was fitted to the others is worse than none."""
    robot = bare_arm()
    data = log_of(true_arm(), 8.0, 3)
    held_out = data.time > 5.0
    torque = np.where(held_out[:, None], -data.joints["tau"], data.joints["tau"])
    write_robot(tmp_path / "arm.toml", robot)
    write_dataset(
        tmp_path / "log.csv",
        replace(data, joints=data.joints | {"tau": torque}, identification=~held_out),
        robot,
    )
    result = ea.identify(tmp_path / "arm.toml", tmp_path / "log.csv")
    assert result.after["validation"].rms > result.before["validation"].rms
    assert "rises from" in result.verdict and "falls" not in result.verdict


def test_calibrate_with_too_few_poses(tmp_path):
    """Twelve poses for some thirty parameters: the fit follows the noise, and the held-out poses say so."""
    words = ["simulate", "ur10", "--count", "60", "--seed", "2", "--noise", "1e-3", "--out", str(tmp_path)]
    assert main([*words, "--quiet"]) == 0
    lines = (tmp_path / "measured.csv").read_text().splitlines()
    head, *rows = [line for line in lines if line]
    sets = ["identification"] * 12 + ["validation"] * (len(rows) - 12)
    names = head.split(",")
    rows = [",".join(v for n, v in zip(names, row.split(",")) if n != "set") for row in rows]
    names = ",".join(n for n in names if n != "set")
    (tmp_path / "few.csv").write_text(
        "\n".join([names + ",set", *(f"{r},{s}" for r, s in zip(rows, sets))]) + "\n"
    )
    result = ea.calibrate("ur10", tmp_path / "few.csv")
    assert result.after["validation"].mean > 1.01 * result.before["validation"].mean
    assert "rises from" in result.verdict and "falls" not in result.verdict


def test_no_command_has_a_sentence_of_its_own():
    """All that compare two errors in words ask `change`."""
    sources = Path(calibration.__file__).parent.glob("*.py")
    own = [path.name for path in sources if re.search(r"falls from|falls to|drops from", path.read_text())]
    assert own == []
    assert all(module.change is change for module in (calibration, identify, gear_report, diagnose_report))


@pytest.mark.slow
def test_the_error_before_is_worded_as_what_it_is_and_agrees_with_calibrate(tmp_path):
    """The springs of the file are not in what the controller calculates, and are in where `calibrate`
    begins. Nothing hangs on the seed: the two means are one calculation, and the springs are 0.9 mrad."""
    ea.simulate("racer-7-1.4", count=80, deviation=1.0, seed=3).save(tmp_path)
    rows = tmp_path / "measured.csv"
    calibrated = ea.calibrate("racer-7-1.4", rows)
    calibrated.save(tmp_path / "new")
    rigid = ea.certify(tmp_path / "new" / "robot.toml", rows)
    assert "without the springs and gear tables" in rigid["model_before"]
    assert "nominal" not in rigid["model_before"]
    same = ea.certify(tmp_path / "new" / "robot.toml", rows, before="racer-7-1.4")
    assert same["model_before"] == "racer-7-1.4"
    here, there = same["before"]["validation"]["mean"], calibrated["before"]["validation"]["mean"]
    assert here == pytest.approx(there, rel=1e-6)
    assert rigid["before"]["validation"]["mean"] > 1.2 * here
