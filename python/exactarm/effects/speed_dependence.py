"""Speed dependence: the error of a gear changes with its speed (friction and inertia inside; thesis 1.1.1,
3.1.2).

Either the gear's whole error grows, e -> (1 + relative |phi_dot|) e, or one order has a part of its own
that is proportional to |phi_dot| (values: order, a, b as in gear_harmonics, per rad/s).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import GEAR_RUN, MOTION
from exactarm.effects.base import Change, Effect, Parameter
from exactarm.effects.harmonic_family import (
    HarmonicFamily,
    declared_orders,
    growing_error,
    searched_orders,
    slow_orders,
)


@dataclass(frozen=True)
class SpeedDependence(HarmonicFamily):
    """One value: `relative_s_per_rad` of the gear's error; three or more: an order of its own."""

    name = "speed_dependence"
    plain = "gear errors that change with the speed"
    kinds = (GEAR_RUN.name, MOTION.name)
    compensable = True
    at_rest = False
    smooth = False
    repeatable = False
    of_waves = True
    turns_by_waves = "faster"
    unit = "_s_per_rad"
    sentence = "the error of gear {joint} changes with its speed"
    source = "thesis 1.1.1, 3.1.2"

    def speed(self, view) -> np.ndarray:
        """(N,) magnitude of the output rate at the nominal ratio; static poses have none."""
        if "theta_dot" not in view.signals:
            return np.zeros(view.rows)
        return np.abs(view.signals["theta_dot"][:, self.index] / view.robot.ratios[self.index])

    def factor(self, view):
        return self.speed(view), {}

    def parameters(self) -> tuple[Parameter, ...]:
        if len(self.values) != 1:
            return super().parameters()
        return (Parameter("relative_s_per_rad", 0.2, -5.0, 5.0),)

    def change(self, view) -> Change:
        if len(self.values) != 1:
            return super().change(view)
        return growing_error(self, view, self.speed(view))[0]

    @classmethod
    def from_table(cls, table) -> Effect:
        if "relative_s_per_rad" in table:
            return cls(table["joint"], (float(table["relative_s_per_rad"]),))
        return super().from_table(table)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        if "theta_dot" not in view.signals:
            return
        for index in np.flatnonzero(view.moving):
            if robot.joints[index].has_harmonics:
                yield cls(int(index) + 1, (0.0,))
            # what turns once or twice and grows with the speed is no run-out
            orders = (*np.unique(declared_orders(robot, index)), *searched_orders(robot, view, index),
                      *slow_orders(robot, view, index, lowest=1.0))
            if len(orders):
                yield cls.zero(int(index) + 1, orders)
