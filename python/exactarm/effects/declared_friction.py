"""Declared friction: Coulomb and viscous friction of an axis as its tables have them, re-identified.

torque = coulomb_Nm sign(rate) + viscous_Nm_s rate, output side, on the motor's side of the spring; both are 0
or above, for friction drives nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect


@dataclass(frozen=True)
class DeclaredFriction(DriveEffect):
    name = "declared_friction"
    declared = True
    reverses = True
    sentence = "axis {joint} has {coulomb_Nm:.3g} Nm of dry and {viscous_Nm_s:.3g} Nm s of viscous friction"
    parameter_table = (Parameter("coulomb_Nm", 10.0, lower=0.0), Parameter("viscous_Nm_s", 10.0, lower=0.0))

    @staticmethod
    def of(robot, index: int) -> DeclaredFriction:
        joint = robot.joints[index]
        return DeclaredFriction(index + 1, (joint.coulomb or 0.0, joint.viscous or 0.0))

    def parameter_label(self, parameter: Parameter) -> str:
        symbol, unit = parameter.name.split("_", 1)
        return f"{symbol}_{self.joint}_{unit}"

    def bake(self, robot):
        coulomb, viscous = self.values
        return robot.with_joint(self.index, coulomb=coulomb, viscous=viscous)

    def change(self, view) -> Change:
        rate = self.rate(view)
        derivative = np.stack([self.sign(view), rate], axis=1)[:, None, :]
        return Change((self.index,), np.zeros((view.rows, 1)), derivative)
