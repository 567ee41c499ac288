"""A gear ratio that is wrong in the robot file shows in a motion beside declared masses, and is told with its
value."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.data.dataset import Dataset
from exactarm.first_aid.first_aid import first_aid
from exactarm.first_aid.ratio_mistakes import ratio_mistakes
from exactarm.first_aid.signal_mistakes import limit_mistakes
from exactarm.robot_file import load_robot
from motions import fourier_motion, motion_data

ROBOT = load_robot("racer-7-1.4")


def motion(robot, of_motor: bool = False):
    """8 s at 100 Hz with friction, and noise of 1 % of every axis' largest torque."""
    time, angle, rate, acceleration = fourier_motion(robot, 8.0, 100.0, seed=5)
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque = torque + 0.03 * np.abs(torque).max(axis=0) * np.tanh(rate / 5e-3)
    size = 0.01 * np.abs(torque).max(axis=0)
    torque = torque + np.random.default_rng(2).normal(0.0, size, torque.shape)
    data = motion_data(robot, time, angle, torque)
    if not of_motor:
        return data
    joints = {"theta": data.joints["theta"], "tau_motor": torque / robot.ratios}
    return replace(data, joints=joints)


@pytest.mark.parametrize("of_motor", [False, True])
@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.slow
def test_a_ratio_ten_per_cent_wrong_is_told_with_the_right_one(axis, of_motor):
    true = ROBOT.joints[axis].ratio
    said = first_aid(ROBOT.with_joint(axis, ratio=1.1 * true), motion(ROBOT, of_motor))
    assert len(said) == 1 and f"gear ratio of axis {axis + 1}" in said[0]
    guess = float(said[0].split("about ")[1].split()[0])
    assert guess == pytest.approx(true, rel=0.02)


@pytest.mark.parametrize("of_motor", [False, True])
def test_right_ratios_are_left_alone_though_masses_are_off(of_motor):
    random = np.random.default_rng(8)
    links = tuple(replace(link, mass=link.mass * (1.0 + 0.03 * random.standard_normal()))
                  for link in ROBOT.links)
    for robot in (ROBOT, replace(ROBOT, links=links)):
        assert list(ratio_mistakes(robot, motion(ROBOT, of_motor))) == []


def test_angles_of_the_controller_hang_on_no_ratio():
    data = motion(ROBOT)
    angles = {"q": data.joints["theta"] / ROBOT.ratios + ROBOT.offsets, "tau": data.joints["tau"]}
    wrong = ROBOT.with_joint(1, ratio=1.1 * ROBOT.joints[1].ratio)
    assert list(ratio_mistakes(wrong, replace(data, joints=angles))) == []


@pytest.mark.parametrize(("low", "high", "words"), [
    (-2.4, 0.0, "go to -2.4 rad"), (0.0, 2.6, "go to 2.6 rad"), (-1.9, 1.95, "go to -1.9 rad")])
def test_an_angle_beyond_its_axis_is_told_with_its_sign(low, high, words):
    """It had told the size alone, which pointed to the other end."""
    robot = load_robot("racer-7-1.4").with_joint(1, q_min=-0.5, q_max=1.5)
    q = np.zeros((50, 6))
    q[:, 1] = np.linspace(low, high, 50)
    (told,) = limit_mistakes(robot, Dataset.of_arrays("poses", {"q": q}, position=np.zeros((50, 3))))
    assert f"axis 2 {words}, far beyond what the axis can turn (-0.5 to 1.5 rad)" in told.text
