"""What a rigid chain can carry of an identified arm: its axes where the controller reports zero, and the
flange.

    p = exp(u_1 q_1) ... exp(u_n q_n) M      q: as the controller reports (where it couples axes: of the axes
                                             themselves), u: the identified axes, M: the flange at q = 0

In the controller's base frame. Gear harmonics, other gear ratios, springs and effects have no place in it:
`lost` says what that costs, `not_carried` names them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.compensate.flange_poses import Poses
from exactarm.compensate.law import CompensationModel
from exactarm.errors import InputError
from exactarm.numerics.rotation import exp
from exactarm.robot.mdh_frames import behind_axis, compose, rotation_z
from exactarm.robot.robot import Placement, Robot
from exactarm.robot.urdf import reported_shift

POSES, SEED = 300, 1


@dataclass(frozen=True)
class ReportedChain:
    """starts: the frame of each axis at zero (its z, times sign, is the axis); end: the flange; kinds: as in
    `Joint.type`."""

    starts: tuple[Placement, ...]
    end: Placement
    signs: tuple[float, ...]
    kinds: tuple[str, ...]

    def directions(self) -> np.ndarray:
        """(n, 3) unit vectors about (along) which the axes turn (slide) to positive q."""
        return np.array([sign * start.rotation[:, 2] for sign, start in zip(self.signs, self.starts)])

    def poses(self, q: np.ndarray) -> Poses:
        """Of the flange at q (N, n)."""
        position, rotation = (
            np.tile(self.end.position, (len(q), 1)),
            np.tile(self.end.rotation, (len(q), 1, 1)),
        )
        axes = list(zip(self.starts, self.directions(), self.kinds))
        for i in range(len(axes) - 1, -1, -1):
            start, direction, kind = axes[i]
            if kind == "prismatic":
                position = position + q[:, i : i + 1] * direction
                continue
            turn = exp(q[:, i : i + 1] * direction)
            position = (turn @ (position - start.position)[:, :, None])[:, :, 0] + start.position
            rotation = turn @ rotation
        return Poses(position, rotation)


@dataclass(frozen=True)
class Lost:
    """Distance (m) of the flange by the exported chain from that of the whole model, over the work space."""

    mean: float
    largest: float


def reported_chain(robot: Robot) -> ReportedChain:
    """The identified chain between the controller's base and flange."""
    if not robot.has_geometry:
        raise InputError(f"robot {robot.name} declares no geometry; expected one to export", file=robot.file)
    place, starts = robot.controller.base, []
    for index, joint in enumerate(robot.joints):
        shift = joint.sign * reported_shift(robot, index)
        sliding = joint.type == "prismatic"
        start = Placement(
            rotation_z(joint.zero + (0.0 if sliding else shift)),
            np.array([0.0, 0.0, shift if sliding else 0.0]),
        )
        starts.append(compose(place, start))
        place = compose(starts[-1], behind_axis(joint))
    signs, kinds = (tuple(getattr(joint, name) for joint in robot.joints) for name in ("sign", "type"))
    return ReportedChain(tuple(starts), compose(place, robot.controller.flange), signs, kinds)


def lost(robot: Robot, poses) -> Lost:
    """poses: q (N, n) -> Poses of the exported file. Both gear directions' mean, gravity of the declared
    masses."""
    model = CompensationModel.of(robot.with_controller_frames)
    low, high = np.clip(model.controller.limits, -np.pi, np.pi)
    q = np.random.default_rng(SEED).uniform(low, high, (POSES, robot.axes))
    distance = np.linalg.norm(poses(q).position - model.reached(q).position, axis=1)
    return Lost(float(distance.mean()), float(distance.max()))


def not_carried(robot: Robot) -> list[str]:
    """Names of what no rigid chain has a place for."""
    parts = [f"coupling of axes: {coupled}"] if (coupled := robot.controller.coupling_in_words) else []
    parts += [
        f"gear harmonics of axis {i}" for i, joint in enumerate(robot.joints, start=1) if joint.has_harmonics
    ]
    parts += [f"spring of axis {i}" for i, joint in enumerate(robot.joints, start=1) if joint.spring_linear]
    ratios = zip(robot.ratios, robot.controller_ratios)
    parts += [
        f"gear ratio of axis {i} other than the controller's"
        for i, (a, b) in enumerate(ratios, start=1)
        if a != b
    ]
    return parts + [effect.label for effect in robot.effects if not effect.record]
