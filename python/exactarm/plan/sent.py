"""A plan in the words of a controller: what is sent are the joint angles that the controller reports while
the motors follow the plan.

    q_sent = theta / controller_ratio + controller_offset      (not q, the links behind gears and springs),
             and what it reports of them where axes are coupled ([controller] coupling)

    joint_trajectory   ROS 2 trajectory_msgs/JointTrajectory, YAML: positions rad, velocities rad/s,
                       time_from_start
    servoj             URScript: one servoj a sample, rad, at the plan's rate
    krl                KUKA KRL: a PTP_SPLINE block of SPTP points, deg, thinned to at most `MOST_POINTS`,
                       with TIME_BLOCK parts; the controller plans the time between them anew. Written from
                       descriptions in public use, not run on a controller
    csv                a table, one row a sample at the plan's rate: time_s, q_i_deg (sliding axes: q_i_mm)
    pulses             the same in whole pulses: time_s, pulses_i ([controller] pulses_per_rad)
"""

from __future__ import annotations

import numpy as np
import scipy  # scipy.interpolate is imported at its first use

from exactarm.errors import InputError
from exactarm.plan.optimal import Plan
from exactarm.robot.controller_frames import FOR_THE_REAL_ARM
from exactarm.robot.robot import Robot

FILES = {"joint_trajectory": "trajectory.yaml", "servoj": "trajectory.script", "krl": "trajectory.src",
         "csv": "sent.csv", "pulses": "sent_pulses.csv"}
KRL_AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
MOST_POINTS = 200  # of a spline block: a controller plans all of it before it moves


def sent_angles(robot: Robot, plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles (N, n) rad to send, and their rates rad/s."""
    shown = robot.controller.reported
    return (shown(plan.theta / robot.controller_ratios + robot.controller_offsets),
            shown(plan.theta_dot / robot.controller_ratios))


def sent_text(kind: str, robot: Robot, plan: Plan) -> str:
    """The file's text; kind as in FILES."""
    write = {"joint_trajectory": _joint_trajectory, "servoj": _servoj, "krl": _krl, "csv": _csv,
             "pulses": _pulses}
    return write[kind](robot, plan)


def _csv(robot: Robot, plan: Plan) -> str:
    q, _ = sent_angles(robot, plan)
    sliding = np.array([joint.type == "prismatic" for joint in robot.joints])
    values = np.where(sliding, 1e3 * q, np.degrees(q))
    names = [f"q_{i + 1}_{'mm' if slides else 'deg'}" for i, slides in enumerate(sliding)]
    return _table(plan, names, [[f"{value:.9f}" for value in row] for row in values.tolist()])


def _pulses(robot: Robot, plan: Plan) -> str:
    scale = np.array(robot.controller.pulses_per_rad)
    if not scale.size:
        raise InputError(f"robot {robot.name} declares no pulses; expected [controller] pulses_per_rad",
                         file=robot.file)
    counts = np.round(sent_angles(robot, plan)[0] * scale).astype(int)
    return _table(plan, [f"pulses_{i + 1}" for i in range(robot.axes)], counts.astype(str).tolist())


def _table(plan: Plan, names: list[str], rows: list[list[str]]) -> str:
    lines = [",".join(["time_s", *names])]
    lines += [",".join([f"{time:.9g}", *row]) for time, row in zip(plan.time.tolist(), rows)]
    return "\n".join(lines) + "\n"


def _joint_trajectory(robot: Robot, plan: Plan) -> str:
    names = robot.controller.joint_names or tuple(f"joint_{i + 1}" for i in range(robot.axes))
    q, rate = sent_angles(robot, plan)
    lines = [f"# {FOR_THE_REAL_ARM}", "joint_names: [" + ", ".join(names) + "]", "points:"]
    for time, angles, rates in zip(plan.time, q, rate):
        nanoseconds = round(1e9 * float(time))
        lines += [f"- positions: {_list(angles)}", f"  velocities: {_list(rates)}",
                  f"  time_from_start: {{sec: {nanoseconds // 10**9}, nanosec: {nanoseconds % 10**9}}}"]
    return "\n".join(lines) + "\n"


def _servoj(robot: Robot, plan: Plan) -> str:
    q, _ = sent_angles(robot, plan)
    step = float(plan.time[1] - plan.time[0])
    lines = ["def exactarm_trajectory():", f"  # {FOR_THE_REAL_ARM}", f"  movej({_list(q[0])})"]
    lines += [f"  servoj({_list(angles)}, t={step:.6g}, lookahead_time=0.03, gain=2000)" for angles in q]
    return "\n".join([*lines, "  stopj(2.0)", "end", "exactarm_trajectory()", ""])


def _krl(robot: Robot, plan: Plan) -> str:
    if robot.axes > len(KRL_AXES) or any(joint.type != "revolute" for joint in robot.joints):
        raise InputError(f"robot {robot.name}: expected at most six turning axes for KRL points",
                         file=robot.file)
    q, _ = sent_angles(robot, plan)
    degrees = np.degrees(q)
    kept = np.unique(np.linspace(0, len(q) - 1, min(len(q), MOST_POINTS)).round().astype(int))
    between = scipy.interpolate.CubicSpline(plan.time[kept], degrees[kept])(plan.time)
    off = float(np.max(np.abs(between - degrees)))
    share = np.diff(plan.time[kept]) / (plan.time[-1] - plan.time[0])
    lines = ["DEF EXACTARM_TRAJECTORY()", f"; {FOR_THE_REAL_ARM}",
             f"; {len(kept)} of {len(q)} points; a cubic spline through them is off the plan by {off:.2g} "
             "deg at most",
             f"PTP {_axis_angles(degrees[0])}", "PTP_SPLINE", "  TIME_BLOCK START"]
    for point, part in zip(degrees[kept[1:]], share):
        lines += [f"  SPTP {_axis_angles(point)}", f"  TIME_BLOCK PART = {100.0 * part:.6g}"]
    lines[-1] = f"  TIME_BLOCK END = {float(plan.time[-1] - plan.time[0]):.6g}"
    return "\n".join([*lines, "ENDSPLINE", "END", ""])


def _axis_angles(degrees: np.ndarray) -> str:
    """Axes that a robot has not stay where they are."""
    return "{" + ",".join(f"{name} {value:.6f}" for name, value in zip(KRL_AXES, degrees.tolist())) + "}"


def _list(values: np.ndarray) -> str:
    """Without exponents: YAML takes 5e-05 for a word."""
    return "[" + ", ".join(f"{value:.12f}" for value in values.tolist()) + "]"
