"""The causes that a tracked motion can show beside those of static poses, with physics of their own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from blind import foreign_effects, pose_effects
from blind.hidden import Hidden, Setting


@dataclass(frozen=True)
class TimeDelay(Hidden):
    """The tracker stamps its readings `size` seconds too late: it shows where the arm was before."""

    name: str = "time_delay"
    measures = "delay_s"

    @classmethod
    def draw(cls, random, setting: Setting):
        return cls(size=1e-3)

    def gear(self, arm, phi, rows):
        return -self.size * rows.rate + 0.5 * self.size**2 * rows.acceleration


@dataclass(frozen=True)
class WindUp(Hidden):
    """Dry friction behind the gear (Dahl 1968): the lag follows the motion and settles within `reach` after a
    reversal."""

    name: str = "hysteresis"
    time: tuple = ()
    lag: tuple = ()

    @classmethod
    def draw(cls, random, setting: Setting):
        rows = setting.rows
        axis = int(random.integers(setting.arm.axes))
        reach = float(np.exp(random.uniform(np.log(3e-4), np.log(0.05))))
        angle = rows.command[:, axis] / setting.arm.motor_per_output[axis]
        lag, z = np.zeros(len(rows)), 0.0
        for k, dx in enumerate(np.diff(angle, prepend=angle[0])):
            if k and rows.visit[k] != rows.visit[k - 1]:
                z = 0.0
                continue
            # dz = (sign(dx) - z) |dx| / reach, exact over a step
            z = np.sign(dx) + (z - np.sign(dx)) * np.exp(-abs(dx) / reach)
            lag[k] = z
        return cls(joint=axis + 1, size=2e-4, time=tuple(rows.time), lag=tuple(lag), detail={"reach": reach})

    def spring(self, arm, q, torque, rows):
        return self.at_joint(-np.interp(rows.time, self.time, self.lag), arm.axes)


def _but(names: tuple[str, ...], pool: tuple) -> tuple:
    return tuple(kind for kind in pool if kind.__name__ not in names)


# An arm on springs would swing from fast gear errors; how, hangs on a damping that nobody declares.
SHAKING = ("GearHarmonics", "DirectionDependence")
TRACKED_EFFECTS = (TimeDelay, WindUp, *_but(("Hysteresis", "Outliers"), pose_effects.POSE_EFFECTS))
TRACKED_FOREIGN = foreign_effects.FOREIGN_EFFECTS
