"""Mistakes in one of several gear runs: told with the run and the guess; right runs are not suspected."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.first_aid.first_aid import first_aid
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_gear_runs
from test_first_aid import kr300  # noqa: F401
from test_first_aid_units import wrapped

DEGREE = np.pi / 180.0
SECOND = 2


@pytest.fixture(scope="module")
def gyro_runs():
    """Axes 2 and 3, two runs each, there and back."""
    robot = load_robot("racer-7-1.4")
    data = measure_gear_runs(VirtualRobot.of(robot), [1, 2], [0.6], 2, Sensors(), np.random.default_rng(5),
                             250.0)
    assert len(np.unique(data.run)) >= 4
    return robot, data


def gyro(change):
    def changed(data, rows):
        reading = data.gyro.copy()
        reading[rows] = change(reading[rows])
        return replace(data, gyro=reading)

    return changed


def angles(name, change):
    def changed(data, rows):
        values = data.joints[name].copy()
        values[rows] = change(values[rows])
        return replace(data, joints=data.joints | {name: values})

    return changed


UNDER_A_GYROSCOPE = {
    "deg/s": (gyro(lambda v: v / DEGREE), "is it in deg/s labelled as rad/s"),
    "rad/s as deg/s": (gyro(lambda v: v * DEGREE), "is it in rad/s labelled as deg/s"),
    "z negated": (gyro(lambda v: v * [1, 1, -1]), "has its axis z, or the motor's angle, the opposite sign"),
    "motor negated": (angles("theta", lambda v: -v), "or the motor's angle, the opposite sign"),
    "y and z exchanged": (gyro(lambda v: v[:, [0, 2, 1]]), "are its axes y, z exchanged"),
    "another ratio": (angles("theta", lambda v: 1.25 * v), "is the ratio in the robot file that of this arm"),
}


@pytest.mark.parametrize("name", UNDER_A_GYROSCOPE)
def test_a_mistake_in_one_run_under_a_gyroscope_is_told_with_the_run(gyro_runs, name):
    robot, data = gyro_runs
    change, words = UNDER_A_GYROSCOPE[name]
    said = first_aid(robot, change(data, data.run == SECOND))
    assert any(each.startswith(f"run {SECOND} (row ") and words in each for each in said), said


def test_right_runs_and_runs_of_another_stance_are_not_suspected(gyro_runs):
    robot, data = gyro_runs
    assert first_aid(robot, data) == ()
    both = gyro(lambda v: v[:, [2, 1, 0]])(data, np.ones(len(data), bool))
    assert first_aid(robot, both) == ()  # as the sensor's axes are named: the same in every run


BETWEEN_ENCODERS = {
    "motor in degrees": (angles("theta", lambda v: v / DEGREE), "is theta in degrees"),
    "link in degrees": (angles("q", lambda v: v / DEGREE), "is q in degrees"),
    "another ratio": (angles("theta", lambda v: 1.1 * v), "is the ratio in the robot file that of this arm"),
    "negated": (angles("q", lambda v: -v), "does one of the two have the opposite sign?"),
    "exchanged": (angles("q", lambda v: v[:, [1, 0, 2, 3, 4, 5]]), "axes exchanged?"),
}


@pytest.mark.parametrize("name", BETWEEN_ENCODERS)
def test_a_mistake_in_one_run_between_encoders_is_told_with_the_run(kr300, name):  # noqa: F811
    robot, data = kr300
    change, words = BETWEEN_ENCODERS[name]
    said = first_aid(robot, change(data, data.run == SECOND))
    assert said and f"run {SECOND} (row 1 of run_B.parquet to row " in said[0] and words in said[0], said


def counter_of(turns):
    return lambda values: values % (2.0 * np.pi * turns)


@pytest.mark.parametrize("change, words", [
    (wrapped, "jumps by a full turn"), (counter_of(16), "jumps by 16 turns"),
])
def test_angles_that_wrap_in_one_run_are_told(kr300, change, words):  # noqa: F811
    robot, data = kr300
    said = first_aid(robot, angles("theta", change)(data, data.run == SECOND))
    assert words in said[0] and "run_B.parquet" in said[0], said


def test_axes_that_move_at_once_under_a_gyroscope_are_told(gyro_runs):
    """Whether the sensor feels the second one hangs on where it sits: a ratio came out 1 % wrong without a
    word."""
    robot, data = gyro_runs
    theta = data.joints["theta"].copy()
    first = data.run == np.unique(data.run)[0]
    theta[first, 0] += robot.ratios[0] * np.linspace(0.0, 0.2, first.sum())
    (said,) = [text for text in first_aid(robot, replace(data, joints={**data.joints, "theta": theta}))
               if "at once" in text]
    assert "axes 1 and 2 move at once; a gyroscope" in said and said.startswith("run 1 (")
    assert not [text for text in first_aid(robot, data) if "at once" in text]


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_lost_samples_are_no_other_ratio_and_no_other_clock(gyro_runs, share):
    robot, data = gyro_runs
    kept = np.random.default_rng(6).random(len(data)) > share
    assert first_aid(robot, data.select(kept)) == first_aid(robot, data) == ()


def test_a_gyroscope_that_never_changes_is_told(gyro_runs):
    """It divided by zero."""
    robot, data = gyro_runs
    still = replace(data, gyro=np.zeros_like(data.gyro))
    assert "the gyroscope reads the same in every row" in first_aid(robot, still)[0]


@pytest.mark.parametrize("name", ["q", "theta"])
def test_a_side_of_a_gear_that_never_changes_is_told(kr300, name):  # noqa: F811
    robot, data = kr300
    values = np.where(np.arange(6) == 0, 0.1, data.joints[name])
    said = first_aid(robot, replace(data, joints=data.joints | {name: values}))
    assert any(f"{name}_1 is the same in every row" in line for line in said), said
