"""Poses of the flange, what is missing from one to another, and the step of the joints that makes it up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.rotation import log as rotation_log


@dataclass(frozen=True)
class Poses:
    """Poses of the flange in the controller's base frame: position (N, 3) m, rotation (N, 3, 3)."""

    position: np.ndarray
    rotation: np.ndarray

    def __len__(self) -> int:
        return len(self.position)

    def rows(self, index: np.ndarray) -> Poses:
        return Poses(self.position[index], self.rotation[index])


def pose_error(targets: Poses, reached: Poses) -> np.ndarray:
    """(N, 6): what is missing to the targets, m and rad (rotation vector in the base frame)."""
    turn = rotation_log(targets.rotation @ np.swapaxes(reached.rotation, -1, -2))
    return np.concatenate([targets.position - reached.position, turn], axis=1)


def pseudo_inverse(jacobian: np.ndarray) -> np.ndarray:
    """(N, n, 6) of Jacobians (N, 6, n): the least step for more axes than six, least squares for fewer.

    A singular one becomes infinite, never an exception.
    """
    n, turned = jacobian.shape[2], np.swapaxes(jacobian, -1, -2)
    try:
        if n == 6:
            return np.linalg.inv(jacobian)
        return (
            turned @ np.linalg.inv(jacobian @ turned) if n > 6 else np.linalg.inv(turned @ jacobian) @ turned
        )
    except np.linalg.LinAlgError:  # one of them is singular to the last bit
        if len(jacobian) == 1:
            return np.full((1, n, 6), np.inf)
        return np.concatenate([pseudo_inverse(row[None]) for row in jacobian])
