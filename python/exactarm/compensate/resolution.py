"""Targets of a program as the controller takes them: every one as joint angles of the controller's own chain,
in the order of the motions, the branch by its configuration word, else nearest to the one before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from exactarm.compensate.flange_poses import Poses, flange_poses
from exactarm.compensate.law import CompensationModel
from exactarm.compensate.program import Program, Target, numbers_of

LEAST_AHEAD, MOST_AHEAD = 8, 512  # poses that are solved together: more where it went well


@dataclass(frozen=True)
class Resolved:
    """Targets as the controller takes them: tips of those that are poses (of others anything), flange poses,
    joint angles q (T, n) NaN where none, refusals by target."""

    tips: Poses
    poses: Poses
    q: np.ndarray
    refusals: dict[int, str]
    guessed: tuple[int, ...]  # targets of several branches, of which nothing says which


def resolve(program: Program, model: CompensationModel, start: np.ndarray | None) -> Resolved:
    targets = program.targets
    count, n = len(targets), model.actual.axes
    tips = Poses(np.full((count, 3), np.nan), np.tile(np.eye(3), (count, 1, 1)))
    poses = Poses(tips.position.copy(), tips.rotation.copy())
    q, refusals = np.full((count, n), np.nan), {}
    joints = [i for i, target in enumerate(targets) if not target.is_pose]
    if joints:
        q[joints] = joints_of(program, joints)
        poses.set(joints, model.controller.poses(q[joints]))
    posed = [i for i, target in enumerate(targets) if target.is_pose and not target.refusal]
    if posed:
        tips.set(posed, tips_of(program, posed))
        flanges = flanges_of(program, posed, tips.rows(posed))
    flange_of = {i: k for k, i in enumerate(posed)}
    before, word, guessed, seen = start, "", [], set()
    ahead = _Ahead(program, model, flange_of, flanges) if posed else None
    for visit, i in enumerate(program.visits):
        target = targets[i]
        if target.refusal:
            refusals[i] = target.refusal
        elif not target.is_pose:
            before, word = q[i], ""
        elif i not in seen:
            seen.add(i)
            found = ahead.joints(visit, before, seen)
            if found is None or target.configuration or target.matches and not target.matches(found):
                flange = flanges.position[flange_of[i]], flanges.rotation[flange_of[i]]
                near = before if target.near is None else target.near
                found = _branch(model, target, flange, near, word, found)
                if near is None and target.matches is None and not isinstance(found, str) and (
                        len(model.controller.branches(*flange)) > 1):
                    guessed.append(i)
            if isinstance(found, str):
                refusals[i] = found
            else:
                q[i] = before = found
                word = target.configuration
        else:
            before = before if np.isnan(q[i, 0]) else q[i]
    met = list(seen)
    if met:
        poses.set(met, flanges.rows([flange_of[i] for i in met]))
    return Resolved(tips, Poses(np.nan_to_num(poses.position), poses.rotation), q, refusals, tuple(guessed))


def joints_of(program: Program, rows: Sequence[int]) -> np.ndarray:
    """Joint angles of targets that are such."""
    return program.notation.joints(numbers_of([program.targets[i] for i in rows]))


def tips_of(program: Program, rows: Sequence[int]) -> Poses:
    """Of targets that are poses, in their bases."""
    return program.notation.poses(numbers_of([program.targets[i] for i in rows]))


def flanges_of(program: Program, rows: Sequence[int], tips: Poses) -> Poses:
    """Where the controller puts the flange for targets that are poses."""
    targets = [program.targets[i] for i in rows]
    return flange_poses(tips, [t.base for t in targets], [t.tool for t in targets])


def _branch(
    model: CompensationModel, target: Target, flange: tuple[np.ndarray, np.ndarray],
    before: np.ndarray | None, word: str, followed: np.ndarray | None
) -> np.ndarray | str:
    """Joint angles of a pose, or why there are none; followed: those nearest to `before`, where they are
    known."""
    chain = model.controller
    if target.configuration and word and word != target.configuration:
        return (
            f"its configuration {target.configuration!r} differs from {word!r} of the pose before, and what "
            "the words mean "
            "for this arm is not certain: split the program there, and give --start for each part"
        )
    if target.configuration and before is None:
        return (
            "the branch of the arm is not certain: give the joint angles of the first pose with --start "
            "J1,J2,... (deg)"
        )
    if target.matches is None or before is not None:
        near = chain.nearest(*flange, before) if followed is None else followed
        if near is not None and (target.matches is None or target.matches(near)):
            return near
        if near is None:
            return "the pose is out of reach of the controller's own chain"
    branches = chain.branches(*flange)
    if not len(branches):
        return "the pose is out of reach of the controller's own chain, or of the joint limits"
    matching = np.array([q for q in branches if target.matches(q)])
    if not len(matching):
        return (
            "no branch of the arm has the configuration that the program names: is it this robot, this tool "
            "and this base?"
        )
    if before is not None:
        return matching[np.argmin(np.linalg.norm(matching - before, axis=1))]
    if np.ptp(matching, axis=0).max() > 1e-6:
        return (
            f"{len(matching)} branches of the arm have the configuration that the program names: give "
            "--start J1,J2,... (deg)"
        )
    return matching[0]


class _Ahead:
    """Poses that follow each other are solved together, each from the one before: as far as nothing but
    that decides on their branch."""

    def __init__(self, program: Program, model: CompensationModel, flange_of: dict[int, int], flanges: Poses):
        self.program, self.chain = program, model.controller
        self.flange_of, self.flanges = flange_of, flanges
        self.found: list[np.ndarray] = []  # of the visits from `begin` on
        self.begin, self.count, self.stopped = 0, LEAST_AHEAD, -1

    def joints(self, visit: int, before: np.ndarray | None, seen: set[int]) -> np.ndarray | None:
        """Of the pose at a visit, from `before`; None: not known so. seen: this one, and those before."""
        place = visit - self.begin
        if before is None or self.program.targets[self.program.visits[visit]].near is not None:
            return None
        if 0 < place < len(self.found) and self.found[place - 1] is before:
            return self.found[place]
        if visit == self.stopped:  # its neighbours do not tell it
            return None
        self.count = min(2 * self.count, MOST_AHEAD) if place == len(self.found) else LEAST_AHEAD
        rows = self.run(visit, seen)
        self.found = list(self.chain.followed(self.flanges.rows(rows), before))
        self.begin, self.stopped = visit, visit + len(self.found) if len(self.found) < len(rows) else -1
        return self.found[0] if self.found else None

    def run(self, visit: int, seen: set[int]) -> list[int]:
        """Rows of the flanges from a visit on, as long as poses come that were not met before."""
        rows: dict[int, int] = {}
        for i in self.program.visits[visit : visit + self.count]:
            if i not in self.flange_of or rows and (
                    i in seen or i in rows or self.program.targets[i].near is not None):
                break
            rows[i] = self.flange_of[i]
        return list(rows.values())
