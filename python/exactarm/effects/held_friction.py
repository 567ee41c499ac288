"""Held friction: what the dry friction of an axis that stands still carries of its load, so that its drive
does not. Any torque below breakaway, constant as long as the gear does not slide.

reported = true drive torque + held_Nm. Estimated of axes that never move, and no part of any robot file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from exactarm.effects.base import Change, Parameter, Station
from exactarm.effects.drive import DriveEffect


@dataclass(frozen=True)
class HeldFriction(DriveEffect):
    name: ClassVar[str] = "held_friction"
    declared: ClassVar[bool] = True
    station: ClassVar[Station] = Station.DEVICE
    sentence: ClassVar[str] = "dry friction of axis {joint}, which stands still, holds {held_Nm:.3g} Nm"
    parameter_table = (Parameter("held_Nm", 10.0),)

    @staticmethod
    def of(robot, index: int) -> HeldFriction:
        return HeldFriction(index + 1, (0.0,))

    def from_tables(self, robot) -> HeldFriction:
        return self

    def parameter_label(self, parameter: Parameter) -> str:
        return f"held_{self.joint}_Nm"

    def change(self, view) -> Change:
        column = np.ones((view.rows, 1, 1))
        return Change((self.index,), self.values[0] * column[:, :, 0], column)
