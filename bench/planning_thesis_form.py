"""The source's own formulation of the planning problem in a symbolic package, as a peer of
bench/planning_peers.py.

    states (q, q_dot, theta, theta_dot) and input theta_ddot in SI units, theta divided by the gear's ratio,
    q_ddot = D^{-1} (kappa(Xi^{-1}(theta) + q_offset - q) - C q_dot - g)        (4.1), E4
    trapezoidal rule and bounds (4.3), E10; start on the reference with the input 0; the solver's defaults

With theta at the motor, a hundred times larger, Ipopt goes astray from its first step on: the division is a
favour to the peer. One stage function of scalar expressions is mapped over the knots; CasADi makes all
derivatives. Xi^{-1} by fixed-point steps.
"""

import casadi as ca
import numpy as np

from casadi_arm import inverse_dynamics, springs

PASSES = 6  # of the inverse gear; each gains two digits


def forward_dynamics(robot, tau):
    """q_ddot(q, q_dot, torque of the springs) with the mass matrix from unit accelerations and its Cholesky
    factor."""
    n = robot.axes
    q, rate, torque = (ca.SX.sym(name, n) for name in ("q", "rate", "torque"))
    bias = tau(q, rate, ca.SX.zeros(n))
    still = tau(q, ca.SX.zeros(n), ca.SX.zeros(n))
    unit = ca.DM.eye(n)
    mass = ca.horzcat(*[tau(q, ca.SX.zeros(n), unit[:, i]) - still for i in range(n)])
    factor = ca.chol((mass + mass.T) / 2)  # upper
    return ca.Function("q_ddot", [q, rate, torque],
                       [_substitute(factor, _substitute_transposed(factor, torque - bias))])


def _substitute_transposed(upper, right):
    x = []
    for i in range(right.numel()):
        x.append((right[i] - sum(upper[j, i] * x[j] for j in range(i))) / upper[i, i])
    return ca.vertcat(*x)


def _substitute(upper, right):
    n = right.numel()
    x = [None] * n
    for i in reversed(range(n)):
        x[i] = (right[i] - sum(upper[i, j] * x[j] for j in range(i + 1, n))) / upper[i, i]
    return ca.vertcat(*x)


def output_angle(robot, theta):
    """phi of a motor angle over the ratio, the clockwise table."""
    out = []
    for i, joint in enumerate(robot.joints):
        straight = phi = theta[i]
        if joint.cw is not None:
            for _ in range(PASSES):
                phi = straight - sum((a * ca.sin(w * phi) + b * (ca.cos(w * phi) - 1)) / w
                                     for w, a, b in zip(joint.cw.order, joint.cw.a, joint.cw.b))
        out.append(phi)
    return ca.vertcat(*out)


def problem(robot, q_desired, theta_start, step, nu):
    """The program of nlpsol, its start and its bounds. theta_start (N, n): at rest on the reference."""
    n, knots = robot.axes, len(q_desired)
    x, u = ca.SX.sym("x", 4 * n), ca.SX.sym("u", n)
    q, rate, theta, theta_dot = ca.vertsplit(x, n)
    stretch = output_angle(robot, theta) + ca.DM(robot.offsets) - q
    acceleration = forward_dynamics(robot, inverse_dynamics(robot))(q, rate, springs(robot, stretch))
    stage = ca.Function("f", [x, u], [ca.vertcat(rate, acceleration, theta_dot, u)])
    z = ca.MX.sym("z", 5 * n, knots)
    states, inputs = z[:4 * n, :], z[4 * n:, :]
    slope = stage.map(knots)(states, inputs)
    gaps = states[:, 1:] - states[:, :-1] - 0.5 * step * (slope[:, 1:] + slope[:, :-1])
    objective = ca.sumsqr(states[:n, :]
                          - ca.DM(q_desired.T)) + nu * ca.sumsqr(ca.diag(ca.DM(robot.ratios)) @ inputs)
    start = np.zeros((5 * n, knots))
    start[:n] = q_desired.T
    start[n:2 * n] = np.gradient(q_desired, step, axis=0).T
    start[2 * n:3 * n] = theta_start.T
    start[3 * n:4 * n] = np.gradient(theta_start, step, axis=0).T
    start[n:2 * n, [0, -1]] = start[3 * n:4 * n, [0, -1]] = 0.0
    low, high = _bounds(robot, knots)
    for end in (0, -1):
        low[:, end] = high[:, end] = start[:, end]
    return {"x": ca.vec(z), "f": objective, "g": ca.vec(gaps)}, start, low, high


def _bounds(robot, knots):
    column = lambda field: np.array([getattr(joint, field) for joint in robot.joints])
    ends = (column("q_min") - robot.offsets, column("q_max") - robot.offsets)
    rate, second = column("q_dot_max"), column("q_ddot_max")
    low = np.concatenate([column("q_min"), -rate, ends[0], -rate, -second])
    high = np.concatenate([column("q_max"), rate, ends[1], rate, second])
    return np.tile(low[:, None], knots), np.tile(high[:, None], knots)
