"""The frames of the arm in the measuring frame, and how points and directions on it move with the joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class MovingFrames:
    """origins (N, n + 1, 3) m and rotations (N, n + 1, 3, 3) of base and frames, axes (N, n, 3) of the joints
    in the sense of their angles, base (N, 3, 3): the rotation of the robot's base; all in the measuring
    frame. revolute (n,): which joints turn."""

    origins: np.ndarray
    rotations: np.ndarray
    axes: np.ndarray
    base: np.ndarray
    revolute: tuple[bool, ...]

    @staticmethod
    def of(view) -> MovingFrames:
        """Of every row of `view`, whose frames of the base are known."""
        base = view.signals["base_rotation"].reshape(view.rows, 3, 3)
        origins, rotations = view.frames()
        origins = np.einsum("nij,nkj->nki", base, origins) + view.signals["base_position"][:, None, :]
        rotations = base[:, None] @ rotations
        axes = np.stack([joint.sign * rotations[:, k, :, 2] for k, joint in enumerate(view.robot.joints)],
                        axis=1)
        return MovingFrames(origins, rotations, axes, base,
                            tuple(joint.type == "revolute" for joint in view.robot.joints))

    def point_by_q(self, point: np.ndarray, last: int) -> np.ndarray:
        """(N, 3, n) derivative of a point (N, 3) that joints 0..last move."""
        by_q = np.zeros((*point.shape, self.axes.shape[1]))
        for k in range(last + 1):
            by_q[:, :, k] = (np.cross(self.axes[:, k], point - self.origins[:, k]) if self.revolute[k]
                             else self.axes[:, k])
        return by_q

    def direction_by_q(self, direction: np.ndarray, last: int) -> np.ndarray:
        """(N, 3, n) derivative of a direction (N, 3) that joints 0..last turn."""
        by_q = np.zeros((*direction.shape, self.axes.shape[1]))
        for k in range(last + 1):
            if self.revolute[k]:
                by_q[:, :, k] = np.cross(self.axes[:, k], direction)
        return by_q


def turned_about(view, rotation: np.ndarray, rotation_by_q: np.ndarray, point: np.ndarray,
                 point_by_q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (N, 6) of the target when all beyond `point` (N, 3) turns by the small `rotation` (N, 3)
    about it, and its derivative (N, 6, n) by q; without the identification Jacobian the target counts as
    fixed in it."""
    arm, arm_by_q = view.signals["target"] - point, -point_by_q
    target_by_q = view.target_by("q")
    if target_by_q is not None:
        arm_by_q = target_by_q[:, :3] + arm_by_q
    value = turn_slope(view, rotation[:, :, None], point)[:, :, 0]
    turned = (np.cross(rotation_by_q, arm[:, :, None], axis=1)
              + np.cross(rotation[:, :, None], arm_by_q, axis=1))
    return value, np.concatenate([turned, rotation_by_q], axis=1)


def turn_slope(view, rotation: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(N, 6, k) displacement of the target by small rotations (N, 3, k) about `point` (N, 3)."""
    arm = view.signals["target"] - point
    return np.concatenate([np.cross(rotation, arm[:, :, None], axis=1), rotation], axis=1)
