"""Gyroscope misalignment that is not constant: the mount slipped between two runs.

From run `first_run` on the reading is turned by a small rotation vector (x, y; a turn about z shows nothing
while z is the moving axis). The constant tilt is part of the declared model (gyro_alignment).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import GEAR_RUN
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.gyro_alignment import slope_x, slope_y
from exactarm.robot.mdh_frames import rotation_x, rotation_y


@dataclass(frozen=True)
class GyroMisalignment(Effect):
    """values: number of the first run with the new tilt, tilts about x and y."""

    search: tuple[float, ...] = ()

    name = "gyro_misalignment"
    station = Station.DEVICE
    kinds = (GEAR_RUN.name,)
    per_joint = False
    sentence = (
        "from run {first_run:.0f} on the gyroscope is tilted by {about_x_rad:.3g}, {about_y_rad:.3g} rad "
        "more")
    source = "IEEE Std 1431: misalignment"

    def parameters(self) -> tuple[Parameter, ...]:
        # The number of a run has no derivative: it is searched, then held.
        run = Parameter("first_run", 1.0, fixed=True, search=self.search)
        return (run, Parameter("about_x_rad", 0.02, -0.5, 0.5), Parameter("about_y_rad", 0.02, -0.5, 0.5))

    def change(self, view) -> Change:
        run, x, y = self.values
        since = view.data.run >= run
        rate = view.measured * since[:, None]
        turn = rotation_x(x) @ rotation_y(y) - np.eye(3)
        derivative = np.zeros((view.rows, 3, 3))
        derivative[:, :, 1] = rate @ (slope_x(x) @ rotation_y(y)).T
        derivative[:, :, 2] = rate @ (rotation_x(x) @ slope_y(y)).T
        return Change((0, 1, 2), rate @ turn.T, derivative, {"measured": since[:, None, None] * turn})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        runs = np.unique(view.data.run)[1:]
        if view.data.gyro is None or runs.size == 0:
            return ()
        return (cls(None, (float(runs[0]), 0.0, 0.0), tuple(float(run) for run in runs)),)
