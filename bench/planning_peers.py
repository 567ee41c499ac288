"""The planner against CasADi, Ipopt and MUMPS, in one run on the line of the source.

    exactarm  the stage-wise solver, and our Ipopt path
    tuned     bench/planning_tuned_form.py: inverse dynamics, scaled, derivatives by stages, compiled C code
    source    bench/planning_thesis_form.py: the source's own formulation with the solver's defaults, in
              output-side units of angle (more than the source says); ended at --limit processor seconds, and
                  then its ratio is a lower bound
    favoured  the same without the bounds (none is active on this path, but the first barrier leads away from
              it) and without MUMPS' permutation (with it MUMPS counts wrong signs of pivots): so it converges

    python bench/planning_peers.py [peers.json] [--knots N] [--runs 3] [--limit 100]

Medians of the solve alone, without building or compiling the problem: wall clock, and processor time of all
threads, which is what counts on a busy machine. CasADi is needed by the benches only, and gcc by the tuned
peer.
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
from planning_tuned_form import Tuned


class Clock:
    """Wall clock and processor time since it was made, in s."""

    def __init__(self):
        self.wall, self.processor = time.perf_counter(), time.process_time()

    def read(self):
        return {"seconds": time.perf_counter() - self.wall,
                "processor_seconds": time.process_time() - self.processor}


def median(rows):
    """The row in the middle by processor time."""
    return sorted(rows, key=lambda row: row["processor_seconds"])[len(rows) // 2] | {"runs": len(rows)}


def ending(solver):
    stats = solver.stats()
    return {"iterations": stats["iter_count"], "status": stats["return_status"]}


def ours(robot, path, runs):
    """Median of our solver's time, and the plan. The model's set-up is in it, the inverse kinematics is
    not."""
    plan, rows = plan_path(robot, path, PlanOptions(threads=2)), []
    for _ in range(runs):
        shared = prepared(robot, path)
        clock = Clock()
        motion = _core.plan_motion(*shared)
        rows.append(clock.read() | {"iterations": motion.iterations, "status": motion.status,
                                    "solver_seconds": motion.seconds})
    return plan, median(rows)


def prepared(robot, path):
    """The arguments of the core's solver for a path."""
    model, reference, options = planning_model(robot), path.reference(), PlanOptions(threads=2)
    joints, known, _ = _joint_reference(model, reference, path, options)
    return model.core, _problem(model, path, reference.step, joints, known,
                                options), _solve_options(path, options)


def tuned(robot, model, own, nu, runs):
    step = own.reference.step
    flat = _flat_motion(model, own.q_desired, known_functions(model, own.q_desired, step, "cw", 1), step)[0]
    program, rows = Tuned(model.robot, own.q_desired, flat / robot.ratios, step, nu), []
    for _ in range(runs):
        clock = Clock()
        q = program.solve()[:, :robot.axes]
        rows.append(clock.read() | ending(program.solver)
                    | {"q_difference_rad": float(np.abs(q - own.q).max())})
    return median(rows)


def source(robot, model, own, nu, limit, favoured):
    """From the reference at rest with the input 0; objective as printed, the solver's defaults unless
    favoured."""
    still = _core.gravity_torque(model.core, own.q_desired, 1)
    theta = np.empty_like(own.q_desired)
    for i, joint in enumerate(model.joints):
        phi = own.q_desired[:, i] - model.offsets[i] + spring_inverse(joint.spring_linear, joint.spring_cubic,
                                                                      still[:, i])[0]
        theta[:, i] = _core.gear_motor_angle(robot.ratios[i], model.core.joints[i].gear.cw,
                                             phi) / robot.ratios[i]
    program, start, low, high = problem(model, own.q_desired, theta, own.reference.step, nu)
    options = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.max_cpu_time": limit}
    if favoured:
        low[:, 1:-1], high[:, 1:-1] = -np.inf, np.inf
        options["ipopt.mumps_permuting_scaling"] = 0
    solver = ca.nlpsol("source", "ipopt", program, options)
    clock = Clock()
    answer = solver(x0=start.ravel("F"), lbx=low.ravel("F"), ubx=high.ravel("F"), lbg=0, ubg=0)
    q = np.reshape(np.array(answer["x"]), start.shape, "F")[:robot.axes].T
    return clock.read() | ending(solver) | {"q_difference_rad": float(np.abs(q - own.q).max()), "runs": 1}


LABELS = {"stagewise": "exactarm, stage-wise", "ipopt": "exactarm, Ipopt and MUMPS",
          "casadi_tuned": "CasADi, tuned and compiled",
          "casadi_favoured": "the source's form, favoured", "casadi_source": "CasADi, the source's form"}


def table(rows):
    lines = [f"{'':28}{'iterations':>11}{'s':>9}{'CPU s':>9}{'ratio':>8}{'of CPU':>8}  ended"]
    for name, row in rows.items():
        lines.append(
            f"{LABELS[name]:28}{row['iterations']:11d}{row['seconds']:9.3f}{row['processor_seconds']:9.3f}"
                     f"{row['ratio']:8.1f}{row['processor_ratio']:8.1f}  {row['status']}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", nargs="?", default="planning_peers.json")
    parser.add_argument("--knots", type=int, default=2501)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--limit", type=float, default=100.0)
    arguments = parser.parse_args()
    robot = load_robot("racer-7-1.4")
    path = replace(load_path("line"), gear_direction="cw", rate_hz=(arguments.knots - 1) / 2.5)
    model = planning_model(robot)
    own, first = ours(robot, path, 2 * arguments.runs + 1)
    rows = {"stagewise": first, "ipopt": ours(robot, replace(path, solver="ipopt"), arguments.runs)[1]}
    rows["casadi_tuned"] = tuned(robot, model, own, path.nu, arguments.runs)
    for name, favoured in (("casadi_favoured", True), ("casadi_source", False)):
        rows[name] = source(robot, model.robot, own, path.nu, arguments.limit, favoured)
    for row in rows.values():
        row["ratio"] = row["seconds"] / first["seconds"]
        row["processor_ratio"] = row["processor_seconds"] / first["processor_seconds"]
    print(table(rows))
    with open(arguments.out, "w", encoding="utf-8") as file:
        json.dump({"knots": arguments.knots} | rows, file, indent=1)


if __name__ == "__main__":
    main()
