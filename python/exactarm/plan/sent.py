"""A plan in the words of a controller: what is sent are the joint angles that the controller reports while
the motors follow the plan.

    q_sent = theta / controller_ratio + controller_offset      (not q, the links behind gears and springs)

    joint_trajectory   ROS 2 trajectory_msgs/JointTrajectory, YAML: positions rad, velocities rad/s,
                       time_from_start
    servoj             URScript: one servoj a sample, rad, at the plan's rate
"""

from __future__ import annotations

import numpy as np

from exactarm.plan.optimal import Plan
from exactarm.robot import Robot

FILES = {"joint_trajectory": "trajectory.yaml", "servoj": "trajectory.script"}


def sent_angles(robot: Robot, plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles (N, n) rad to send, and their rates rad/s."""
    return (
        plan.theta / robot.controller_ratios + robot.controller_offsets,
        plan.theta_dot / robot.controller_ratios
    )


def sent_text(kind: str, robot: Robot, plan: Plan) -> str:
    """The file's text; kind as in FILES."""
    return {"joint_trajectory": _joint_trajectory, "servoj": _servoj}[kind](robot, plan)


def _joint_trajectory(robot: Robot, plan: Plan) -> str:
    names = robot.controller.joint_names or tuple(f"joint_{i + 1}" for i in range(robot.axes))
    q, rate = sent_angles(robot, plan)
    lines = ["joint_names: [" + ", ".join(names) + "]", "points:"]
    for time, angles, rates in zip(plan.time, q, rate):
        nanoseconds = round(1e9 * float(time))
        lines += [f"- positions: {_list(angles)}", f"  velocities: {_list(rates)}",
                  f"  time_from_start: {{sec: {nanoseconds // 10**9}, nanosec: {nanoseconds % 10**9}}}"]
    return "\n".join(lines) + "\n"


def _servoj(robot: Robot, plan: Plan) -> str:
    q, _ = sent_angles(robot, plan)
    step = float(plan.time[1] - plan.time[0])
    lines = ["def exactarm_trajectory():", f"  movej({_list(q[0])})"]
    lines += [f"  servoj({_list(angles)}, t={step:.6g}, lookahead_time=0.03, gain=2000)" for angles in q]
    return "\n".join([*lines, "  stopj(2.0)", "end", "exactarm_trajectory()", ""])


def _list(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.12g}" for value in values.tolist()) + "]"
