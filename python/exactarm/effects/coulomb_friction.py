"""Coulomb friction of a drive: torque_Nm sign(rate), constant in size and against the motion (Coulomb
1785)."""

from dataclasses import dataclass

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect


@dataclass(frozen=True)
class CoulombFriction(DriveEffect):
    name = "coulomb_friction"
    unless_declared = "coulomb"
    plain = "dry friction that is not declared"
    sentence = "axis {joint} has {torque_Nm:.3g} Nm of dry friction that is not declared"
    source = "Armstrong-Helouvry, Dupont and Canudas de Wit 1994; thesis (2.22)"
    parameter_table = (Parameter("torque_Nm", 10.0, lower=0.0),)

    def change(self, view) -> Change:
        return self.torque_change(view, [self.sign(view)], **self.slopes(view, by_sign=self.values[0]))
