"""Gyroscope g-sensitivity: the reading along the moving axis changes with the acceleration that the sensor feels.

change of gyro_z = k' f, f (3,) the specific force in the sensor's nominal axes, in units of g. Acceleration
other than gravity is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Iterable

import numpy as np

from exactarm.effects.base import Change, Effect, Parameter, Station


@dataclass(frozen=True)
class GyroGSensitivity(Effect):
    """Sensitivity of gyro_z to the three components."""

    name: ClassVar[str] = "gyro_g_sensitivity"
    station: ClassVar[Station] = Station.DEVICE
    kinds: ClassVar[tuple[str, ...]] = ("gear_run",)
    per_joint: ClassVar[bool] = False
    sentence: ClassVar[str] = "the gyroscope's reading follows gravity as the sensor turns in it"
    source: ClassVar[str] = "IEEE Std 1431: g-sensitive drift"

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"{axis}_rad_s_per_g", 2e-3, -1.0, 1.0) for axis in "xyz")

    def change(self, view) -> Change:
        force = view.signals["specific_force"]
        return Change((2,), (force @ np.array(self.values))[:, None], force[:, None, :])

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        return (cls(None, (0.0, 0.0, 0.0)),) if "specific_force" in view.signals else ()
