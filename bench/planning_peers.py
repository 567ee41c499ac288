"""The planner against CasADi, Ipopt and MUMPS, in one run on the line of the source.

    exactarm  the stage-wise solver, and our Ipopt path
    tuned     inverse dynamics with qdd and phi as unknowns, time in samples, output-side angles, flat start,
              scaled objective, stage functions mapped over the knots, mumps_permuting_scaling = 0
    source    the source's own formulation with the solver's defaults, bench/planning_thesis_form.py; ended at --limit
              processor seconds, and then its ratio is a lower bound

    python bench/planning_peers.py out.json [--knots N] [--runs 3] [--limit 100]

Medians of the solve alone, without building the problem: wall clock, and processor time of all threads, which is what
counts on a busy machine. CasADi is needed by the benches only.
"""

import argparse
import json
import time
from dataclasses import replace

import casadi as ca
import numpy as np

from exactarm import _core
from exactarm.chain.spring import spring_inverse
from exactarm.plan import PlanOptions, load_path, plan_path
from exactarm.plan.compensation import known_functions, planning_model
from exactarm.plan.optimal import _flat_motion, _joint_reference, _problem, _solve_options
from exactarm.robot_file import load_robot
from planning_thesis_form import problem


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
    return ca.vertcat(*[j.spring_linear * e[i] + j.spring_cubic * e[i] ** 3 for i, j in enumerate(robot.joints)])


def solve(name, x, f, g, start, low, high, options):
    solver = ca.nlpsol(name, "ipopt", {"x": x, "f": f, "g": g}, {"ipopt.print_level": 0, "print_time": False} | options)
    clock = Clock()
    answer = solver(x0=start, lbx=low, ubx=high, lbg=0, ubg=0)
    times = clock.read()
    stats = solver.stats()
    return np.array(answer["x"]).ravel(), times | {"iterations": stats["iter_count"], "status": stats["return_status"]}


class Clock:
    """Wall clock and processor time since it was made, in s."""

    def __init__(self):
        self.wall, self.processor = time.perf_counter(), time.process_time()

    def read(self):
        return {"seconds": time.perf_counter() - self.wall, "processor_seconds": time.process_time() - self.processor}


