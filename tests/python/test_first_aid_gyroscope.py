"""Usual mistakes in runs under a gyroscope: units, time, scale, a wrong ratio, another clock."""

import re
from dataclasses import replace

import numpy as np
import pytest

from exactarm.data.dataset import Dataset
from exactarm.first_aid.first_aid import first_aid
from exactarm.identify.gear import identify_gears
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_gear_runs
from gear_simulation import GearRuns, simulate
from rigid_arm import rigid
from test_first_aid_units import later, on_a_clock

DEGREE = np.pi / 180.0


@pytest.fixture(scope="module")
def gyro_run():
    robot = load_robot("racer-7-1.4")
    return robot, measure_gear_runs(
        VirtualRobot.of(robot), [1], [0.6], 1, Sensors(), np.random.default_rng(5), 250.0
    )


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda d: replace(d, gyro=d.gyro / DEGREE), "is it in deg/s labelled as rad/s"),
        (lambda d: replace(d, time=1e-3 * d.time), "is the time in another unit"),
        (lambda d: replace(d, gyro=0.3 * d.gyro), "that of this arm"),
    ],
)
def test_a_mistake_under_a_gyroscope_is_told(gyro_run, change, words):
    robot, data = gyro_run
    assert first_aid(robot, data) == ()
    assert any(words in line for line in first_aid(robot, change(data)))


@pytest.mark.parametrize("axes, signs", [([1, 2, 0], [1, 1, 1]), ([0, 1, 2], [1, 1, -1])])
@pytest.mark.slow
def test_the_names_and_the_hand_of_a_gyroscopes_axes_mean_nothing(gyro_run, axes, signs):
    """One axis turns, so readings lie along one line, which is found: its mirror image is another."""
    robot, data = gyro_run
    (right,), (other,) = (identify_gears(robot, each).gears[:1]
                          for each in (data, replace(data, gyro=data.gyro[:, axes] * signs)))
    assert other.estimate.ratio == pytest.approx(right.estimate.ratio, rel=1e-9)
    np.testing.assert_allclose(other.table.a, right.table.a, rtol=1e-6)


def test_a_ratio_that_is_ten_per_cent_wrong_is_told_with_the_right_one(gyro_run):
    robot, data = gyro_run
    ratio = robot.ratios[1]
    told = first_aid(robot.with_joint(1, ratio=1.1 * ratio), data)
    assert len(told) == 1 and "motor 2" in told[0]
    assert float(told[0].rpartition("ratio ")[2].rstrip("?")) == pytest.approx(ratio, rel=0.01)


def test_a_sensor_with_another_scale_is_no_wrong_ratio():
    robot = load_robot("racer-7-1.4")
    virtual, random = VirtualRobot.of(robot), np.random.default_rng(5)
    data = measure_gear_runs(virtual, [1, 2], [0.6], 1, Sensors(), random, 250.0)
    told = first_aid(robot, replace(data, gyro=1.1 * data.gyro))
    assert len(told) == 1 and "every motor" in told[0]


def test_a_gyroscope_of_another_clock_is_told(gyro_run):
    """25 samples late, 0.1 s: the lag that the correlation finds lies within 3 % of it, whatever the bias."""
    robot, data = gyro_run
    late, drifting = (first_aid(robot, replace(data, gyro=change(data.gyro)))
                      for change in (later(25), on_a_clock(1.01)))
    told = re.search(r"the gyroscope lags by (\S+) s throughout", "\n".join(late))
    assert told and float(told[1]) == pytest.approx(0.1, rel=0.03)
    assert any("does its clock run" in line for line in drifting), drifting


def test_a_bias_is_no_clock():
    """It is late where the rate rises and early where it falls, of a slow motion above all."""
    robot = rigid().with_joint(1, q_ddot_max=0.3)
    margin = 0.5 * (robot.joints[1].q_max - robot.joints[1].q_min - 0.5)
    data = simulate(robot, GearRuns(2, 0.1, 2, 500.0, 5e-4, margin=margin), rest=np.zeros(6))
    assert first_aid(robot, replace(data, gyro=data.gyro + np.array([0.0, 1e-3, 3e-3]))) == ()


@pytest.mark.parametrize("starts, ends", [(0.6, 0.0), (0.0, 0.6), (0.6, 0.6)])
def test_a_run_that_is_cut_in_motion_has_no_clock_of_its_own(starts, ends):
    """Beyond its ends it went on: a mean that took it to stand still there saw -21 ms at the beginning of the
    first."""
    robot, random = rigid(), np.random.default_rng(6)
    time = np.arange(0.0, 5.2, 0.002)
    rate = np.interp(time, [0.1, 0.4, 1.67, 2.4, 4.8, 5.1], [starts, 0.6, 0.6, -0.6, -0.6, -ends])
    theta = np.zeros((len(time), 6))
    theta[:, 3] = robot.ratios[3] * 0.002 * np.cumsum(rate)
    gyro = np.outer(rate, [0.0, 0.6, 0.8]) + random.normal(0.0, 5e-4, (len(time), 3))
    data = Dataset.of_arrays("gear_run", {"theta": theta}, gyro=gyro, time=time, run=np.ones(len(time), int))
    assert first_aid(robot, data) == ()
