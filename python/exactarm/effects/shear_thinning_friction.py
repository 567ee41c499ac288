"""Shear-thinning friction: viscous friction that grows less than in proportion to the rate.

torque = coefficient (rate^2 + v0^2)^(-1/4) rate, about coefficient sqrt(|rate|) sign(rate): grease thins as
it is sheared (power-law fluid with exponent 1/2; Reiner 1926; for robot gears Simoni et al. 2015). Smooth at
rest.
"""

from dataclasses import dataclass

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect
from exactarm.view import SIGN_WIDTH_RAD_S


@dataclass(frozen=True)
class ShearThinningFriction(DriveEffect):
    name = "shear_thinning_friction"
    plain = "friction of a lubricant that thins with speed"
    in_axis_units = False  # of a root of a rate
    sentence = ("friction of axis {joint} bends over with the rate as grease does: "
                "{coefficient_Nm_sqrt_s:.3g} Nm times the square root of the rate in rad/s")
    source = "Reiner 1926; Simoni, Beschi, Legnani and Visioli 2015"
    parameter_table = (Parameter("coefficient_Nm_sqrt_s", 10.0, lower=0.0),)

    def change(self, view) -> Change:
        rate = self.rate(view)
        square = rate**2 + SIGN_WIDTH_RAD_S**2
        by_rate = square**-0.25 - 0.5 * rate**2 * square**-1.25
        return self.torque_change(view, [square**-0.25 * rate], rate=self.values[0] * by_rate)