def median(rows):
    """The row in the middle by processor time."""
    return sorted(rows, key=lambda row: row["processor_seconds"])[len(rows) // 2] | {"runs": len(rows)}


def fixed_ends(low, high, start, rows):
    """Bounds (rows of unknowns, N) with the named rows of both ends fixed at the start."""
    for end in (0, -1):
        low[rows, end] = high[rows, end] = start[rows, end]
    return low, high


def tuned(robot, model, q_desired, flat, step, nu):
    n, knots = robot.axes, len(q_desired)
    tau, k1 = inverse_dynamics(model), ca.DM([joint.spring_linear for joint in model.joints])
    z = ca.SX.sym("z", 7 * n)
    q, qd, qdd, phi, theta, _, _ = ca.vertsplit(z, n)
    e = phi + ca.DM(model.offsets) - q
    stage = ca.Function("stage", [z], [ca.vertcat((tau(q, qd / step, qdd / step**2) - springs(model, e)) / k1,
                                                  theta - gear(model, phi))])
    Z = ca.MX.sym("Z", 7 * n, knots)
    part = lambda k: Z[k * n:(k + 1) * n, :]
    g = [ca.vec(stage.map(knots)(Z))]
    for a, b in ((0, 1), (1, 2), (4, 5), (5, 6)):
        g.append(ca.vec(part(a)[:, 1:] - part(a)[:, :-1] - 0.5 * (part(b)[:, 1:] + part(b)[:, :-1])))
    weights = ca.DM(nu * (robot.ratios / step**2) ** 2)
    f = ca.sumsqr(part(0) - ca.DM(q_desired.T)) + ca.sum1(weights * ca.sum2(part(6) ** 2))
    theta = flat[0] / robot.ratios
    rates = lambda x, k: np.gradient(rates(x, k - 1), axis=0) if k else x
    phi = np.column_stack([robot_gear_inverse(joint, theta[:, i]) for i, joint in enumerate(model.joints)])
    blocks = [q_desired, rates(q_desired, 1), rates(q_desired, 2), phi, theta, rates(theta, 1), rates(theta, 2)]
    start = np.concatenate(blocks, axis=1).T
    for rows in (slice(n, 3 * n), slice(5 * n, 7 * n)):
        start[rows, 0] = start[rows, -1] = 0.0
    low, high = limits(model, step, knots)
    low, high = fixed_ends(low, high, start, [i for i in range(7 * n) if not 2 * n <= i < 4 * n])
    options = {"ipopt.mumps_permuting_scaling": 0, "ipopt.mu_init": 1e-9, "ipopt.nlp_scaling_method": "none",
               "ipopt.tol": 1e-6}
    x, info = solve("tuned", ca.vec(Z), 1e9 * f, ca.vertcat(*g), start.ravel("F"), low.ravel("F"), high.ravel("F"), options)
    return np.reshape(x, (7 * n, knots), "F")[:n].T, info


def robot_gear_inverse(joint, theta):
    phi = theta.copy()
    if joint.cw is None:
        return phi
    for _ in range(20):
        angle = sum((a * np.sin(w * phi) + b * (np.cos(w * phi) - 1)) / w for w, a, b in zip(joint.cw.order, joint.cw.a, joint.cw.b))
        phi = theta - angle if _ < 3 else phi - (phi + angle - theta) / (
            1 + sum(a * np.cos(w * phi) - b * np.sin(w * phi) for w, a, b in zip(joint.cw.order, joint.cw.a, joint.cw.b)))
    return phi


def limits(model, step, knots):
    j = model.joints
    column = lambda field: np.array([getattr(joint, field) for joint in j])
    free = np.full(len(j), np.inf)
    theta = (column("q_min") - model.offsets, column("q_max") - model.offsets)
    rate, second = step * column("q_dot_max"), step**2 * column("q_ddot_max")
    low = np.concatenate([column("q_min"), -rate, -free, -free, theta[0], -rate, -second])
    high = np.concatenate([column("q_max"), rate, free, free, theta[1], rate, second])
    return np.tile(low[:, None], knots), np.tile(high[:, None], knots)


def source(robot, model, q_desired, step, nu, limit):
    """The source's formulation from the reference at rest; objective as printed, all options at their defaults."""
    still = _core.gravity_torque(model.core, q_desired, 1)
    theta = np.empty_like(q_desired)
    for i, joint in enumerate(model.joints):
        phi = q_desired[:, i] - model.offsets[i] + spring_inverse(joint.spring_linear, joint.spring_cubic, still[:, i])[0]
        theta[:, i] = _core.gear_motor_angle(robot.ratios[i], model.core.gears[i].cw, phi)
    program, start, low, high = problem(model, inverse_dynamics(model), springs, q_desired, theta, step, nu)
    x, info = solve("source", program["x"], program["f"], program["g"], start.ravel("F"), low.ravel("F"), high.ravel("F"),
                    {"ipopt.max_cpu_time": limit})
    return np.reshape(x, start.shape, "F")[:robot.axes].T, info


def ours(robot, path, runs):
    """Median of our solver's time, and the plan. The model's set-up is in it, the inverse kinematics is not."""
    rows = []
    for _ in range(runs):
        plan = plan_path(robot, path, PlanOptions(threads=2))
        shared = prepared(robot, path)
        clock = Clock()
        motion = _core.plan_motion(*shared)
        rows.append(clock.read() | {"iterations": motion.iterations, "status": motion.status, "solver_seconds": motion.seconds})
    return plan, median(rows)


def prepared(robot, path):
    """The arguments of the core's solver for a path."""
    model, reference, options = planning_model(robot), path.reference(), PlanOptions(threads=2)
    joints, known, _ = _joint_reference(model, reference, path, options)
    return model.core, _problem(model, path, reference.step, joints, known, options), _solve_options(path, options)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out")
    parser.add_argument("--knots", type=int, default=2501)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--limit", type=float, default=100.0)
    arguments = parser.parse_args()
    robot = load_robot("racer-7-1.4")
    path = replace(load_path("line"), gear_direction="cw", rate_hz=(arguments.knots - 1) / 2.5)
    model = planning_model(robot)
    own, first = ours(robot, path, 2 * arguments.runs + 1)
    rows = {"stagewise": first, "ipopt": ours(robot, replace(path, solver="ipopt"), arguments.runs)[1]}
    step = own.reference.step
    flat = _flat_motion(model, own.q_desired, known_functions(model, own.q_desired, step, "cw", 1), step)
    peers = [tuned(robot, model.robot, own.q_desired, flat, step, path.nu) for _ in range(arguments.runs)]
    rows["casadi_tuned"] = median([info | {"q_difference_rad": float(np.abs(q - own.q).max())} for q, info in peers])
    q, info = source(robot, model.robot, own.q_desired, step, path.nu, arguments.limit)
    rows["casadi_source"] = info | {"q_difference_rad": float(np.abs(q - own.q).max()), "runs": 1,
                                    "ended": info["status"] == "Solve_Succeeded"}
    for row in rows.values():
        row["ratio"] = row["seconds"] / first["seconds"]
        row["processor_ratio"] = row["processor_seconds"] / first["processor_seconds"]
    with open(arguments.out, "w", encoding="utf-8") as file:
        json.dump({"knots": arguments.knots} | rows, file, indent=1)


if __name__ == "__main__":
    main()
