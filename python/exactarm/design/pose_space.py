"""Pose space: the joint angles that a measurement may use: joint limits and a box for flange and target.

Angles are those that the controller reports, q (N, n) in rad (m for a sliding axis); the box is in the
controller's base frame, in m. A small part of each axis' range next to its limits is left free: controllers
refuse poses that touch a limit. Hand and target keep a clearance from the base column and the upper arm
(exactarm.design.self_collision); obstacles and cables are not known here.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from exactarm import _core
from exactarm.design.line_of_sight import Station
from exactarm.design.self_collision import default_clearance, is_clear
from exactarm.errors import ComputationError, InputError
from exactarm.robot.controller_frames import at_base
from exactarm.robot.robot import Robot

_MARGIN = 0.005  # of the range, at either end
_LEAST_SHARE = 1e-3  # of the random poses that must lie inside the box
_BATCH = 2000


@dataclass(frozen=True)
class Box:
    """lower (3,) and upper (3,) corner in the controller's base frame, m. Default: above the floor."""

    lower: np.ndarray = field(default_factory=lambda: np.array([-np.inf, -np.inf, 0.0]))
    upper: np.ndarray = field(default_factory=lambda: np.full(3, np.inf))


@dataclass(frozen=True)
class PoseSpace:
    """Limits lower, upper (n,) of the joint angles (margin taken off), box, and clearance from the arm's body
    in m.

    assumed: axes (from 1) without declared limits; station: of a tracker that has to see the target.
    """

    robot: Robot
    box: Box
    lower: np.ndarray
    upper: np.ndarray
    clearance: float
    assumed: tuple[int, ...] = ()
    station: Station | None = None

    @staticmethod
    def of(robot: Robot, box: Box = Box(), clearance: float | None = None,
           station: Station | None = None) -> PoseSpace:
        """A revolute axis without limits gets half a turn either way; a sliding one must declare them."""
        bounds, assumed = [], []
        for number, joint in enumerate(robot.joints, 1):
            if joint.q_min is None or joint.q_max is None:
                if joint.type == "prismatic":
                    raise InputError(f"robot {robot.name}: axis {number} slides and needs q_min_m and "
                                     "q_max_m", file=robot.file)
                assumed.append(number)
            bounds.append((-np.pi if joint.q_min is None else joint.q_min,
                           np.pi if joint.q_max is None else joint.q_max))
        lower, upper = np.array(bounds).T
        margin = _MARGIN * (upper - lower)
        keep = default_clearance(robot) if clearance is None else clearance
        return PoseSpace(at_base(robot), box, lower + margin, upper - margin, keep, tuple(assumed), station)

    def target(self, q: np.ndarray) -> np.ndarray:
        """(N, 3) nominal position of the target in the controller's base frame."""
        return _core.forward_kinematics(self.robot.core, self._joint_angles(q))[0]

    def allowed(self, q: np.ndarray) -> np.ndarray:
        """(N,) bool: within the limits, target and flange inside the box and clear of the arm."""
        angles = self._joint_angles(q)
        target, rotation = _core.forward_kinematics(self.robot.core, angles)
        last = rotation @ self.robot.tool.rotation.T  # DH frame n
        mounted = self.robot.controller.flange
        flange = target + last @ (mounted.position - self.robot.tool.position)
        inside = np.all((q >= self.lower) & (q <= self.upper), axis=1)
        for points in (target, flange):
            inside &= np.all((points >= self.box.lower) & (points <= self.box.upper), axis=1)
        inside[inside] = is_clear(self.robot.core, angles[inside], (target[inside], flange[inside]),
                                  self.clearance)
        if self.station is not None:
            inside[inside] = self.station.sees(self.robot.core, angles[inside], target[inside],
                                               last[inside] @ mounted.rotation, self.clearance)
        return inside

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """(count, n) poses, evenly distributed over the allowed joint angles. Raises ComputationError if
        hardly any are."""
        found, drawn = [np.zeros((0, len(self.lower)))], 0
        while sum(map(len, found)) < count:
            q = self.lower + (self.upper - self.lower) * rng.random((max(_BATCH, count), len(self.lower)))
            found.append(q[self.allowed(q)])
            drawn += len(q)
            if sum(map(len, found)) < _LEAST_SHARE * drawn:
                raise ComputationError(
                    "fewer than one in a thousand poses within the joint limits is allowed: "
                    "the box is beyond the reach or too small, the clearance is too large, or the station "
                    "sees hardly any")
        return np.concatenate(found)[:count]

    def _joint_angles(self, q: np.ndarray) -> np.ndarray:
        """What the arm really turns to when the controller reports q (without gear ripple and deflection)."""
        theta = (q - self.robot.controller_offsets) * self.robot.controller_ratios
        return theta / self.robot.ratios + self.robot.offsets
