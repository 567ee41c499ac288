"""The link on which a gyroscope sits: which joint rates it feels, and how gravity stands in it.

The sensor's nominal axes on the link behind axis j: z along the axis, in the sense in which q_j rises, and x
where the frame's x axis lies after the turn q_j. Rates of axes upstream (their deflection as axis j moves)
are felt too.
"""

import numpy as np

from exactarm import _core
from exactarm.robot.robot import GRAVITY_M_S2
from exactarm.view import View


def sensor_rates(view: View, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """weights (N, 3, n): reading = weights q_dot; specific force (N, 3) in the nominal axes, in units of g.

    q (N, n): joint angles at the nominal ratios, which is close enough for directions.
    """
    weights = np.zeros((view.rows, 3, view.axes))
    force = np.zeros((view.rows, 3))
    for rows, axis in view.moving_runs:
        if not view.robot.has_geometry:
            weights[rows, 2, axis] = 1.0
            continue
        _, rotations = _core.frame_poses(view.robot_at_origin, q[rows])
        sign = np.array([joint.sign for joint in view.robot.joints])
        axes = rotations[:, : axis + 1, :, 2] * sign[: axis + 1, None]
        joint = view.robot.joints[axis]
        nominal = rotations[:, axis] @ _about_z(joint.sign * q[rows, axis] + joint.zero)
        # z along the axis as q rises: half a turn about x where the sign is -1
        nominal[:, :, 1:] *= joint.sign
        weights[rows, :, : axis + 1] = np.einsum("iab,ika->ibk", nominal, axes)
        force[rows] = -np.einsum("iab,a->ib", nominal, view.robot.gravity) / GRAVITY_M_S2
    return weights, force


def _about_z(angle: np.ndarray) -> np.ndarray:
    out = np.zeros((angle.size, 3, 3))
    out[:, 0, 0] = out[:, 1, 1] = np.cos(angle)
    out[:, 1, 0] = np.sin(angle)
    out[:, 0, 1] = -out[:, 1, 0]
    out[:, 2, 2] = 1.0
    return out
