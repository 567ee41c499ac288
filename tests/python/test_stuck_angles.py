"""An angle that never changes while its axis' torque does what no rest asks for was not measured; an axis
that stands is left alone."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.data.dataset import read_dataset
from exactarm.files.examples import data_path
from exactarm.first_aid.first_aid import first_aid
from exactarm.robot_file import load_robot
from motions import fourier_motion, motion_data


@pytest.fixture(scope="module")
def tx40():
    robot = load_robot("tx40")
    return robot, read_dataset([data_path("tx40/motion.parquet")], robot)


def stuck(data, axis, name="theta"):
    angles = data.joints[name].copy()
    angles[:, axis] = angles[0, axis]
    return replace(data, joints={**data.joints, name: angles})


SLOW = [pytest.param(axis, marks=pytest.mark.slow) for axis in (0, 1, 3, 4, 5)]


@pytest.mark.parametrize("axis", [2, *SLOW])
def test_an_overwritten_angle_is_told(tx40, axis):
    """It went through without a word, or other axes were suspected."""
    robot, data = tx40
    (line,) = first_aid(robot, stuck(data, axis))
    assert line.startswith(f"theta_{axis + 1} is the same in every row, and ")
    assert line.endswith("is none that an axis at rest asks for: was its angle never measured?")


@pytest.mark.parametrize("name, axis", [("ur10", 1), ("ur10", 3), ("racer-7-1.4", 2)])
@pytest.mark.slow
def test_an_axis_that_stands_is_not_suspected(name, axis):
    """Held against gravity and the others' inertia, or by a brake, which leaves noise alone. The noise is
    absolute: axis 6 of a UR10 carries nothing, and any mistake explains a torque of 1e-19 Nm better. The seed
    is the number of the axis."""
    robot, random = load_robot(name), np.random.default_rng(axis)
    time, angle, rate, acceleration = fourier_motion(robot, 10.0, 200.0, seed=axis)
    angle[:, axis], rate[:, axis], acceleration[:, axis] = 0.3, 0.0, 0.0
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque += np.std(torque, axis=0) * 0.1 * np.sign(rate) + 0.05 * random.normal(size=angle.shape)
    braked = torque.copy()
    braked[:, axis] = random.normal(size=len(time))
    for each in (torque, braked):
        assert first_aid(robot, motion_data(robot, time, angle, each)) == ()
