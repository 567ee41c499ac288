"""Gyroscope misalignment that is not constant: the mount slipped between two runs.

From run `first_run` on the reading is turned by R_x R_y R_z. A turn about the moving axis shows nothing:
where all axes that move are parallel, two of the three stand for any, and the one about the sensor's axis
next to them is held at zero. The constant tilt is part of the declared model (gyro_alignment).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import GEAR_RUN
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.gyro_alignment import slope_x, slope_y, slope_z
from exactarm.numerics.factors import svd
from exactarm.robot.mdh_frames import NEARLY_PARALLEL, rotation_x, rotation_y, rotation_z


@dataclass(frozen=True)
class GyroMisalignment(Effect):
    """values: number of the first run with the new tilt, turns about x, y and z; held: number from 0 of the
    one that is held."""

    search: tuple[float, ...] = ()
    held: int | None = None

    name = "gyro_misalignment"
    station = Station.DEVICE
    kinds = (GEAR_RUN.name,)
    per_joint = False
    sentence = (
        "from run {first_run:.0f} on the gyroscope is tilted by {about_x_rad:.3g}, {about_y_rad:.3g}, "
        "{about_z_rad:.3g} rad more")
    source = "IEEE Std 1431: misalignment"

    def parameters(self) -> tuple[Parameter, ...]:
        # The number of a run has no derivative: it is searched, then held.
        run = Parameter("first_run", 1.0, fixed=True, search=self.search)
        return (run, *(Parameter(f"about_{axis}_rad", 0.02, -0.5, 0.5, fixed=k == self.held)
                       for k, axis in enumerate("xyz")))

    def undecided(self, fitted, other):
        """Runs between the last fitted one before the slip and the first one after it."""
        before = fitted.run[fitted.run < self.values[0]]
        return (other.run > before.max()) & (other.run < self.values[0]) if before.size else None

    def searched_between(self, view):
        before = view.data.run[view.data.run < self.values[0]]
        return {"first_run": (float(before.max() + 1), self.values[0])} if before.size else {}

    def change(self, view) -> Change:
        run, x, y, z = self.values
        since = view.data.run >= run
        rate = view.measured * since[:, None]
        turn = rotation_x(x) @ rotation_y(y) @ rotation_z(z) - np.eye(3)
        derivative = np.zeros((view.rows, 3, 4))
        derivative[:, :, 1] = rate @ (slope_x(x) @ rotation_y(y) @ rotation_z(z)).T
        derivative[:, :, 2] = rate @ (rotation_x(x) @ slope_y(y) @ rotation_z(z)).T
        derivative[:, :, 3] = rate @ (rotation_x(x) @ rotation_y(y) @ slope_z(z)).T
        return Change((0, 1, 2), rate @ turn.T, derivative, {"measured": since[:, None, None] * turn})

    @classmethod
    def from_table(cls, table) -> Effect:
        return super().from_table({"about_z_rad": 0.0} | table)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        runs = np.unique(view.data.run)[1:]
        if view.data.gyro is None or runs.size == 0:
            return ()
        _, sizes, axes = svd(view.measured[view.keep], full_matrices=False)
        parallel = sizes[1] < np.sin(NEARLY_PARALLEL) * sizes[0]
        held = int(np.argmax(np.abs(axes[0]))) if parallel else None
        return (cls(None, (float(runs[0]), 0.0, 0.0, 0.0), tuple(map(float, runs)), held),)
