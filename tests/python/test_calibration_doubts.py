"""What a calibration says of coarse readings and of a length far from the robot file's."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.data.dataset import read_dataset
from exactarm.files.examples import data_path
from exactarm.identify.calibrate import calibrate
from exactarm.identify.calibration_doubts import FAR_FROM_DRAWING, far_from_drawing
from exactarm.identify.reach import reach
from exactarm.robot_file import load_robot


@pytest.fixture(scope="module")
def ur10():
    robot = load_robot("ur10")
    data = read_dataset(data_path("ur10/series_B.csv"), robot)
    return robot, data.select(np.arange(0, len(data), 10))


def on_grid(values, step):
    return np.round(values / step) * step


def told(robot, data):
    return [line for line in calibrate(robot, data).warnings if "rounded to" in line or "comes out" in line]


def test_rounded_readings_are_told_with_their_step(ur10):
    robot, data = ur10
    assert told(robot, data) == []
    (line,) = told(robot, replace(data, position=on_grid(data.position, 0.01)))
    assert line.startswith("x, y, z are rounded to 10 mm, which alone leaves 4.1 of the ")  # z: few planes
    half = np.radians(0.5)
    (line,) = told(robot, replace(data, joints=data.joints | {"q": on_grid(data.joints["q"], half)}))
    assert line.startswith("joint angles are rounded to 0.5 degrees, which alone leaves ")


@pytest.mark.slow
def test_angles_that_were_commanded_on_a_grid_are_not_rounded(ur10):
    """Positions that follow them are those of the grid."""
    robot, data = ur10
    grid = on_grid(data.joints["q"], np.radians(1.0))
    noise = np.random.default_rng(3).normal(0.0, 3e-4, data.position.shape)
    assert told(robot, replace(data, joints={"q": grid}, position=robot.fk(grid).position + noise,
                               rotation=None)) == []


def test_a_length_with_two_digits_exchanged_is_told(ur10):
    robot, data = ur10
    joints = list(robot.joints)
    joints[2] = replace(joints[2], a=-0.5273)  # for -0.5723
    assert told(robot, data) == []
    (line,) = told(replace(robot, joints=tuple(joints)), data)
    assert line.startswith("a_3 comes out 4") and "from the -527.3 mm of the robot file" in line


@pytest.mark.parametrize("share, count", [(0.9, 0), (1.1, 1)])
def test_how_far_a_length_may_be_off(ur10, share, count):
    robot = ur10[0]
    joints = list(robot.joints)
    joints[1] = replace(joints[1], a=joints[1].a + share * FAR_FROM_DRAWING * reach(robot))
    assert len(list(far_from_drawing(robot, replace(robot, joints=tuple(joints))))) == count
