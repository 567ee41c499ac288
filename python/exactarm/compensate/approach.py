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
from exactarm.compensate.flange_poses import Poses, pose_error, solved
from exactarm.compensate.law import CompensationModel
from exactarm.compensate.program import Motion, Program
from exactarm.data.rows import LEAST_TURN_RAD
from exactarm.errors import line_name
from exactarm.numerics.rotation import turn

SAME_PLACE = 1e-8  # m and rad: below the last digit of any program


class Sides:
    """Of the targets of a program, for joint angles that change a little from one call to the next."""

    def __init__(self, program: Program, model: CompensationModel, start: np.ndarray | None):
        self.program, self.approaches = program, Approaches(model, program.motions, start)
        self.visits = np.array(program.visits, int)
        self.stops = [(motion.via is not None) + (motion.target is not None) for motion in program.motions]
        self.met, self.first = np.unique(self.visits, return_index=True)

    def of(self, q: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """(T, n) from which side each axis comes; 0 where motions to one target come from different sides.
        And what is to be told."""
        comes = np.repeat(self.approaches.of(q), self.stops, axis=0)
        sides, warnings = np.zeros_like(q), list(self.program.warnings)
        sides[self.met] = comes[self.first]
        other = np.flatnonzero(np.any(comes != sides[self.visits], axis=1))
        again = self.visits[other]
        apart = self.parted(q[again], comes[other], sides[again])
        for index in dict.fromkeys(again[apart].tolist()):
            target = self.program.targets[index]
            place = line_name(self.program.files[target.file].path, target.line)
            warnings.append(f"{target.name} ({place}) is approached from different sides: the mean of both "
                            "gear tables is taken there")
        for visit in other:
            index = self.visits[visit]
            sides[index] = np.where(sides[index] == comes[visit], sides[index], 0.0)
        return sides, warnings

    def parted(self, q: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """(K,) whether the arm stands elsewhere at q (K, n) where it comes from the other side: not without
        gear tables and backlash."""
        if not len(q):
            return np.zeros(0, bool)
        model, known = self.approaches.model, np.nan_to_num(q)
        apart = pose_error(model.reached(known, one), model.reached(known, other))
        return np.linalg.norm(apart, axis=1) > SAME_PLACE


class Approaches:
    """(M, n) from -1 to 1 for each motion. Straight ones are looked at again only where an end has changed.

    start (n,): where the arm stands before the first motion, as far as it is known.
    """

    def __init__(self, model: CompensationModel, motions: Sequence[Motion], start: np.ndarray | None = None):
        self.model, self.motions, self.start = model, motions, start
        self.sense = np.sign(model.actual.ratios)
        self.timed = bool(motions) and all(motion.time is not None for motion in motions)
        self.target = np.array([-1 if motion.target is None else motion.target for motion in motions], int)
        self.given = np.array([motion.approach is not None for motion in motions], bool)
        self.before = np.concatenate([[-1], self.target])[:-1]
        self.known = (self.target >= 0) & (self.before >= 0) & ~self.given
        straight = np.array([motion.kind != "joint" for motion in motions], bool)
        self.rows = np.flatnonzero(self.known & straight)
        over = [motions[i].via for i in self.rows.tolist()]
        self.over = np.array([end if via is None else via for via, end in zip(over, self.target[self.rows])],
                             int)
        self.q, self.at = np.empty(0), Poses(np.empty(0), np.empty(0))  # of all targets
        self.arrival = np.zeros((len(self.rows), model.actual.axes))  # of the straight ones, for q

    def of(self, q: np.ndarray) -> np.ndarray:
        """q (T, n): joint angles of the targets, NaN where not known."""
        if self.timed:
            path = q[self.target] * self.sense
            return direction_of_motion(np.array([motion.time for motion in self.motions]), path)
        arrival = np.zeros((len(self.motions), q.shape[1]))
        arrival[self.known] = q[self.target[self.known]] - q[self.before[self.known]]
        for i in np.flatnonzero(self.given):
            arrival[i] = np.asarray(self.motions[i].approach) * self.sense  # taken as it is, below
        if self.start is not None and self.motions and self.target[0] >= 0 and not self.given[0]:
            arrival[0] = q[self.target[0]] - self.start
        if self.rows.size:
            self.straight(np.nan_to_num(q))
            arrival[self.rows] = self.arrival
        lost = np.append(np.isnan(q).any(axis=1), True)  # place -1: no target
        blind = self.known & (lost[self.target] | lost[self.before])
        arrival[blind] = 0.0
        return _kept(np.nan_to_num(arrival), self.given, blind | (self.target < 0)) * self.sense

    def straight(self, q: np.ndarray) -> None:
        """Brings `arrival` up to date."""
        chain = self.model.controller
        if self.q.size:
            changed = np.any(q != self.q, axis=1)
            self.at.set(changed, chain.poses(q[changed]))
        else:
            changed, self.at = np.ones(len(q), bool), chain.poses(q)
        start, end = self.before[self.rows], self.target[self.rows]
        these = np.flatnonzero(changed[start] | changed[self.over] | changed[end])
        self.q = q
        if not these.size:
            return
        start, over, end = start[these], self.over[these], end[these]
        twist = _final_twist(self.at.rows(start), self.at.rows(over), self.at.rows(end))
        with np.errstate(invalid="ignore"):
            self.arrival[these] = np.nan_to_num(solved(chain.jacobian(q[end]), twist), posinf=0.0, neginf=0.0)


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


def _kept(arrival: np.ndarray, given: np.ndarray, blind: np.ndarray) -> np.ndarray:
    """Signs, where an axis does not move those of the motion before, if they are not given (M,); nothing is
    known of motions (M,) that are blind, nor behind them."""
    anew = given | blind
    signs = np.where(given[:, None] | (np.abs(arrival) > LEAST_TURN_RAD), np.sign(arrival), 0.0)
    told = np.where((signs != 0.0) | anew[:, None], np.arange(len(signs))[:, None], -1)
    last = np.maximum.accumulate(told, axis=0)  # motion that the sign of each axis comes from, -1: none
    return np.where(last < 0, 0.0, np.take_along_axis(signs, np.maximum(last, 0), axis=0))
