"""Declared rotor: the inertia of a motor about its shaft as the tables have it, identified (thesis (2.22)).

torque = inertia ratio theta_ddot on the output side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect


@dataclass(frozen=True)
class DeclaredRotor(DriveEffect):
    name = "declared_rotor"
    declared = True
    inertia_of = "rotor"
    sentence = "the motor of axis {joint} has {inertia_kg_m2:.3g} kg m2 about its shaft"
    parameter_table = (Parameter("inertia_kg_m2", 1e-3, lower=0.0),)

    @staticmethod
    def of(robot, index: int) -> DeclaredRotor:
        return DeclaredRotor(index + 1, (robot.joints[index].rotor_inertia or 0.0,))

    def parameter_label(self, parameter: Parameter) -> str:
        return f"rotor_inertia_{self.joint}_kg_m2"

    def bake(self, robot):
        return robot.with_joint(self.index, rotor_inertia=self.values[0])

    def change(self, view) -> Change:
        ratio = view.robot.controller_ratios[self.index]
        column = ratio * view.signals["theta_ddot"][:, self.index]
        return Change((self.index,), np.zeros((view.rows, 1)), column[:, None, None])
