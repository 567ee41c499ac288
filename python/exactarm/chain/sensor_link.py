"""The link on which a gyroscope sits: which joint rates it feels, and how gravity stands in it.

The sensor's nominal axes on the link behind axis j: z along the axis, in the sense in which q_j rises, and x
where the frame's x axis lies after the turn q_j. Rates of axes upstream (their deflection as axis j moves)
are felt too. Where the readings show axes that are not parallel, they tell how the sensor itself is mounted
on the link behind the last of them (Wahba 1965), and gravity is that in its own axes in all runs.
"""

import numpy as np

from exactarm import _core
from exactarm.numerics.factors import svd
from exactarm.robot.mdh_frames import NEARLY_PARALLEL
from exactarm.robot.robot import GRAVITY_M_S2
from exactarm.view import View

_RIGID = 0.02  # of a unit vector: geometry as drawn is no worse


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


def force_in_sensor(view: View, q: np.ndarray, nominal: np.ndarray,
                    shown: dict[tuple[int, int], np.ndarray]) -> np.ndarray:
    """The specific force (N, 3) in the sensor's own axes, in the nominal ones (N, 3) where its mount is not
    known. shown: (session, axis from 0) -> (3,) the moving axis in the sensor's axes, as it was aligned."""
    if not view.robot.has_geometry:
        return nominal
    force, sessions = nominal.copy(), view.data.session
    sign = np.array([joint.sign for joint in view.robot.joints])
    for session in np.unique(sessions):
        runs = [(rows, axis) for rows, axis in view.moving_runs
                if sessions[rows[0]] == session and (session, axis) in shown]
        if len({axis for _, axis in runs}) < 2:
            continue
        link = max(axis for _, axis in runs) + 1
        turned = lambda rows: _core.frame_poses(view.robot_at_origin, q[rows])[1]
        begins = turned(np.array([rows[0] for rows, _ in runs]))
        body = np.array([at[link].T @ at[axis, :, 2] * sign[axis] for at, (_, axis) in zip(begins, runs)])
        mount = _mount(body, np.array([shown[session, axis] for _, axis in runs]))
        if mount is not None:
            for rows, _ in runs:
                force[rows] = -(view.robot.gravity / GRAVITY_M_S2) @ turned(rows)[:, link] @ mount.T
    return force


def _mount(body: np.ndarray, seen: np.ndarray) -> np.ndarray | None:
    """The rotation (3, 3) that takes directions (K, 3) of the link to what the sensor shows of them; None
    where all are parallel, or no rigid mount has these."""
    left, sizes, right = svd(seen.T @ body)
    if sizes[1] < np.sin(NEARLY_PARALLEL) ** 2 * sizes[0]:
        return None
    mount = left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right
    return mount if np.abs(body @ mount.T - seen).max() < _RIGID else None


def _about_z(angle: np.ndarray) -> np.ndarray:
    out = np.zeros((angle.size, 3, 3))
    out[:, 0, 0] = out[:, 1, 1] = np.cos(angle)
    out[:, 1, 0] = np.sin(angle)
    out[:, 0, 1] = -out[:, 1, 0]
    out[:, 2, 2] = 1.0
    return out
