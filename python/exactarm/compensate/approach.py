"""From which side each axis comes to its target: the direction that its gear's table and its backlash know.

    joint motion      sign of q_i - q_(i-1)
    linear, circular  sign of J^-1 of the direction in which the tool arrives
An axis that moves less than LEAST_TURN_RAD keeps the direction that it had. 0: not known. The sense is the
motors': with a negative ratio the motor turns the other way than the axis.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from exactarm.chain.direction import direction_of_motion
from exactarm.compensate.flange_poses import Poses, solved
from exactarm.compensate.law import CompensationModel
from exactarm.compensate.program import Motion, Program
from exactarm.rotation import turn
from exactarm.rows import LEAST_TURN_RAD


def sides_of(
    program: Program, model: CompensationModel, q: np.ndarray, start: np.ndarray | None
) -> tuple[np.ndarray, list[str]]:
    """(T, n) from which side each axis comes; 0 where motions to one target come from different sides. And
    what is to be told."""
    by_motion = approaches(model, program.motions, q, start)
    visits = np.array(program.visits, int)
    stops = [(motion.via is not None) + (motion.target is not None) for motion in program.motions]
    comes = np.repeat(by_motion, stops, axis=0)
    sides, warnings = np.zeros_like(q), list(program.warnings)
    met, first = np.unique(visits, return_index=True)
    sides[met] = comes[first]
    other = np.flatnonzero(np.any(comes != sides[visits], axis=1))
    for index in dict.fromkeys(visits[other].tolist()):
        target = program.targets[index]
        warnings.append(f"{target.name} (line {target.line}) is approached from different sides: the mean of "
                        "both gear tables is taken there")
    for visit in other:
        index = visits[visit]
        sides[index] = np.where(sides[index] == comes[visit], sides[index], 0.0)
    return sides, warnings


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
    target = np.array([-1 if motion.target is None else motion.target for motion in motions], int)
    given = np.array([motion.approach is not None for motion in motions], bool)
    before = np.concatenate([[-1], target])[:-1]
    known = (target >= 0) & (before >= 0) & ~given
    arrival[known] = q[target[known]] - q[before[known]]
    for i in np.flatnonzero(given):
        arrival[i] = np.asarray(motions[i].approach) * sense  # taken as it is, below
    if start is not None and motions and target[0] >= 0 and not given[0]:
        arrival[0] = q[target[0]] - start
    rows = np.flatnonzero(known & np.array([motion.kind != "joint" for motion in motions], bool))
    if rows.size:
        before = before[rows]
        ends = target[rows]
        over = np.array([end if motions[i].via is None else motions[i].via for i, end in zip(rows, ends)])
        twist = _final_twist(poses.rows(before), poses.rows(over), poses.rows(ends))
        jacobian = model.controller.jacobian(np.nan_to_num(q[ends]))
        with np.errstate(invalid="ignore"):
            arrival[rows] = np.nan_to_num(solved(jacobian, twist), posinf=0.0, neginf=0.0)
    return _kept(np.nan_to_num(arrival), motions) * sense


def _final_twist(start: Poses, over: Poses, end: Poses) -> np.ndarray:
    """(K, 6) direction of arrival, as long as the way from the start: straight, or along the circle over a
    third point."""
    chord = end.position - start.position
    tangent = chord.copy()
    for k in np.flatnonzero(np.any(over.position != end.position, axis=1)):
        a, b, c = start.position[k], over.position[k], end.position[k]
        normal = np.cross(b - a, c - a)
        if np.linalg.norm(normal) < 1e-9:  # three points on a line
            continue
        # The centre is where the perpendicular planes of both chords cut the plane of the circle.
        rows = np.array([b - a, c - a, normal])
        centre = a + np.linalg.solve(rows, [0.5 * (b - a) @ (b - a), 0.5 * (c - a) @ (c - a), 0.0])
        along = np.cross(normal, c - centre)
        tangent[k] = along / np.linalg.norm(along) * max(np.linalg.norm(c - a), np.linalg.norm(b - a))
    turned = turn(end.rotation @ np.swapaxes(start.rotation, -1, -2))
    return np.concatenate([tangent, turned], axis=1)


def _kept(arrival: np.ndarray, motions: Sequence[Motion]) -> np.ndarray:
    """Signs, where an axis does not move those of the motion before; nothing is known behind an unknown
    place."""
    given = np.array([motion.approach is not None for motion in motions], bool)
    anew = given | np.array([motion.target is None for motion in motions], bool)
    signs = np.where(given[:, None] | (np.abs(arrival) > LEAST_TURN_RAD), np.sign(arrival), 0.0)
    told = np.where((signs != 0.0) | anew[:, None], np.arange(len(signs))[:, None], -1)
    last = np.maximum.accumulate(told, axis=0)  # motion that the sign of each axis comes from, -1: none
    return np.where(last < 0, 0.0, np.take_along_axis(signs, np.maximum(last, 0), axis=0))
