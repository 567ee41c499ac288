"""Rotor inertia: what the motor's own acceleration takes, J ratio theta_ddot on the output side (thesis
(2.22)).

inertia_kg_m2 is about the motor shaft, beside what the tables declare.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect


@dataclass(frozen=True)
class RotorInertia(DriveEffect):
    name = "rotor_inertia"
    plain = "a rotor inertia that is not declared"
    sentence = "the motor of axis {joint} has {inertia_kg_m2:.3g} kg m2 more inertia than declared"
    source = "thesis (2.22), E4"
    parameter_table = (Parameter("inertia_kg_m2", 5e-4),)

    def possible(self, robot, deviation) -> bool:
        return (robot.joints[self.index].rotor_inertia or 0.0) + self.values[0] >= 0.0

    def change(self, view) -> Change:
        ratio = view.robot.controller_ratios[self.index]
        acceleration = view.signals["theta_ddot"][:, self.index]
        slope = np.full(view.rows, self.values[0] * ratio)
        return self.torque_change(view, [ratio * acceleration], theta_ddot=slope)
