"""Direction dependence: gear harmonics that change their sign with the direction of motion (thesis 3.1.2).

The tables of both directions differ by twice the effect: f = direction of motion, from -1 to 1
(chain/direction.py).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import ALL_KINDS
from exactarm.effects.base import Effect
from exactarm.effects.harmonic_family import HarmonicFamily, orders_by_side


@dataclass(frozen=True)
class DirectionDependence(HarmonicFamily):
    name = "direction_dependence"
    plain = "gear errors that depend on the direction"
    kinds = ALL_KINDS
    compensable = True
    turns_by_waves = "other"
    sentence = "the harmonic {order_per_rev:.2f} of gear {joint} depends on the direction of motion"
    source = "thesis 3.1.2, Tables A.6 to A.11"

    def factor(self, view):
        return view.direction[:, self.index], {}

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        for index in range(robot.axes):
            direction = view.direction[:, index]
            if not np.any(direction > 0) or not np.any(direction < 0):
                continue
            orders = orders_by_side(robot, view, index)
            if len(orders):
                yield cls.zero(index + 1, orders)
