"""Straight motions: how far the real tip leaves the line between two corrected targets, and the points in
between that keep it there.

The controller moves the tip it knows of along a straight line; the error of the arm changes on the way, so a
line with corrected ends bends. Points in between are corrected as the ends are. They are put into the program
where the dialect takes a point without more ado; elsewhere the bend is told.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from exactarm import _core
from exactarm.compensate.controller import ANYWHERE, SOLVED
from exactarm.compensate.flange_poses import Poses
from exactarm.compensate.law import NOT_REACHED, CompensationModel
from exactarm.compensate.program import Motion, Program
from exactarm.robot.mdh_frames import compose, relative
from exactarm.robot.robot import Placement

SAMPLES = (
    48  # of a line in all: gear ripple of a hundred periods a turn shows on motions of a few degrees an axis
)
MOST_POINTS = 31  # in between; a line that needs more is told
LIMIT = 0.99  # of the tolerance: the points in between are rounded too


@dataclass(frozen=True)
class Bend:
    """One straight motion: target (index), its file and line, largest distance (m) of the real tip from the
    line with corrected ends, and, with `points` in between, what is left of it. edit: what `insert` of the
    motion gave for them. open: points in between can be put before it."""

    target: int
    line: int
    before: float
    after: float
    points: int
    edit: Any = None
    open: bool = True


@dataclass(frozen=True)
class _Line:
    """Both ends in one tool and base: the tips that are wanted, the joint angles that are commanded."""

    start: Placement
    end: Placement
    q: np.ndarray  # (2, n)
    tool: Placement
    base: Placement

    def wanted(self, shares: np.ndarray) -> list[Placement]:
        return _between(self.start, self.end, shares)


def bends(
    program: Program, model: CompensationModel, wanted: Poses, q_after: np.ndarray, tolerance: float
) -> list[Bend]:
    """All straight motions between corrected targets whose tool is known; wanted: flange poses (T) of the
    targets; tolerance in m."""
    found = []
    for before, motion in _lines(program, q_after):
        ends, target = (before.target, motion.target), program.targets[motion.target]
        if not target.tip_known:
            continue
        flanges = [Placement(wanted.rotation[i], wanted.position[i]) for i in ends]
        tips = [compose(relative(target.base, flange), target.tool) for flange in flanges]
        loaded = model if target.load is None else model.with_load(target.load[0], np.array(target.load[1]))
        line = _Line(*tips, q_after[list(ends)], target.tool, target.base)
        found.append(_bend(loaded, line, motion, tolerance))
    return found


def unknown_tips(program: Program, q_after: np.ndarray) -> list[Motion]:
    """Straight motions to joint angles with a tool that is not known: its tip decides the line."""
    return [motion for _, motion in _lines(program, q_after) if not program.targets[motion.target].tip_known]


def _lines(program: Program, q_after: np.ndarray) -> list[tuple[Motion, Motion]]:
    """Straight motions between corrected targets, each behind the motion above."""
    return [(before, motion) for before, motion in zip(program.motions, program.motions[1:])
            if motion.kind == "linear" and None not in (before.target, motion.target)
            and not np.isnan(q_after[[before.target, motion.target]]).any()]


def _bend(model: CompensationModel, line: _Line, motion, tolerance: float) -> Bend:
    knots, q = np.array([0.0, 1.0]), line.q
    first = left = _deviation(model, line, knots, q)
    count = 0
    while left > LIMIT * tolerance and 2 * count + 1 <= MOST_POINTS:
        count = 2 * count + 1
        knots = np.linspace(0.0, 1.0, count + 2)
        inner = _commands(model, line, knots[1:-1])
        if inner is None:
            return Bend(motion.target, motion.line, first, first, 0)
        q = np.vstack([line.q[:1], inner, line.q[1:]])
        left = _deviation(model, line, knots, q)
    if count == 0 or left >= first:
        return Bend(motion.target, motion.line, first, first, 0)
    if motion.insert is None:
        return Bend(motion.target, motion.line, first, first, 0, open=False)
    tips = [
        compose(relative(line.base, pose), line.tool) for pose in _placements(model.controller.poses(q[1:-1]))
    ]
    edit = motion.insert(list(zip(q[1:-1], tips)))
    if edit is None:
        return Bend(motion.target, motion.line, first, first, 0, open=False)
    return Bend(motion.target, motion.line, first, left, count, edit)


def _commands(model: CompensationModel, line: _Line, shares: np.ndarray) -> np.ndarray | None:
    """Joint angles (K, n) that bring the real tip to the line; None where one is not reached."""
    tips = line.wanted(shares)
    near = _joints(model, line, tips)
    if near is None:
        return None
    flanges = _flanges(line, tips)
    found = model.commands(flanges, near, _sides(model, np.vstack([line.q[:1], near]))[1:])
    return found.q if np.all(found.left_over < NOT_REACHED) else None


def _deviation(model: CompensationModel, line: _Line, knots: np.ndarray, q: np.ndarray) -> float:
    """Largest distance (m) of the real tip from the line, when the controller goes straight from knot to
    knot."""
    tips = [compose(relative(line.base, pose), line.tool) for pose in _placements(model.controller.poses(q))]
    each = max(SAMPLES // (len(knots) - 1), 2)
    largest = 0.0
    for k in range(len(knots) - 1):
        way = _between(tips[k], tips[k + 1], np.arange(1, each) / each)
        angles = _joints(model, replace(line, q=q[k : k + 2]), way)
        if angles is None:
            return np.inf
        reached = model.reached(angles, _sides(model, np.vstack([q[k], angles]))[1:])
        there = reached.position + reached.rotation @ line.tool.position
        there = (there - line.base.position) @ line.base.rotation
        largest = max(largest, float(_distance(there, line.start.position, line.end.position).max()))
    return largest


def _joints(model: CompensationModel, line: _Line, tips: list[Placement]) -> np.ndarray | None:
    """The controller's joint angles along tips close to each other, from the first of line.q on."""
    flanges = _flanges(line, tips)
    q, report = _core.inverse_kinematics_path(
        model.controller.core, flanges.position, flanges.rotation.reshape(-1, 9),
        model.controller.turned(line.q[0]), ANYWHERE
    )
    return model.controller.unturned(q) if report.status == SOLVED else None


def _flanges(line: _Line, tips: list[Placement]) -> Poses:
    behind = relative(line.tool, Placement())
    flanges = [compose(compose(line.base, tip), behind) for tip in tips]
    return Poses(np.array([f.position for f in flanges]), np.array([f.rotation for f in flanges]))


def _sides(model: CompensationModel, q: np.ndarray) -> np.ndarray:
    """(K, n) the directions of the motors on the way through q (K, n)."""
    steps = np.sign(np.diff(q, axis=0)) * np.sign(model.actual.ratios)
    return np.vstack([steps[:1], steps])


def _between(start: Placement, end: Placement, shares: np.ndarray) -> list[Placement]:
    """Straight, and turning about one axis."""
    turn = Slerp([0.0, 1.0], Rotation.from_matrix([start.rotation, end.rotation]))(shares).as_matrix()
    way = start.position + shares[:, None] * (end.position - start.position)
    return [Placement(rotation, position) for rotation, position in zip(turn, way)]


def _placements(poses: Poses) -> list[Placement]:
    return [Placement(rotation, position) for rotation, position in zip(poses.rotation, poses.position)]


def _distance(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(K,) of points from the line through start and end; from the point where both are one."""
    along, length = end - start, np.linalg.norm(end - start)
    if length < 1e-9:
        return np.linalg.norm(points - start, axis=1)
    return np.linalg.norm(np.cross(points - start, along / length), axis=1)
