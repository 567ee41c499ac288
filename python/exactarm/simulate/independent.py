"""An independent plant: Pinocchio's forward dynamics behind springs, integrated by scipy, with its own gear
formula.

It shares with the rest of the program the numbers of the robot's tables and where an axis reverses, nothing
else: kinematics and dynamics are Pinocchio's, the gear's inverse a bisection of (2.13), the integrator an
adaptive Radau. The package `pin` is imported only here. Hidden effects beyond the tables are not in it.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from exactarm.chain.direction import direction_of_motion
from exactarm.errors import ComputationError, InputError
from exactarm.robot.robot import GearTable, Joint, Robot
from exactarm.simulate.virtual_robot import VirtualRobot

_BISECTIONS = 60
_FIRST_GUESS_RAD = 0.2  # the error of a gear table is far smaller


def independent_path(
    robot: VirtualRobot, time: np.ndarray, theta: np.ndarray, joints: np.ndarray | None = None
) -> np.ndarray:
    """(N, 3) m of the tool frame in the measuring frame while the motors follow theta (N, n) at `time` (N,).

    `joints` (N, n): how the joints move, which tells their reversals (default: the motors).
    """
    pin = _pinocchio()
    true = robot.baked
    model = _model(pin, true)
    data = model.createData()
    output = gear_outputs(true, time, theta, joints)
    n = true.axes
    elastic = true.links is not None and all(joint.spring_linear for joint in true.joints)
    q = _swing(pin, model, data, true, time, output) if elastic else output
    tool = model.getFrameId("tool")
    path = np.empty((len(time), 3))
    for k in range(len(time)):
        pin.forwardKinematics(model, data, q[k, :n])
        path[k] = pin.updateFramePlacement(model, data, tool).translation
    return path @ np.asarray(true.base.rotation).T + true.base.position


def gear_outputs(robot: Robot, time: np.ndarray, theta: np.ndarray,
                 joints: np.ndarray | None = None) -> np.ndarray:
    """(N, n) rad: outputs of the gears plus offsets; directions and reversals by the convention of
    chain/direction.py."""
    moved = theta / np.abs(robot.ratios) if joints is None else joints * np.sign(robot.ratios)
    direction = direction_of_motion(time, moved)
    output = theta / robot.ratios
    for i, joint in enumerate(robot.joints):
        if joint.has_harmonics:
            output[:, i] = _inverse((joint.cw or joint.ccw, joint.ccw or joint.cw), direction[:, i],
                                    output[:, i])
        output[:, i] += joint.q_offset
    return output


def _inverse(tables: tuple[GearTable, GearTable], direction: np.ndarray, target: np.ndarray) -> np.ndarray:
    """phi with phi + sum_j (a_j sin w_j phi + b_j (cos w_j phi - 1)) / w_j = target, the sums mixed by
    direction."""
    low, high = target - _FIRST_GUESS_RAD, target + _FIRST_GUESS_RAD
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        value = middle
        for table, share in zip(tables, (0.5 * (1.0 - direction), 0.5 * (1.0 + direction))):
            angle = np.multiply.outer(middle, table.order)
            value = value + share * (
                (table.a * np.sin(angle) + table.b * (np.cos(angle) - 1.0)) / table.order
            ).sum(axis=-1)
        low, high = np.where(value < target, middle, low), np.where(value < target, high, middle)
    return 0.5 * (low + high)


def _swing(pin, model, data, robot: Robot, time: np.ndarray, output: np.ndarray) -> np.ndarray:
    linear = np.array([joint.spring_linear for joint in robot.joints])
    cubic = np.array([joint.spring_cubic for joint in robot.joints])
    path, n = make_interp_spline(time, output, k=5), robot.axes

    def rate(t, x):
        stretch = path(t) - x[:n]
        return np.concatenate(
            [x[n:], pin.aba(model, data, x[:n], x[n:], linear * stretch + cubic * stretch**3)]
        )

    q = output[0].copy()
    for _ in range(60):
        gravity = pin.computeGeneralizedGravity(model, data, q)
        stretch = gravity / linear
        for _ in range(20):
            stretch -= (linear * stretch + cubic * stretch**3 - gravity) / (linear + 3.0 * cubic * stretch**2)
        q = output[0] - stretch
    start = np.concatenate([q, path(time[0], 1)])
    result = solve_ivp(rate, (time[0], time[-1]), start, method="Radau", t_eval=time, rtol=1e-8, atol=1e-10)
    if not result.success:
        raise ComputationError(f"the independent simulation stopped at {result.t[-1]:.4g} s: "
                               f"{result.message}")
    return result.y[:n].T


def _model(pin, robot: Robot):
    """The robot's tables as a Pinocchio model; joint coordinates are q."""
    model = pin.Model()
    model.gravity = pin.Motion(np.asarray(robot.gravity, float), np.zeros(3))
    turn = pin.utils.rotate
    parent, place = 0, pin.SE3.Identity()
    for i, joint in enumerate(robot.joints):
        place = place * pin.SE3(turn("z", joint.zero), np.zeros(3))
        parent = model.addJoint(parent, _joint_model(pin, joint), place, f"joint_{i + 1}")
        link = pin.SE3(turn("x", joint.alpha) @ turn("y", joint.beta or 0.0),
                       np.array([joint.a, 0.0, joint.d]))
        if robot.links is not None:
            body = robot.links[i]
            inertia = pin.Inertia(body.mass, np.asarray(body.centre_of_mass, float),
                                  np.asarray(body.inertia, float))
            model.appendBodyToJoint(parent, inertia, link)
        place = link
    tool = pin.SE3(np.asarray(robot.tool.rotation, float), np.asarray(robot.tool.position, float))
    model.addFrame(pin.Frame("tool", parent, 0, place * tool, pin.FrameType.OP_FRAME))
    return model


def _joint_model(pin, joint: Joint):
    axis = np.array([0.0, 0.0, float(joint.sign)])
    return (pin.JointModelRevoluteUnaligned if joint.type == "revolute"
            else pin.JointModelPrismaticUnaligned)(axis)


def _pinocchio():
    try:
        import pinocchio
    except ImportError:
        raise InputError("the independent engine needs the package pin: pip install pin") from None
    return pinocchio
