"""Elastic-joint dynamics of the core against Pinocchio's forward dynamics, and its energy under a stiff
integrator."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from exactarm import _core
from pinocchio_model import pinocchio_model
from random_robot import random_core_robot

AXES = 6


def elastic_robot(seed: int, dry: bool) -> _core.Robot:
    rng = np.random.default_rng(seed)
    robot = random_core_robot(rng, AXES)
    joints = []
    for joint in robot.joints:
        gear = _core.Gear(rng.uniform(50, 100))
        spring = _core.Spring(rng.uniform(2e4, 3e5), rng.uniform(0, 1e9))
        rotor = rng.uniform(5e-4, 1e-3)
        friction = _core.Friction() if dry else _core.Friction(rng.uniform(5, 20), rng.uniform(1, 5))
        joints.append(changed(joint, gear=gear, spring=spring, drive=_core.Drive(rotor, joint=friction)))
    joints = [changed(joint, q_offset=offset) for joint, offset in zip(joints, rng.uniform(-1, 1, AXES))]
    return with_joints(robot, joints)


def changed(joint: _core.Joint, **values) -> _core.Joint:
    names = ("frame", "q_offset", "gear", "spring", "drive", "limits", "link")
    return _core.Joint(**{name: values.get(name, getattr(joint, name)) for name in names})


def with_joints(robot: _core.Robot, joints: list[_core.Joint]) -> _core.Robot:
    return _core.Robot(joints, robot.base, robot.tool, robot.gravity)


def offsets(robot: _core.Robot) -> np.ndarray:
    return np.array([joint.q_offset for joint in robot.joints])


def random_state(robot: _core.Robot, rng: np.random.Generator) -> np.ndarray:
    q, q_dot = rng.uniform(-2, 2, AXES), rng.uniform(-1, 1, AXES)
    ratios = np.array([joint.gear.ratio for joint in robot.joints])
    theta = ratios * (q - offsets(robot) + rng.uniform(-2e-3, 2e-3, AXES))
    return np.concatenate([q, q_dot, theta, ratios * q_dot])


def test_simplified_model_is_pinocchio_driven_by_the_springs():
    robot = elastic_robot(3, dry=False)
    width = 0.05
    dynamics = _core.ElasticJointDynamics(_core.ElasticJointModel(robot, friction_width=width))
    model = pinocchio_model(robot)
    data = model.createData()
    rng = np.random.default_rng(4)
    for _ in range(10):
        x, external, motor = random_state(robot, rng), rng.uniform(-50, 50, AXES), rng.uniform(-2, 2, AXES)
        q, q_dot, theta, _ = np.split(x, 4)
        ratios = np.array([joint.gear.ratio for joint in robot.joints])
        deflection = theta / ratios + offsets(robot) - q
        linear, cubic = np.array([(joint.spring.linear, joint.spring.cubic) for joint in robot.joints]).T
        torque = linear * deflection + cubic * deflection**3
        dry = np.array([joint.drive.joint.coulomb for joint in robot.joints]) * np.tanh(q_dot / width)
        friction = dry + np.array([joint.drive.joint.viscous for joint in robot.joints]) * q_dot
        links = pin.aba(model, data, q, q_dot, torque + external - friction)
        motors = (motor - torque / ratios) / np.array([joint.drive.rotor_inertia for joint in robot.joints])
        found = dynamics.forward(x, np.concatenate([external, motor]))
        np.testing.assert_allclose(found[:AXES], links, rtol=0, atol=1e-9 * np.max(np.abs(links)))
        np.testing.assert_allclose(found[AXES:], motors, rtol=0, atol=1e-9 * np.max(np.abs(motors)))


@pytest.mark.parametrize("coupling", [False, True])
@pytest.mark.slow
def test_stiff_integrator_with_its_jacobian_keeps_the_energy(coupling):
    robot = elastic_robot(5, dry=True)
    dynamics = _core.ElasticJointDynamics(_core.ElasticJointModel(robot, rotor_coupling=coupling))
    none = np.zeros(2 * AXES)

    def rate(_, x):
        a = dynamics.forward(x, none)
        return np.concatenate([x[AXES : 2 * AXES], a[:AXES], x[3 * AXES :], a[AXES:]])

    def jacobian(_, x):
        return dynamics.rate_jacobian(x, dynamics.forward(x, none))

    start = random_state(robot, np.random.default_rng(6))
    run = solve_ivp(rate, (0.0, 0.05), start, method="Radau", jac=jacobian, rtol=1e-9, atol=1e-9)
    assert run.success
    before, after = (np.array(dynamics.energy(x)) for x in (run.y[:, 0], run.y[:, -1]))
    assert abs(after.sum() - before.sum()) < 1e-5 * before[0]
    assert np.max(np.abs(after - before)) > 1e-2 * before[0]  # it did flow between the parts


def test_matrices_and_forward_agree():
    robot = elastic_robot(7, dry=True)
    dynamics = _core.ElasticJointDynamics(_core.ElasticJointModel(robot, rotor_coupling=True))
    rng = np.random.default_rng(8)
    x, torques = random_state(robot, rng), rng.uniform(-50, 50, 2 * AXES)
    D, C, g = dynamics.matrices(x)
    rates = np.concatenate([x[AXES : 2 * AXES], x[3 * AXES :]])
    a = dynamics.forward(x, torques)
    # The motors' rows are in Nm at the shaft, thousands of times smaller than those of the links.
    scale = np.abs(D) @ np.abs(a) + np.abs(C) @ np.abs(rates) + np.abs(g) + np.abs(torques)
    assert np.all(np.abs(D @ a + C @ rates + g - torques) < 1e-9 * scale)
    np.testing.assert_allclose(dynamics.inverse(x, a), torques, rtol=1e-6, atol=1e-6)


def test_spring_inverse_over_arrays():
    torque = np.linspace(-500.0, 500.0, 11)
    deflection = _core.spring_deflection(2e5, 1e10, torque)
    np.testing.assert_allclose(_core.spring_torque(2e5, 1e10, deflection), torque, rtol=1e-13, atol=1e-13)


def test_wrong_sizes_and_rigid_axes_are_refused():
    robot = elastic_robot(9, dry=True)
    dynamics = _core.ElasticJointDynamics(_core.ElasticJointModel(robot))
    with pytest.raises(_core.InvalidArgument, match="x: size 20, expected 24"):
        dynamics.forward(np.zeros(20), np.zeros(12))
    joints = robot.joints
    joints[2] = changed(joints[2], spring=_core.Spring())
    robot = with_joints(robot, joints)
    with pytest.raises(_core.InvalidArgument, match="spring of joint 3"):
        _core.ElasticJointModel(robot)
