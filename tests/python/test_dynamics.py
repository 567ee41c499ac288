"""Kinematics and dynamics of the core against Pinocchio, to 1e-10 of the largest entry."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from central_difference import central_difference
from exactarm import _core
from pinocchio_model import pinocchio_model
from random_robot import random_core_robot

CASES = [(1, None), (2, 1), (3, None), (6, None), (6, 2), (7, None), (7, 0), (9, 4)]
ROWS = 12


@pytest.fixture(params=CASES, ids=lambda case: f"{case[0]}-axes-sliding-{case[1]}")
def case(request):
    axes, sliding = request.param
    rng = np.random.default_rng(100 * axes + (sliding or 0))
    robot = random_core_robot(rng, axes, sliding)
    model = pinocchio_model(robot)
    q = rng.uniform(-3, 3, (ROWS, axes))
    q[0] = 0.0
    return robot, model, model.createData(), q, rng.uniform(-2, 2,
                                                            (ROWS, axes)), rng.uniform(-5, 5, (ROWS, axes))


def assert_close(found, expected, relative=1e-10, scale=None):
    """Agreement to `relative` of the largest expected entry, or of `scale` where a difference was taken."""
    assert np.shape(found) == np.shape(expected)
    scale = np.max(np.abs(expected)) if scale is None else scale
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=relative * max(scale, 1e-3))


def test_forward_kinematics(case):
    robot, model, data, q, _, _ = case
    position, rotation = _core.forward_kinematics(robot, q)
    frame_position, frame_rotation = _core.frame_poses(robot, q)
    base = pin.SE3(robot.base.rotation, robot.base.position)
    for row in range(ROWS):
        pin.framesForwardKinematics(model, data, q[row])
        tool = base * data.oMf[model.getFrameId("tool")]
        assert_close(position[row], tool.translation)
        assert_close(rotation[row], tool.rotation)
        for i in range(robot.axes):
            link = base * data.oMf[model.getFrameId(f"link_{i + 1}")]
            assert_close(frame_position[row, i + 1], link.translation)
            assert_close(frame_rotation[row, i + 1], link.rotation)


def test_inverse_dynamics(case):
    robot, model, data, q, q_dot, q_ddot = case
    tau = _core.inverse_dynamics(robot, q, q_dot, q_ddot)
    for row in range(ROWS):
        assert_close(tau[row], pin.rnea(model, data, q[row], q_dot[row], q_ddot[row]))


def test_coriolis_torque(case):
    robot, model, data, q, q_dot, _ = case
    still = np.zeros_like(q)
    whole, gravity = _core.inverse_dynamics(robot, q, q_dot, still), _core.gravity_torque(robot, q)
    for row in range(ROWS):
        expected = pin.computeCoriolisMatrix(model, data, q[row], q_dot[row]) @ q_dot[row]
        assert_close(whole[row] - gravity[row], expected, scale=np.max(np.abs(whole[row])))


def test_gravity_torque_and_its_slope(case):
    robot, model, data, q, _, _ = case
    torque, jacobian = _core.gravity_torque(robot, q), _core.gravity_torque_jacobian(robot, q)
    for row in range(ROWS):
        assert_close(torque[row], pin.computeGeneralizedGravity(model, data, q[row]))
        assert_close(jacobian[row], pin.computeGeneralizedGravityDerivatives(model, data, q[row]))


def test_mass_matrix(case):
    robot, model, data, q, _, _ = case
    D = _core.mass_matrix(robot, q)
    for row in range(ROWS):
        upper = np.triu(pin.crba(model, data, q[row]))
        assert_close(D[row], upper + np.triu(upper, 1).T)


def test_first_derivatives(case):
    robot, model, data, q, q_dot, q_ddot = case
    found = _core.inverse_dynamics_derivatives(robot, q, q_dot, q_ddot)
    for row in range(ROWS):
        by_q, by_q_dot, _ = pin.computeRNEADerivatives(model, data, q[row], q_dot[row], q_ddot[row])
        assert_close(found["dtau_dq"][row], by_q)
        assert_close(found["dtau_dq_dot"][row], by_q_dot)


def test_contracted_second_derivatives(case):
    """The wheel has no second derivatives for Python: slopes of its first ones, to 1e-6."""
    robot, model, data, q, q_dot, q_ddot = case
    multiplier = np.random.default_rng(5).uniform(-1, 1, q.shape)
    found = _core.inverse_dynamics_derivatives(robot, q, q_dot, q_ddot, multiplier, threads=2)

    def slopes(row, x, v, which):
        by_q, by_q_dot, by_q_ddot = pin.computeRNEADerivatives(model, data, x, v, q_ddot[row])
        full = np.triu(by_q_ddot) + np.triu(by_q_ddot, 1).T
        return multiplier[row] @ (by_q.copy(), by_q_dot.copy(), full)[which]

    for row in range(0, ROWS, 4):
        for name, which, over_rate in [("q_q", 0, False), ("q_q_dot", 0, True), ("q_dot_q_dot", 1, True)]:
            x = q_dot[row] if over_rate else q[row]

            def slope(moved):
                return slopes(row, q[row] if over_rate else moved, moved if over_rate else q_dot[row], which)

            assert_close(found[name][row], central_difference(slope, x, 1e-3), relative=1e-6)
        by_q_ddot = central_difference(lambda moved: slopes(row, moved, q_dot[row], 2), q[row], 1e-3)
        assert_close(found["q_q_ddot"][row], by_q_ddot.T, relative=1e-6)


def test_regressor(case):
    robot, model, data, q, q_dot, q_ddot = case
    Y = _core.dynamics_regressor(robot, q, q_dot, q_ddot, threads=2)
    tau = Y @ _core.inertial_parameters(robot)
    for row in range(ROWS):
        assert_close(tau[row], pin.rnea(model, data, q[row], q_dot[row], q_ddot[row]))


def test_wrong_shapes_are_refused():
    robot = random_core_robot(np.random.default_rng(1), 6)
    with pytest.raises(_core.InvalidArgument, match="columns of q_dot: size 5, expected 6"):
        _core.inverse_dynamics(robot, np.zeros((3, 6)), np.zeros((3, 5)), np.zeros((3, 6)))
    with pytest.raises(_core.InvalidArgument, match="rows of multiplier: size 2, expected 3"):
        _core.inverse_dynamics_derivatives(robot, *[np.zeros((3, 6))] * 3, np.zeros((2, 6)))
