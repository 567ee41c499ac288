"""Clocks of motions: torques of a clock that runs a little faster than that of the angles, and all times
wrong by a factor. Masses hold against gravity and against acceleration in proportion: fast motions tell."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.data.dataset import read_dataset
from exactarm.files.examples import data_path
from exactarm.first_aid.drive_model import Motion, alone, samples_of
from exactarm.first_aid.motion_mistakes import motion_mistakes
from exactarm.robot_file import load_robot
from six_axis import six_axis
from test_identify_dynamics import log_of, true_arm

RATE_HZ = 100.0


def said(robot, data) -> str:
    return "; ".join(each.text for each in motion_mistakes(robot, data))


def with_torques_of_a_clock(data, share: float):
    """share: by which its seconds are shorter."""
    late = [np.interp(data.time * (1.0 + share), data.time, values) for values in data.joints["tau"].T]
    return replace(data, joints=data.joints | {"tau": np.stack(late, axis=1)})


@pytest.fixture(scope="module")
def motion():
    return log_of(true_arm(5), 20.0, 2, RATE_HZ)


@pytest.mark.parametrize("share, way", [(1e-3, "faster"), (-1e-3, "slower")])
@pytest.mark.slow
def test_a_drift_of_a_thousandth_is_told_from_twenty_seconds_on(motion, share, way):
    words = said(six_axis(), with_torques_of_a_clock(motion, share))
    assert "torques of a clock that runs 0.1 %" in words.replace("0.097", "0.1").replace("0.099", "0.1")
    assert way in words


@pytest.mark.parametrize("factor, words", [
    (0.5, "times longer"), (0.8, "all times 1.3 times longer"), (1.5, "all times 1.5 times shorter"),
])
@pytest.mark.slow
def test_times_wrong_by_a_factor_are_told_where_the_arm_accelerates(motion, factor, words):
    assert words in said(six_axis(), replace(motion, time=factor * motion.time))


def test_what_is_left_follows_the_speed_smoothly(motion):
    """Columns that are zero but for rounding explain nothing: as unknowns they let it jump by 0.5 %."""
    samples = samples_of(six_axis(), motion)
    left = [np.prod(alone(replace(samples, motion=samples.motion.at(speed))).shares)
            for speed in np.linspace(0.79, 0.80, 11)]
    assert np.max(np.abs(np.diff(left, 2))) < 1e-4 * left[0]


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.slow
def test_right_times_are_not_suspected(seed):
    assert said(six_axis(), log_of(true_arm(seed + 3), 20.0, seed, RATE_HZ)) == ""


def test_the_shipped_motion_is_not_suspected():
    robot = load_robot("tx40")
    assert said(robot, read_dataset(data_path("tx40/motion.parquet"), robot)) == ""


def test_the_same_path_at_another_speed_is_what_the_core_says_of_it():
    robot, random = six_axis(), np.random.default_rng(3)
    motion = Motion(robot, *random.normal(size=(3, 20, robot.axes)))
    for speed in (0.4, 1.3, 3.0):
        other = motion.at(speed)
        rate, acceleration = speed * motion.rate, speed**2 * motion.acceleration
        core = Motion(robot, motion.q, rate, acceleration, clock=speed)
        np.testing.assert_allclose(other.links, core.links, atol=1e-14 * np.abs(core.links).max())
        np.testing.assert_allclose(other.grams, core.grams, atol=1e-13 * np.abs(core.grams).max())


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.slow
def test_noise_that_interpolation_takes_away_is_no_clock(seed):
    """Torques of any drifting clock are interpolated, and so have less noise: all three were suspected."""
    data = log_of(true_arm(seed + 3), 9.0, seed, 50.0)
    torque = data.joints["tau"]
    noise = np.random.default_rng(seed).normal(0.0, 0.03 * np.abs(torque).max(axis=0), torque.shape)
    assert said(six_axis(), replace(data, joints=data.joints | {"tau": torque + noise})) == ""
