"""Load dependence: the error of a gear changes with the torque that it carries (wind-up, meshing under load).

Either the delivered angle gives way, change = -linear torque; or the gear's whole error grows,
e -> (1 + relative |torque|) e; or one order has a part proportional to the torque (values: order, a, b per Nm).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Iterable

import numpy as np

from exactarm.effects.base import Change, Effect, Parameter
from exactarm.effects.harmonic_family import HarmonicFamily, declared_orders, growing_error, searched_orders

_LEAST_SPREAD_NM = 1e-3


@dataclass(frozen=True)
class LoadDependence(HarmonicFamily):
    """One value: wind-up, or with `of_declared` the growth of the gear's error; more: an order of its own."""

    of_declared: bool = False

    name: ClassVar[str] = "load_dependence"
    kinds: ClassVar[tuple[str, ...]] = ("gear_run", "motion")
    compensable: ClassVar[bool] = True
    repeatable: ClassVar[bool] = False
    unit: ClassVar[str] = "_per_Nm"
    plausible: ClassVar[float] = 1e-5
    sentence: ClassVar[str] = "the error of gear {joint} changes with the torque that it carries"
    source: ClassVar[str] = "thesis 1.1.1, 1.1.2"

    def factor(self, view):
        by_torque = np.zeros((view.rows, view.axes))
        by_torque[:, self.index] = 1.0
        return view.torque[:, self.index], {"torque": by_torque}

    def parameters(self) -> tuple[Parameter, ...]:
        if len(self.values) != 1:
            return super().parameters()
        if self.of_declared:
            return (Parameter("relative_per_Nm", 5e-3, -1.0, 1.0),)
        return (Parameter("linear_rad_per_Nm", 5e-6),)

    def parameter_label(self, parameter: Parameter) -> str:
        return f"{self.label}.{parameter.name}"

    def change(self, view) -> Change:
        if len(self.values) != 1:
            return super().change(view)
        size, torque = self.values[0], view.torque[:, self.index]
        by_torque = np.zeros((view.rows, 1, view.axes))
        if self.of_declared:
            grown, error = growing_error(view, self.index, size, np.abs(torque))
            by_torque[:, 0, self.index] = -size * np.sign(torque) * error
            return replace(grown, by_signal=grown.by_signal | {"torque": by_torque})
        by_torque[:, 0, self.index] = -size
        return Change((self.index,), (-size * torque)[:, None], -torque[:, None, None], {"torque": by_torque})

    @classmethod
    def from_table(cls, table) -> Effect:
        for key, of_declared in (("relative_per_Nm", True), ("linear_rad_per_Nm", False)):
            if key in table:
                return cls(table["joint"], (float(table[key]),), of_declared=of_declared)
        return super().from_table(table)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        for index in range(robot.axes):
            if np.std(view.torque[:, index]) < _LEAST_SPREAD_NM:
                continue
            yield cls(index + 1, (0.0,))
            if robot.joints[index].has_harmonics:
                yield cls(index + 1, (0.0,), of_declared=True)
            orders = (*np.unique(declared_orders(robot, index)), *searched_orders(robot, view, index))
            if len(orders) and view.moving[index]:
                yield cls.zero(index + 1, orders)
