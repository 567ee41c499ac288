"""Stribeck friction: friction above Coulomb at low rates that the lubricant film takes away as it builds up.

torque = breakaway_Nm sign(rate) exp(-(rate / velocity_rad_s)^2) (Stribeck 1902; Bo and Pavelescu 1982).
"""

from dataclasses import dataclass

import numpy as np

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect


@dataclass(frozen=True)
class StribeckFriction(DriveEffect):
    name = "stribeck_friction"
    plain = "friction that falls at low speed"
    sentence = ("axis {joint} has {breakaway_Nm:.3g} Nm more friction near standstill, gone above "
                "{velocity_rad_s:.3g} rad/s")
    source = "Stribeck 1902; Bo and Pavelescu 1982; Armstrong-Helouvry et al. 1994"
    parameter_table = (Parameter("breakaway_Nm", 10.0, lower=0.0),
                       Parameter("velocity_rad_s", 0.3, 0.01, 5.0, search=(0.03, 0.06, 0.1, 0.2, 0.4, 0.8)))

    def change(self, view) -> Change:
        breakaway, velocity = self.values
        rate = self.rate(view)
        sign = self.sign(view)
        fade = np.exp(-((rate / velocity) ** 2))
        low = self.over_samples(view, lambda sign, rate: sign * np.exp(-((rate / velocity) ** 2)))
        falls = self.over_samples(view, lambda sign, rate: sign * rate**2 * np.exp(-((rate / velocity) ** 2)))
        by_velocity = breakaway * 2.0 * falls / velocity**3
        by_rate = -breakaway * fade * sign * 2.0 * rate / velocity**2
        derivative = np.stack([low, by_velocity], axis=1)[:, None, :]
        by_signal = self.by_signal(view, **self.slopes(view, breakaway * fade, by_rate))
        return Change((self.index,), breakaway * low[:, None], derivative, by_signal)

    @classmethod
    def candidates(cls, robot, view):
        return (effect.with_values((0.0, 0.2)) for effect in super().candidates(robot, view))
