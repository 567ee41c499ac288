"""What an executed program does: a list of motions, each to a pose of the flange in the robot's base.

A pose is a (4, 4) matrix in m. `Arm` is the controller's own (nominal) arm: it turns joint angles into poses
and a pose into the joint angles on the branch of the ones before. `Unknown` is raised where the documentation
does not say what a controller does: there a program has to be refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from exactarm import _core


class Unknown(Exception):
    """The documentation does not tell what the controller does, or the interpreter does not know it."""


@dataclass(frozen=True)
class Motion:
    """kind: joint, line, circle (the point on the way too), spline. q: (n,) rad."""

    kind: str
    q: np.ndarray
    flange: np.ndarray
    tool: np.ndarray
    where: str
    load: tuple | None = None

    @property
    def tip(self) -> np.ndarray:
        return self.flange @ self.tool


class Arm:
    def __init__(self, core):
        self.core = core

    def pose(self, q) -> np.ndarray:
        position, rotation = _core.forward_kinematics(self.core, np.asarray(q, float)[None])
        return matrix(position[0], np.reshape(rotation[0], (3, 3)))

    def joints(self, flange, near) -> np.ndarray:
        q, report = _core.inverse_kinematics_path(self.core, flange[None, :3, 3],
                                                  np.ascontiguousarray(flange[:3, :3]).reshape(1, 9),
                                                  np.asarray(near, float))
        if report.status != _core.InverseKinematicsStatus.solved:
            raise Unknown("out of reach")
        return q[0]


@dataclass
class Run:
    """The arm while it executes: joint angles, tool and base of now, and the motions so far."""

    arm: Arm
    q: np.ndarray
    motions: list = field(default_factory=list)
    load: tuple | None = None

    def to_joints(self, kind, q, tool, where):
        self.q = np.asarray(q, float)
        self.motions.append(Motion(kind, self.q, self.arm.pose(self.q), tool, where, self.load))

    def to_pose(self, kind, base, pose, tool, where):
        """The pose is the tip's in the base."""
        flange = base @ pose @ np.linalg.inv(tool)
        self.q = self.arm.joints(flange, self.q)
        self.motions.append(Motion(kind, self.q, flange, tool, where, self.load))

    def tip(self, base, tool) -> np.ndarray:
        """Where the tip is now, in a base."""
        return np.linalg.inv(base) @ self.arm.pose(self.q) @ tool


def matrix(position, rotation=np.eye(3)) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return pose


def zyx(x, y, z, a, b, c) -> np.ndarray:
    """mm, deg: R = Rz(a) Ry(b) Rx(c)."""
    return matrix(1e-3 * np.array([x, y, z]), Rotation.from_euler("ZYX", [a, b, c], degrees=True).as_matrix())


def numbers_zyx(pose) -> list[float]:
    a, b, c = Rotation.from_matrix(pose[:3, :3]).as_euler("ZYX", degrees=True)
    return [*(1e3 * pose[:3, 3]), a, b, c]
