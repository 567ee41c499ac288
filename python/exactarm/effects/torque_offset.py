"""Torque offset: the torque that a drive reports is off by a constant, its current sensor reading no zero at
zero current.

reported = true drive torque + offset_Nm, whatever the axis does: friction that differs with the direction
turns over at reversals and is nothing at rest (asymmetric_friction.py), a spring grows with the angle.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.effects.base import Change, Parameter, Station
from exactarm.effects.drive import DriveEffect


@dataclass(frozen=True)
class TorqueOffset(DriveEffect):
    name = "torque_offset"
    plain = "a torque sensor without its zero"
    station = Station.DEVICE
    sentence = "the torque that axis {joint} reports is off by {offset_Nm:.3g} Nm at all times"
    source = "Gautier and Briot 2014 (drive gains and offsets)"
    parameter_table = (Parameter("offset_Nm", 3.0),)

    def change(self, view) -> Change:
        return self.torque_change(view, [np.ones(view.rows)])
