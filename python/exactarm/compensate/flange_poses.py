"""Poses of the flange, what is missing from one to another, and the step of the joints that makes it up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from exactarm.numerics.rotation import turn
from exactarm.robot.robot import Placement

# m per rad: 1 mrad that nothing can reach counts as 1 um in the search, and moves the place by nanometres
PLACE_FIRST_M = 1e-3


@dataclass(frozen=True)
class Poses:
    """Poses of the flange in the controller's base frame: position (N, 3) m, rotation (N, 3, 3)."""

    position: np.ndarray
    rotation: np.ndarray

    def __len__(self) -> int:
        return len(self.position)

    def rows(self, index: np.ndarray | Sequence[int] | int) -> Poses:
        return Poses(self.position[index], self.rotation[index])

    def set(self, index: np.ndarray | Sequence[int], poses: Poses) -> None:
        self.position[index], self.rotation[index] = poses.position, poses.rotation


def stacked(placements: Sequence[Placement]) -> Poses:
    """Placements as arrays: those of a tool or a base are few, and of all targets."""
    kinds = dict(zip(map(id, placements), placements))
    if 2 * len(kinds) > len(placements):
        return Poses(np.array([p.position for p in placements]), np.array([p.rotation for p in placements]))
    place = {name: k for k, name in enumerate(kinds)}
    rows = np.fromiter(map(place.__getitem__, map(id, placements)), int)
    return stacked(list(kinds.values())).rows(rows)


def flange_poses(tips: Poses, bases: Sequence[Placement], tools: Sequence[Placement]) -> Poses:
    """base * tip * tool^-1: the flange, where the tip of each tool stands so in its base."""
    base, tool = stacked(bases), stacked(tools)
    rotation = base.rotation @ tips.rotation @ np.swapaxes(tool.rotation, -1, -2)
    tip = _turned(base.rotation, tips.position) + base.position
    return Poses(tip - _turned(rotation, tool.position), rotation)


def tip_poses(flanges: Poses, bases: Sequence[Placement], tools: Sequence[Placement]) -> Poses:
    """base^-1 * flange * tool: the inverse of `flange_poses`."""
    base, tool = stacked(bases), stacked(tools)
    back = np.swapaxes(base.rotation, -1, -2)
    tip = flanges.position + _turned(flanges.rotation, tool.position)
    return Poses(_turned(back, tip - base.position), back @ flanges.rotation @ tool.rotation)


def _turned(rotation: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    turned: np.ndarray = (rotation @ vectors[:, :, None])[:, :, 0]
    return turned


def pose_error(targets: Poses, reached: Poses) -> np.ndarray:
    """(N, 6): what is missing to the targets, m and rad (rotation vector in the base frame)."""
    turned = turn(targets.rotation @ np.swapaxes(reached.rotation, -1, -2))
    return np.concatenate([targets.position - reached.position, turned], axis=1)


def missing(error: np.ndarray, axes: int) -> np.ndarray:
    """(N,) how far `error` (N, 6) is from nothing, m or rad: all of it, or for an arm of fewer than six axes
    mainly the place."""
    size: np.ndarray = np.linalg.norm(_measure(axes) * error, axis=1)
    return size


def unreached(error: np.ndarray, axes: int) -> np.ndarray:
    """(N,) how far a pose is from being reached, m or rad; for fewer than six axes the place, m."""
    return missing(error, axes) if axes >= 6 else np.linalg.norm(error[:, :3], axis=1)


def _measure(axes: int) -> np.ndarray:
    """(6,) weights of place and orientation: fewer than six axes cannot make up both, and a SCARA whose axes
    lean by a milliradian is still to be where it was sent."""
    return np.repeat([1.0, PLACE_FIRST_M if axes < 6 else 1.0], 3)


def solved(jacobian: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """(N, n) steps of the joints that make up twists (N, 6), as by `pseudo_inverse`."""
    try:
        if jacobian.shape[2] == 6:
            return np.linalg.solve(jacobian, twist[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:  # one of them is singular to the last bit
        pass
    step: np.ndarray = (pseudo_inverse(jacobian) @ twist[:, :, None])[:, :, 0]
    return step


def pseudo_inverse(jacobian: np.ndarray) -> np.ndarray:
    """(N, n, 6) of Jacobians (N, 6, n): the least step for more axes than six, least squares for fewer, the
    place first (`_measure`).

    A singular one becomes infinite, never an exception.
    """
    n, turned = jacobian.shape[2], np.swapaxes(jacobian, -1, -2)
    try:
        if n == 6:
            return np.linalg.inv(jacobian)
        if n > 6:
            return turned @ np.linalg.inv(jacobian @ turned)
        square = _measure(n) ** 2
        least: np.ndarray = np.linalg.inv((turned * square) @ jacobian) @ (turned * square)
        return least
    except np.linalg.LinAlgError:  # one of them is singular to the last bit
        if len(jacobian) == 1:
            return np.full((1, n, 6), np.inf)
        return np.concatenate([pseudo_inverse(row[None]) for row in jacobian])
