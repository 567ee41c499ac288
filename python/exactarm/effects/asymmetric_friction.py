"""Asymmetric friction: an axis that rubs more in one direction than in the other.

torque = coulomb_Nm sign(rate)^2 + viscous_Nm_s |rate|: half the difference between the two directions, for
the constant and the viscous part (Armstrong-Helouvry et al. 1994, 2.2).
"""

from dataclasses import dataclass

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect, smooth_square


@dataclass(frozen=True)
class AsymmetricFriction(DriveEffect):
    name = "asymmetric_friction"
    plain = "friction that depends on the direction"
    sentence = ("friction of axis {joint} is larger in the positive direction than in the negative one by "
                "twice {coulomb_Nm:.3g} Nm and {viscous_Nm_s:.3g} Nm s")
    source = "Armstrong-Helouvry, Dupont and Canudas de Wit 1994"
    parameter_table = (Parameter("coulomb_Nm", 3.0), Parameter("viscous_Nm_s", 3.0))

    def change(self, view) -> Change:
        coulomb, viscous = self.values
        rate = self.rate(view)
        sign = self.sign(view)
        onset = smooth_square(rate, view.sign_width[self.index], view.swing[:, self.index])[1]
        moving = self.over_samples(view, lambda sign, rate: sign**2)
        magnitude = rate * sign  # |rate| without the kink
        slopes = self.slopes(view, by_sign=viscous * rate, by_rate=coulomb * onset + viscous * sign)
        return self.torque_change(view, [moving, magnitude], **slopes)
