"""Expression: an effect that nobody wrote in this library, as a formula of signals, which turns one axis.

change of q_joint = form(signals, values), rad. Signals: q_i (output angle of gear i plus the joint's zero, rad), theta_i (motor, rad),
torque_i (joint, Nm), approach_i (direction of motion, -1 to 1), time_h, and every covariate by its name. Parameters: all other
names, linear or not. The formula is read by `formula.py`; nothing of it is run as code.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from exactarm.effects.accepted import accepted_drafts
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.slow_driver import TIME, slow_signal
from exactarm.formula import Formula

_OF_AXIS = re.compile(r"(q|theta|torque|approach)_(\d+)$")
_SIGNAL = {"q": "phi", "theta": "theta", "torque": "torque"}


@dataclass(frozen=True)
class Expression(Effect):
    """values: of `names`, the parameters of `form`; `plausible`: their plausible sizes; `of`: the signals it uses."""

    form: str = "0"
    of: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    plausible: tuple[float, ...] = ()
    heading: str = ""

    name: ClassVar[str] = "expression"
    station: ClassVar[Station] = Station.SPRING
    kinds: ClassVar[tuple[str, ...]] = ("poses", "gear_run", "motion", "tracked_motion")
    compensable: ClassVar[bool] = True
    repeatable: ClassVar[bool] = True
    source: ClassVar[str] = "a draft that was accepted"
    open_parameters: ClassVar[str] = "the names in its formula that are no signals, each with its plausible size in the draft"

    @cached_property
    def formula(self) -> Formula:
        return Formula.of(self.form)

    @property
    def label(self) -> str:
        return f"{self.name}_{self.joint}: {self.form}"

    @property
    def title(self) -> str:
        return self.heading or f"expression of axis {self.joint}"

    def describe(self) -> str:
        numbers = ", ".join(f"{name} = {value:.3g}" for name, value in zip(self.names, self.values))
        return f"axis {self.joint} is off by {self.form} rad ({numbers})"

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(name, size) for name, size in zip(self.names, self.plausible))

    def change(self, view) -> Change:
        signals = {signal: self._signal(view, signal) for signal in self.of}
        numbers = dict(zip(self.names, self.values))
        value, slopes = self.formula({**signals, **{n: np.full(view.rows, v) for n, v in numbers.items()}})
        value = np.broadcast_to(value, (view.rows,))
        derivative = np.zeros((view.rows, 1, len(self.names)))
        for k, name in enumerate(self.names):
            derivative[:, 0, k] = slopes.get(name, 0.0)
        by_signal: dict[str, np.ndarray] = {}
        for signal in self.of:
            match = _OF_AXIS.match(signal)
            if match and match[1] in _SIGNAL and signal in slopes:
                factor = by_signal.setdefault(_SIGNAL[match[1]], np.zeros((view.rows, 1, view.axes)))
                factor[:, 0, int(match[2]) - 1] += slopes[signal]
        return Change((self.index,), value[:, None], derivative, by_signal)

    @staticmethod
    def _signal(view, signal: str) -> np.ndarray:
        match = _OF_AXIS.match(signal)
        if match is None:
            return slow_signal(view.data, TIME) if signal == "time_h" else np.asarray(view.data.covariates[signal], float)
        kind, index = match[1], int(match[2]) - 1
        if kind == "q":
            return view.phi[:, index] + view.robot.offsets[index]
        return view.direction[:, index] if kind == "approach" else view.signals[kind][:, index]

    def to_table(self):
        table = {"effect": self.name, "joint": self.joint, "title": self.heading, "form": self.form, "of": list(self.of)}
        table["values"] = dict(zip(self.names, self.values))
        return table | {"plausible": dict(zip(self.names, self.plausible))}

    @classmethod
    def from_table(cls, table) -> Effect:
        """Raises KeyError for what is missing, FormulaError for what is no formula."""
        formula, of = Formula.of(str(table["form"])), tuple(str(signal) for signal in table["of"])
        names = tuple(name for name in formula.names if name not in of)
        values, sizes = table["values"], table.get("plausible", {})
        return cls(int(table["joint"]), tuple(float(values[name]) for name in names), form=formula.text, of=of, names=names,
                   plausible=tuple(abs(float(sizes.get(name, values[name]))) or 1.0 for name in names),
                   heading=str(table.get("title", "")))

    def emptied(self) -> Expression:
        return replace(self, values=(0.0,) * len(self.names))

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        """The drafts that the user has accepted, on this robot's axes, where the data have their signals."""
        for table in accepted_drafts():
            effect = cls.from_table(table)
            if effect.joint <= robot.axes and all(_present(view, signal) for signal in effect.of):
                yield effect.emptied()


def _present(view, signal: str) -> bool:
    match = _OF_AXIS.match(signal)
    if match is None:
        return signal in view.data.covariates or (signal == "time_h" and view.data.time is not None)
    return 1 <= int(match[2]) <= view.axes
