"""From which side each axis comes to its target: the direction that its gear's table and its backlash know.

    joint motion      sign of q_i - q_(i-1)
    linear, circular  sign of J^-1 of the direction in which the tool arrives
An axis that moves less than LEAST_TURN_RAD keeps the direction that it had. 0: not known. The sense is the
motors': with a negative ratio the motor turns the other way than the axis.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from exactarm import _core
from exactarm.chain.direction import LEAST_TURN_RAD, direction_of_motion
from exactarm.compensate.flange_poses import Poses, pseudo_inverse
from exactarm.compensate.law import CompensationModel
from exactarm.compensate.program import Motion
from exactarm.rotation import log as rotation_log


def approaches(
    model: CompensationModel, motions: Sequence[Motion], q: np.ndarray, start: np.ndarray | None = None
) -> np.ndarray:
    """(M, n) from -1 to 1 for each motion; q (T, n): joint angles of the targets, NaN where not known.

    start (n,): where the arm stands before the first motion, as far as it is known.
    """
    sense, n = np.sign(model.actual.ratios), q.shape[1]
    if motions and all(motion.time is not None for motion in motions):
        path = q[[motion.target for motion in motions]]
        return direction_of_motion(np.array([motion.time for motion in motions]), path * sense)
    poses = model.controller.poses(np.nan_to_num(q))
    arrival = np.zeros((len(motions), n))
    curved = []
    for i, motion in enumerate(motions):
        before = motions[i - 1].target if i else None
        if motion.approach is not None:
            arrival[i] = np.asarray(motion.approach) * sense  # taken as it is, below
        elif i == 0 and motion.target is not None and start is not None:
            arrival[i] = q[motion.target] - start
        elif motion.target is not None and before is not None:
            arrival[i] = q[motion.target] - q[before]
            if motion.kind != "joint":
                curved.append((i, before))
    if curved:
        rows, before = np.array(curved).T
        ends = np.array([motions[i].target for i in rows])
        over = np.array([end if motions[i].via is None else motions[i].via for i, end in zip(rows, ends)])
        twist = _final_twist(poses.rows(before), poses.rows(over), poses.rows(ends))
        inverse = pseudo_inverse(_core.geometric_jacobian(model.controller.core, np.nan_to_num(q[ends])))
        with np.errstate(invalid="ignore"):
            arrival[rows] = np.nan_to_num((inverse @ twist[:, :, None])[:, :, 0], posinf=0.0, neginf=0.0)
    return _kept(np.nan_to_num(arrival), motions) * sense


def _final_twist(start: Poses, over: Poses, end: Poses) -> np.ndarray:
    """(K, 6) direction of arrival, as long as the way from the start: straight, or along the circle over a
    third point."""
    chord = end.position - start.position
    tangent = chord.copy()
    for k, (a, b, c) in enumerate(zip(start.position, over.position, end.position)):
        if np.array_equal(b, c):
            continue
        normal = np.cross(b - a, c - a)
        if np.linalg.norm(normal) < 1e-9:  # three points on a line
            continue
        # The centre is where the perpendicular planes of both chords cut the plane of the circle.
        rows = np.array([b - a, c - a, normal])
        centre = a + np.linalg.solve(rows, [0.5 * (b - a) @ (b - a), 0.5 * (c - a) @ (c - a), 0.0])
        along = np.cross(normal, c - centre)
        tangent[k] = along / np.linalg.norm(along) * max(np.linalg.norm(c - a), np.linalg.norm(b - a))
    turn = rotation_log(end.rotation @ np.swapaxes(start.rotation, -1, -2))
    return np.concatenate([tangent, turn], axis=1)


def _kept(arrival: np.ndarray, motions: Sequence[Motion]) -> np.ndarray:
    """Signs, where an axis does not move those of the motion before; nothing is known behind an unknown
    place."""
    signs = np.where(np.abs(arrival) > LEAST_TURN_RAD, np.sign(arrival), 0.0)
    last = np.zeros(arrival.shape[1])
    for i, motion in enumerate(motions):
        if motion.approach is not None:
            last = signs[i] = np.sign(arrival[i])
            continue
        if motion.target is None:
            last = np.zeros_like(last)
        last = np.where(signs[i] != 0.0, signs[i], last)
        signs[i] = last
    return signs
