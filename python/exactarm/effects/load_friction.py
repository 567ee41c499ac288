"""Load friction: friction of a gear that grows with the torque that it transmits.

torque = coefficient |joint torque| sign(rate) (Hamon, Gautier and Garrec 2010).
"""

from dataclasses import dataclass

import numpy as np

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect


@dataclass(frozen=True)
class LoadFriction(DriveEffect):
    name = "load_friction"
    plain = "friction that grows with the load"
    sentence = "friction of axis {joint} grows by {coefficient:.3g} Nm for every Nm that the gear carries"
    source = "Hamon, Gautier and Garrec 2010"
    parameter_table = (Parameter("coefficient", 0.1, 0.0, 5.0),)

    def change(self, view) -> Change:
        torque = view.torque[:, self.index]
        sign = self.sign(view)
        coefficient = self.values[0]
        return self.torque_change(view, [np.abs(torque) * sign],
                                  **self.slopes(view, by_sign=coefficient * np.abs(torque)),
                                  torque=coefficient * np.sign(torque) * sign)

    @classmethod
    def candidates(cls, robot, view):
        return super().candidates(robot, view) if np.any(view.torque) else ()
