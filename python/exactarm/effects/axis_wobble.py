"""Axis wobble: an axis of rotation that leans and wanders as it turns (the error motion of its bearing).

All beyond joint i turns by t about the origin of the frame that the joint stands on, and moves by r:

    t, r = E(k psi) (tilt_x, tilt_y), E(k psi) (radial_x, radial_y)   across the axis, in that frame
    E(a) = (cos a, -sin a; sin a, cos a),   psi: angle of the joint about the frame's z

k = 0 leans with the link before the axis and k = 1 with the one behind it: both are geometry. Rings of a
bearing that are oval, by how they are bolted on, add k = 2 and -2 of the outer ring, and k = -1 and 3 of the
inner one, which turns with the arm.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import POSES
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.moving_frames import MovingFrames, turn_slope, turned_about

_WAVES = (2.0, -1.0, -2.0, 3.0)
_LEAST_RANGE_RAD = np.pi / 2.0  # on less, these waves are curves that any slow effect makes


@dataclass(frozen=True)
class AxisWobble(Effect):
    """values: waves per turn of the joint (k), tilt across the axis, rad, and motion across it, m."""

    search: tuple[float, ...] = ()

    name = "axis_wobble"
    plain = "a bearing that wobbles"
    station = Station.GEOMETRY
    # not tracked motions: that of a flange took up what else was left there (blind case 96075)
    kinds = (POSES.name,)
    compensable = True
    source = "ISO 230-7:2015, tilt and radial error motions of an axis of rotation"

    def parameters(self) -> tuple[Parameter, ...]:
        # Whole waves: their number is searched, then held.
        waves = Parameter("waves_per_rev", 1.0, fixed=True, search=self.search)
        return (waves, *(Parameter(f"tilt_{axis}_rad", 5e-5) for axis in "xy"),
                *(Parameter(f"radial_{axis}_m", 2e-5) for axis in "xy"))

    def describe(self) -> str:
        tilt, radial = np.hypot(*self.values[1:3]), np.hypot(*self.values[3:])
        return (f"axis {self.joint} wobbles as it turns ({self.values[0]:+.0f} waves a turn): it leans by "
                f"{1e3 * tilt:.3g} mrad and moves by {1e6 * radial:.0f} µm across itself")

    def change(self, view) -> Change:
        frames, index = MovingFrames.of(view), self.index
        sign, waves = view.robot.joints[index].sign, self.values[0]
        x, y = (frames.rotations[:, index, :, k] for k in (0, 1))
        angle = waves * sign * view.q[:, index]
        sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
        across = np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=2)  # (N, 3, 2)
        turned = waves * sign * np.stack([across[:, :, 1], -across[:, :, 0]], axis=2)  # by the joint's angle
        tilt, radial = np.array(self.values[1:3]), np.array(self.values[3:])
        point = frames.origins[:, index]

        def with_slope(size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            vector = across @ size
            slope = frames.direction_by_q(vector, index - 1)
            slope[:, :, index] += turned @ size
            return vector, slope

        moved, moved_by_q = with_slope(radial)
        value, by_q = turned_about(view, *with_slope(tilt), point, frames.point_by_q(point, index - 1))
        value[:, :3] += moved
        by_q[:, :3] += moved_by_q
        by_parameters = np.zeros((view.rows, 6, 5))
        by_parameters[:, :, 1:3] = turn_slope(view, across, point)
        by_parameters[:, :3, 3:] = across
        return Change(tuple(range(6)), value, by_parameters, {"q": by_q})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        """Of every axis that turns far enough."""
        turns = view.moving & (np.ptp(view.q, axis=0) > _LEAST_RANGE_RAD)
        return (cls(int(index) + 1, (_WAVES[0], 0.0, 0.0, 0.0, 0.0), _WAVES)
                for index in np.flatnonzero(turns) if robot.joints[index].type == "revolute")
