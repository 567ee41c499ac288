"""What a plan is worth: planned motions of the source's paths, played on the plant of `exactarm simulate`.

The plant integrates the links behind their springs with a stiff integrator and shares no line with the planner's
transcription. One gear table in both directions, as the source plans. Writes JSON: flange errors in m at the knots and
between them (four samples a knot) for (a) rigid inverse kinematics on the plant's own geometry and (b) exactarm at several
weights, with the jerk as the input too, and the bandwidth of each axis.

    python bench/planning_accuracy.py out.json [--rate HZ]
"""

import argparse
import json
from dataclasses import replace

import numpy as np
from scipy.interpolate import make_interp_spline

from exactarm.dataset import Dataset
from exactarm.plan import PlanOptions, load_path, plan_path
from exactarm.robot_file import load_robot
from exactarm.simulate.measure import true_path
from exactarm.simulate.virtual_robot import VirtualRobot, unplaced

BETWEEN = 4
CASES = [("acceleration", 10.0**k) for k in (-16, -14, -12, -10, -8, -6)] + [("jerk", 1e-20), ("jerk", 1e-18)]


def errors(robot, path, time, theta):
    """RMS and largest flange error at the knots, and at four times the rate."""
    found = {}
    for name, factor in (("knots", 1), ("between", BETWEEN)):
        fine = np.linspace(time[0], time[-1], factor * (len(time) - 1) + 1)
        played = theta if factor == 1 else make_interp_spline(time, theta, k=5)(fine)
        data = Dataset.of_arrays("tracked_motion", {"theta": played}, time=fine)
        flange = true_path(VirtualRobot(robot, unplaced(robot)), data)
        error = np.linalg.norm(flange - path.curve.motion(path.duration)(fine)[0], axis=1)
        found |= {f"rms_{name}_m": float(np.sqrt(np.mean(error**2))), f"max_{name}_m": float(error.max())}
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out")
    parser.add_argument("--rate", type=float, default=1000.0)
    arguments = parser.parse_args()
    robot = load_robot("racer-7-1.4")
    robot = replace(robot, joints=tuple(replace(joint, ccw=joint.cw) for joint in robot.joints))
    rows = []
    for name in ("line", "spiral"):
        for kind, nu in CASES:
            path = replace(load_path(name), nu=nu, input=kind, rate_hz=arguments.rate)
            plan = plan_path(robot, path, PlanOptions(threads=2))
            if not rows or rows[-1]["path"] != name:
                rigid = (plan.q_desired - robot.offsets) * robot.ratios
                rows.append({"path": name, "method": "rigid inverse kinematics"} | errors(robot, path, plan.time, rigid))
            rows.append({"path": name, "method": f"exactarm, {kind}", "nu": nu, "seconds": plan.solver.seconds,
                         "iterations": plan.solver.iterations, "kkt_error": plan.solver.kkt_error,
                         "bandwidth_hz": plan.bandwidth} | errors(robot, path, plan.time, plan.theta))
    with open(arguments.out, "w", encoding="utf-8") as file:
        json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
