"""What one record tells (a tracker that was pushed, rows that are wrong) acts on its data files alone."""

import json
from dataclasses import replace

import numpy as np
import pytest

from exactarm import cli
from exactarm.data.dataset import Dataset, write_dataset
from exactarm.data.rows import Source
from exactarm.effects import effect_from_table, library
from exactarm.effects.tracker_drift import TrackerDrift
from exactarm.errors import InputError
from exactarm.plan.compensation import planning_model
from exactarm.robot_file import load_robot
from exactarm.simulate.virtual_robot import VirtualRobot
from set_ups import joints_in_limits, measured, true_robot

NOISE_M = 5e-5
COUNT = 120
PUSHED_M = np.array([4e-4, -3e-4, 2e-4])


def files(folder):
    """The same arm measured twice; in the first file the tracker is pushed half-way."""
    rng = np.random.default_rng(8)
    robot = load_robot("ur10")
    truth = true_robot(robot, rng, 0.5)
    for name, push in (("pushed", PUSHED_M), ("still", np.zeros(3))):
        q = np.clip(joints_in_limits(robot, COUNT, rng), -2.2, 2.2)
        data = measured(robot, [truth], [q], NOISE_M, rng, identification=np.arange(COUNT) % 4 != 0)
        later = np.arange(COUNT) >= COUNT // 2
        write_dataset(folder / f"{name}.csv", replace(data, position=data.position + later[:, None] * push),
                      robot)


def run(*words):
    assert cli.main([str(word) for word in words] + ["--quiet"]) == 0


def read(folder):
    return json.loads((folder / "result.json").read_text())


@pytest.mark.slow
def test_a_push_stays_with_its_data(tmp_path):
    files(tmp_path)
    pushed, still = tmp_path / "pushed.csv", tmp_path / "still.csv"
    run("diagnose", "ur10", pushed, "--out", tmp_path / "found")
    robot_file = tmp_path / "found" / "robot.toml"
    robot = load_robot(robot_file)
    assert [effect.name for effect in robot.effects] == ["tracker_step"]
    sha = read(tmp_path / "found")["inputs"][0]["sha256"]
    assert robot.effects[0].record == (sha,) and sha in robot_file.read_text()

    # The data that it tells of: nothing is found twice, and the error stays down. Other data: it has no part.
    run("diagnose", robot_file, pushed, "--out", tmp_path / "again")
    assert read(tmp_path / "again")["effects"] == []
    for data in (pushed, still):
        run("evaluate", robot_file, data, "--out", tmp_path / "judged")
        assert read(tmp_path / "judged")["error"]["rms"] < 1.3 * np.sqrt(3.0) * NOISE_M

    # A calibration with other data keeps it for its own.
    run("calibrate", robot_file, still, "--out", tmp_path / "calibrated")
    assert read(tmp_path / "calibrated")["after"]["validation"]["rms"] < 1.4 * np.sqrt(3.0) * NOISE_M
    kept = load_robot(tmp_path / "calibrated" / "robot.toml")
    assert kept.effects[0] == robot.effects[0]

    # Neither a virtual robot nor a plan knows it.
    assert VirtualRobot.of(robot).layout.effects == ()
    assert not any("tracker_step" in warning for warning in planning_model(robot).warnings)


def test_files_are_told_by_their_content_and_order():
    data = Dataset.of_arrays("poses", {"q": np.zeros((4, 6))})
    drift = TrackerDrift(None, (1e-4, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert drift.bound_to(data) == drift and drift.acts_on(data)
    one, two = (replace(data, sources=(Source(name, name * 64, 4),)) for name in "ab")
    bound = drift.bound_to(one)
    both = replace(data, sources=one.sources + two.sources)
    assert (
        bound.acts_on(one) and not bound.acts_on(two) and not bound.acts_on(data) and not bound.acts_on(both)
    )
    assert bound.acts_on(one.select(np.arange(2)))
    assert effect_from_table(bound.to_table()) == bound


def test_a_thermal_drift_belongs_to_the_arm():
    drift = library()["thermal_drift"]
    table = {"effect": "thermal_drift", "form": "growth", "growth_1_per_h": 1e-5, "growth_1_per_degC": 1e-5,
             "growth_1_per_row": 1e-5}
    assert drift.from_table(table | {"driver": "row"}).of_record
    assert not any(drift.from_table(table | {"driver": driver}).of_record
                   for driver in ("time", "temperature_degC"))


@pytest.mark.parametrize("record", ['"abc"', "[1]"])
def test_a_wrong_record_is_refused(tmp_path, record):
    path = tmp_path / "robot.toml"
    text = "\n".join(["[[joints]]", "a_m = 1.0", "[[effects]]", 'effect = "outliers"', "threshold_m = 1e-3",
                      f"data_sha256 = {record}"])
    path.write_text('name = "r"\n' + text + "\n")
    with pytest.raises(InputError, match=r"effects\[1\]"):
        load_robot(path)
