"""The arm in CasADi expressions, for the peers of bench/planning_peers.py: inverse dynamics, gears and
springs of a robot file."""

import casadi as ca


def turn(axis, angle):
    c, s = ca.cos(angle), ca.sin(angle)
    if axis == "z":
        return ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, 1))
    return ca.vertcat(ca.horzcat(1, 0, 0), ca.horzcat(0, c, -s), ca.horzcat(0, s, c))


def inverse_dynamics(robot):
    """tau(q, qd, qdd) by Newton and Euler in the base frame."""
    n = robot.axes
    q, qd, qdd = (ca.SX.sym(name, n) for name in ("q", "qd", "qdd"))
    rotation, origin = ca.SX.eye(3), ca.SX.zeros(3)
    rate, rate_dot, acceleration = ca.SX.zeros(3), ca.SX.zeros(3), -ca.SX(robot.gravity)
    axes, points, loads = [], [], []
    for i, (joint, link) in enumerate(zip(robot.joints, robot.links)):
        z = rotation[:, 2]
        axes.append(z)
        points.append(origin)
        rate_dot = rate_dot + z * qdd[i] + ca.cross(rate, z * qd[i])
        rate = rate + z * qd[i]
        after = rotation @ turn("z", q[i] + joint.zero)
        step = after @ ca.DM([joint.a, 0, joint.d])
        rotation = after @ turn("x", joint.alpha)
        arm = step + rotation @ ca.DM(link.centre_of_mass)
        at = lambda r: acceleration + ca.cross(rate_dot, r) + ca.cross(rate, ca.cross(rate, r))
        inertia = rotation @ ca.DM(link.inertia) @ rotation.T
        loads.append((origin + arm, link.mass * at(arm),
                      inertia @ rate_dot + ca.cross(rate, inertia @ rate)))
        acceleration, origin = at(step), origin + step
    tau = [sum(ca.dot(axes[i], ca.cross(c - points[i], f) + m) for c, f, m in loads[i:]) for i in range(n)]
    return ca.Function("tau", [q, qd, qdd], [ca.vertcat(*tau)])


def gear(robot, phi):
    """theta / ratio of the clockwise table."""
    out = []
    for i, joint in enumerate(robot.joints):
        value = phi[i]
        if joint.cw is not None:
            for w, a, b in zip(joint.cw.order, joint.cw.a, joint.cw.b):
                value = value + (a * ca.sin(w * phi[i]) + b * (ca.cos(w * phi[i]) - 1)) / w
        out.append(value)
    return ca.vertcat(*out)


def springs(robot, e):
    return ca.vertcat(*[j.spring_linear * e[i] + j.spring_cubic * e[i] ** 3
                        for i, j in enumerate(robot.joints)])
