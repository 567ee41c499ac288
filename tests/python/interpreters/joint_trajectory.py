"""ROS 2 `trajectory_msgs/JointTrajectory` as YAML, read by PyYAML: every document and every goal that holds
one.

positions[i] is of joint_names[i], in rad; the robot's order is that of `names`.
"""

from __future__ import annotations

import numpy as np
import yaml

from .motion import Arm, Run


def trajectories(node):
    if isinstance(node, dict) and "joint_names" in node and "points" in node:
        yield node
    elif isinstance(node, (dict, list)):
        for item in node.values() if isinstance(node, dict) else node:
            yield from trajectories(item)


def execute(files: dict[str, bytes], arm: Arm, start, names) -> list:
    run = Run(arm, start)
    for file, text in files.items():
        for document in yaml.safe_load_all(text.decode("utf-8")):
            for trajectory in trajectories(document):
                if not trajectory["points"]:
                    continue
                order = [trajectory["joint_names"].index(name) for name in names]
                for i, point in enumerate(trajectory["points"]):
                    q = np.array(point["positions"], float)[order]
                    run.to_joints("joint", q, np.eye(4), f"{file}: point {i}")
    return run.motions
