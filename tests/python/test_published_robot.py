"""What a run writes is read back by our own readers before the run calls itself done."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.commands.outcome import Asked
from exactarm.commands.publish import save
from exactarm.commands.result import CommandResult
from exactarm.effects import library
from exactarm.errors import ComputationError
from exactarm.identify.dynamics import DynamicsOptions, identify_dynamics
from exactarm.report import Report
from exactarm.robot.urdf import read_urdf
from exactarm.robot_file import load_robot, read_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_motion
from exactarm.simulate.profiles import excitation


def published(robot, out):
    save(CommandResult({}, Report("T", "V."), robot, asked=Asked("identify", "", "racer-7-1.4")), out)


@pytest.mark.parametrize(
    "spoilt",
    [
        lambda robot: robot.with_joint(0, coulomb=-1.0),
        lambda robot: robot.with_joint(2, rotor_inertia=-1e-4),
        lambda robot: robot.with_joint(1, spring_linear=np.inf),
        lambda robot: replace(robot, links=(replace(robot.links[0], mass=-0.5), *robot.links[1:])),
    ],
)
def test_a_robot_that_cannot_be_is_not_published(tmp_path, spoilt):
    with pytest.raises(ComputationError, match="the estimated robot is none, nothing was written: key "):
        published(spoilt(load_robot("racer-7-1.4")), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_xml_cannot_hold_is_written_without_it(tmp_path):
    published(replace(load_robot("racer-7-1.4"), name="arm \x01 & <b>\x7f"), tmp_path)
    assert read_robot(tmp_path / "robot.toml").name == "arm \x01 & <b>\x7f"
    assert read_urdf(tmp_path / "robot.urdf").name == "arm ? & <b>\x7f"


@pytest.mark.parametrize("name", ["declared_friction", "declared_rotor"])
def test_what_drives_nothing_is_estimated_at_zero_or_above(name):
    effect = library()[name].of(load_robot("racer-7-1.4"), 0)
    assert all(parameter.lower == 0.0 for parameter in effect.parameters())


@pytest.mark.slow
def test_a_negative_friction_ends_at_zero_and_is_said():
    robot = load_robot("racer-7-1.4")
    time_s, q = excitation(robot, 4.0, 200.0, np.random.default_rng(3))
    virtual = VirtualRobot.of(robot)
    data = measure_motion(
        virtual, time_s, virtual.motor_angles(q), Sensors(), np.random.default_rng(4), quasi_static=True
    )
    rate = np.gradient(data.joints["theta"][:, 0], time_s)
    driven = {name: values.copy() for name, values in data.joints.items()}
    driven["tau"][:, 0] -= 2.0 * robot.joints[0].coulomb * np.sign(rate)
    result = identify_dynamics(robot, replace(data, joints=driven), DynamicsOptions(inertial=False))
    assert result.robot.joints[0].coulomb == 0.0
    assert any(line.startswith("coulomb_1_Nm lies at its bound, 0") for line in result.warnings)
