"""Causes that no library of drives, springs and devices has; the honest answer to them is `unexplained`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from blind.hidden import Hidden, Setting
from blind.pose_effects import pick


@dataclass(frozen=True)
class Foreign(Hidden):
    foreign = True


@dataclass(frozen=True)
class WorkspaceBump(Foreign):
    """Something pushes the arm aside in one corner of its workspace."""

    name: str = "workspace_bump"
    centre: tuple = ()
    reach: float = 0.4
    way: tuple = ()

    @classmethod
    def draw(cls, random, setting: Setting):
        points = setting.at.flange
        spread = float(np.sqrt(np.trace(np.cov(points.T)) / 3.0))
        way = random.normal(size=3)
        centre = points[random.integers(len(points))]
        return cls(size=1e-3, centre=tuple(centre), reach=random.uniform(0.5, 1.0) * spread,
                   way=tuple(way / np.linalg.norm(way)))

    def structure(self, arm, at, target, rows):
        far = np.sum((target - np.array(self.centre)) ** 2, axis=1) / self.reach**2
        return self.size * np.exp(-0.5 * far)[:, None] * np.array(self.way), np.zeros_like(target)


@dataclass(frozen=True)
class CableForce(Foreign):
    """A cable bundle pulls at one axis as two axes of the wrist wind it up together."""

    name: str = "cable_force"

    @classmethod
    def draw(cls, random, setting: Setting):
        return cls(joint=pick(random, range(2, setting.arm.axes)), size=1e-4)

    def spring(self, arm, q, torque, rows):
        return self.at_joint(q[:, -1] * q[:, -2], arm.axes)


@dataclass(frozen=True)
class Refraction(Foreign):
    """The beam bends in a temperature gradient: the error grows with the square of the distance."""

    name: str = "refraction"
    way: tuple = ()

    @classmethod
    def draw(cls, random, setting: Setting):
        way = random.normal(size=3)
        return cls(size=1e-4, way=tuple(way / np.linalg.norm(way)))

    def device(self, measured, rows):
        return self.size * np.sum(measured**2, axis=1, keepdims=True) * np.array(self.way)


@dataclass(frozen=True)
class CrossedAngle(Foreign):
    """One axis is off by a wave of another axis' angle."""

    name: str = "crossed_angle"
    other: int = 1
    order: float = 2.0
    phase: float = 0.0

    @classmethod
    def draw(cls, random, setting: Setting):
        joint, other = (int(v) + 1 for v in random.permutation(setting.arm.axes)[:2])
        return cls(joint=joint, other=other, size=3e-4, order=float(random.integers(2, 5)),
                   phase=random.uniform(0, 6.28),
                   detail={"other": other})

    def spring(self, arm, q, torque, rows):
        return self.at_joint(np.sin(self.order * q[:, self.other - 1] + self.phase), arm.axes)


FOREIGN_EFFECTS = (WorkspaceBump, CableForce, Refraction, CrossedAngle)
