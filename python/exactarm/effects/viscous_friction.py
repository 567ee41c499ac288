"""Viscous friction of a drive: coefficient_Nm_s rate, of the lubricant in gear and bearings (Newton)."""

from dataclasses import dataclass

import numpy as np

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect


@dataclass(frozen=True)
class ViscousFriction(DriveEffect):
    name = "viscous_friction"
    unless_declared = "viscous"
    plain = "viscous friction that is not declared"
    sentence = "axis {joint} has {coefficient_Nm_s:.3g} Nm s of viscous friction that is not declared"
    source = "Armstrong-Helouvry, Dupont and Canudas de Wit 1994; thesis (2.22)"
    parameter_table = (Parameter("coefficient_Nm_s", 10.0, lower=0.0),)

    def change(self, view) -> Change:
        rate = self.rate(view)
        return self.torque_change(view, [rate], rate=np.full_like(rate, self.values[0]))
