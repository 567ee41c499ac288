"""Length of the stretched arm: sum_i sqrt(a_i^2 + d_i^2), with the stroke of sliding axes; m."""

import numpy as np

from exactarm.robot.robot import Robot


def reach(robot: Robot) -> float:
    """m."""
    strokes = [abs(bound or 0.0) for joint in robot.joints if joint.type == "prismatic"
               for bound in (joint.q_min, joint.q_max)]
    return float(sum(np.hypot(joint.a, joint.d) for joint in robot.joints) + sum(strokes))
