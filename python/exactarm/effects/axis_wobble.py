"""Axis wobble: an axis of rotation that leans as it turns (the tilt error motion of its bearing).

All beyond joint i turns by t about the origin of the frame that the joint stands on:

    t = (cos a, -sin a; sin a, cos a) (tilt_x, tilt_y)   across the axis, in that frame;  a = k psi

psi: angle of the joint about the frame's z. k = 0 leans with the link before the axis and k = 1 with the one
behind it: both are geometry. Rings of a bearing that are oval, by how they are bolted on, add k = 2 and -2 of
the outer ring, and k = -1 and 3 of the inner one, which turns with the arm. That it moves across itself, too,
is left out: beside a spring that passed for a base that gives way, where the library had none.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import POSES
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.moving_frames import MovingFrames, turn_slope, turned_about

_WAVES = (2.0, -1.0, -2.0, 3.0)
FEW_AXES = 2  # of a table a wobble, a sag and a run-out are one wave
_LEAST_RANGE_RAD = np.pi / 2.0  # on less, these waves are curves that any slow effect makes


@dataclass(frozen=True)
class AxisWobble(Effect):
    """values: waves per turn of the joint (k), and tilt across the axis, rad."""

    search: tuple[float, ...] = ()

    name = "axis_wobble"
    plain = "a bearing that wobbles"
    station = Station.GEOMETRY
    # not tracked motions: that of a flange took up what else was left there (blind case 96075)
    kinds = (POSES.name,)
    compensable = True
    source = "ISO 230-7:2015, tilt error motion of an axis of rotation"

    def parameters(self) -> tuple[Parameter, ...]:
        # Whole waves: their number is searched, then held.
        waves = Parameter("waves_per_rev", 1.0, fixed=True, search=self.search)
        return (waves, *(Parameter(f"tilt_{axis}_rad", 5e-5) for axis in "xy"))

    def describe(self) -> str:
        return (f"axis {self.joint} wobbles as it turns ({self.values[0]:+.0f} waves a turn): it leans by "
                f"{1e3 * np.hypot(*self.values[1:]):.3g} mrad")

    def change(self, view) -> Change:
        frames, index = MovingFrames.of(view), self.index
        sign, waves = view.robot.joints[index].sign, self.values[0]
        x, y = (frames.rotations[:, index, :, k] for k in (0, 1))
        angle = waves * sign * view.q[:, index]
        sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
        across = np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=2)  # (N, 3, 2)
        turned = waves * sign * np.stack([across[:, :, 1], -across[:, :, 0]], axis=2)  # by the joint's angle
        tilt, point = np.array(self.values[1:]), frames.origins[:, index]
        vector, slope = across @ tilt, frames.direction_by_q(across @ tilt, index - 1)
        slope[:, :, index] += turned @ tilt
        value, by_q = turned_about(view, vector, slope, point, frames.point_by_q(point, index - 1))
        by_parameters = np.zeros((view.rows, 6, 3))
        by_parameters[:, :, 1:] = turn_slope(view, across, point)
        return Change(tuple(range(6)), value, by_parameters, {"q": by_q})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        """Of every axis that turns far enough."""
        turns = view.moving & (np.ptp(view.q, axis=0) > _LEAST_RANGE_RAD) & (robot.axes > FEW_AXES)
        return (cls(int(index) + 1, (_WAVES[0], 0.0, 0.0), _WAVES)
                for index in np.flatnonzero(turns) if robot.joints[index].type == "revolute")
