"""Torque constant: the torque that a drive reports is scaled, its motor's constant or current sensor being
off.

reported = (1 + scale) true drive torque.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.effects.base import Change, Parameter, Station
from exactarm.effects.drive import DriveEffect


@dataclass(frozen=True)
class TorqueConstant(DriveEffect):
    name = "torque_constant"
    plain = "a wrong torque constant"
    station = Station.DEVICE
    sentence = "the torque that axis {joint} reports is the true one times 1 + {scale:.3g}"
    source = "Gautier and Briot 2014 (drive gains)"
    parameter_table = (Parameter("scale", 0.1, -0.9, 5.0),)

    def change(self, view) -> Change:
        torque = view.measured[:, self.index]
        return self.torque_change(view, [torque], measured=np.full_like(torque, self.values[0]))
