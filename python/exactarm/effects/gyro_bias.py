"""Gyroscope bias: a constant rate that the sensor reads at rest, per axis of the sensor."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import GEAR_RUN
from exactarm.effects.base import Change, Effect, Parameter, Station

# A prior: a small sensor's bias before calibration stays below 1 deg/s. Runs at one speed each do not part it
# from the alignment, and a bias a hundred times as large would fit them as well.
_LIKELY_RAD_S = 0.01


@dataclass(frozen=True)
class GyroBias(Effect):
    name = "gyro_bias"
    station = Station.DEVICE
    kinds = (GEAR_RUN.name,)
    per_joint = False
    sentence = "the gyroscope reads {z_rad_s:.3g} rad/s at rest along the moving axis"
    source = "IEEE Std 1431: bias"
    parameter_table = tuple(
        Parameter(f"{axis}_rad_s", 2e-3, -1.0, 1.0, prior=_LIKELY_RAD_S) for axis in "xyz")

    def change(self, view) -> Change:
        value = np.broadcast_to(np.array(self.values), (view.rows, 3)).copy()
        return Change((0, 1, 2), value, np.broadcast_to(np.eye(3), (view.rows, 3, 3)).copy())

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        return (cls(None, (0.0, 0.0, 0.0)),) if view.data.gyro is not None else ()
