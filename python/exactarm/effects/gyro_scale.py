"""Gyroscope scale: the sensor's sensitivity is off, measured = (1 + scale) rate, the same on all its axes."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import GEAR_RUN
from exactarm.effects.base import Change, Effect, Parameter, Station


@dataclass(frozen=True)
class GyroScale(Effect):
    name = "gyro_scale"
    station = Station.DEVICE
    kinds = (GEAR_RUN.name,)
    per_joint = False
    sentence = "the gyroscope reads 1 + {scale:.3g} times the rate"
    source = "IEEE Std 1431: scale factor error"
    parameter_table = (Parameter("scale", 5e-3, -0.2, 0.2),)

    def change(self, view) -> Change:
        reading = view.measured
        by_measured = np.broadcast_to(self.values[0] * np.eye(3), (view.rows, 3, 3))
        return Change((0, 1, 2), self.values[0] * reading, reading[:, :, None].copy(),
                      {"measured": by_measured})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        return (cls(None, (0.0,)),) if view.data.gyro is not None else ()
