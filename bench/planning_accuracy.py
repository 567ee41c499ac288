"""What a plan is worth: planned motions of the source's paths, played on the robot of `exactarm simulate`.

Both plants integrate the links behind their springs and share no line with the planner's transcription;
Pinocchio's (package pin) none with our dynamics either. No deviations: the planner knows the robot. Writes
JSON: flange errors in m at the knots and between them (three instants between two knots, motors on the
quintic spline through the knots) for (a) rigid inverse kinematics and (b) exactarm at several weights, with
the jerk as the input too, and the bandwidth of each axis; with one gear table in both directions, as the
source plans, and with the table of the direction of motion.

    python bench/planning_accuracy.py out.json [--rate HZ] [--engine own|pinocchio]
"""

import argparse
import json
from dataclasses import replace

from exactarm.commands.compare import Motion, play
from exactarm.identify.statistics import summarise
from exactarm.plan import PlanOptions, load_path, plan_path
from exactarm.robot_file import load_robot
from exactarm.simulate.virtual_robot import VirtualRobot, one_sided

CASES = [("acceleration", 10.0**k)
         for k in (-16, -15, -14, -12, -10, -8, -6)] + [("jerk", 1e-20), ("jerk", 1e-18)]


def errors(robot, path, motion, engine):
    """RMS and largest flange error at the knots and between them."""
    played = play(VirtualRobot.of(robot), "", motion, path, engine)
    found = {}
    for name, values in (("knots", played.knots), ("between", played.between)):
        summary = summarise(values)
        found |= {f"rms_{name}_m": summary.rms, f"max_{name}_m": summary.max}
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out")
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--engine", choices=("own", "pinocchio"), default="own")
    arguments = parser.parse_args()
    rows = []
    for name in ("line", "spiral"):
        for tables in ("cw", "motion"):
            robot = one_sided(load_robot("racer-7-1.4"), tables)
            about = {"path": name, "gear_direction": tables, "engine": arguments.engine}
            for kind, nu in CASES:
                path = replace(load_path(name), nu=nu, input=kind, rate_hz=arguments.rate,
                               gear_direction=tables)
                plan = plan_path(robot, path, PlanOptions(threads=2))
                if (kind, nu) == CASES[0]:
                    rigid = Motion(plan.time, (plan.q_desired - robot.offsets) * robot.ratios, plan.q_desired)
                    rows.append(about | {"method": "rigid inverse kinematics"}
                                | errors(robot, path, rigid, arguments.engine))
                motion = Motion(plan.time, plan.theta, plan.q_desired)
                rows.append(about | {"method": f"exactarm, {kind}", "nu": nu, "seconds": plan.solver.seconds,
                                     "iterations": plan.solver.iterations, "kkt_error": plan.solver.kkt_error,
                                     "bandwidth_hz": plan.bandwidth}
                            | errors(robot, path, motion, arguments.engine))
                print(rows[-1], flush=True)
    with open(arguments.out, "w", encoding="utf-8") as file:
        json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
