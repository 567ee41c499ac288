"""Expression: an effect that nobody wrote in this library, as a formula of signals, which turns one axis.

change of q_joint = form(signals, values), rad. Signals: q_i (output angle of gear i plus the joint's zero,
rad), theta_i (motor, rad), torque_i (joint, Nm), approach_i (direction of motion, -1 to 1), time_h, and every
covariate by its name. Parameters: all other names, linear or not. The formula is read by `formula.py`;
nothing of it is run as code.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from exactarm.data.kinds import ALL_KINDS
from exactarm.effects.accepted import accepted_drafts
from exactarm.effects.base import Change, DoesNotFit, Effect, Parameter, Station
from exactarm.effects.slow_driver import TIME, slow_signal
from exactarm.errors import InputError
from exactarm.numerics.formula import Formula, divisors, linear_names

_OF_AXIS = re.compile(r"(q|theta|torque|approach)_(\d+)$")
_LONGEST_LABEL = 60  # characters
_RANGE = 3.0  # times a width that a draft names: as far as a fit may move it; exp(s/w) does not overflow
# Where a formula is tried: signals of any sign from a thousandth to a thousand (rad, Nm, h, degC)
_TRIED, _DECADES = 1000, 3.0
_NO_SIZE_RAD = 1e-12  # 1 pm at 1 m: what rounding leaves of q_1 - q_1
_SIGNAL = {"q": "phi", "theta": "theta", "torque": "torque"}


@dataclass(frozen=True)
class Expression(Effect):
    """values: of `names`, the parameters of `form`; `plausible`: their plausible sizes; `of`: the signals it
    uses.

    searched: (parameter, values to try it from), of parameters that the formula is not linear in; absent: the
    value that it has.
    """

    form: str = "0"
    of: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    plausible: tuple[float, ...] = ()
    heading: str = ""
    searched: tuple[tuple[str, tuple[float, ...]], ...] = ()

    name = "expression"
    station = Station.SPRING
    kinds = ALL_KINDS
    repeatable = True
    source = "a draft that was accepted"
    open_parameters = (
        "the names in its formula that are no signals, each with its plausible size in the draft")

    @property
    def compensable(self) -> bool:  # type: ignore[override]
        """Whether a program or a plan knows all its signals: those of axes, not a temperature."""
        return all(_OF_AXIS.match(signal) for signal in self.of)

    @cached_property
    def grids(self) -> dict[str, tuple[float, ...]]:
        return dict(self.searched)

    @cached_property
    def formula(self) -> Formula:
        return Formula.of(self.form)

    @property
    def nothing_at_all(self) -> bool:
        """Whether the formula is zero wherever it is tried, with its parameters at their plausible sizes."""
        random = np.random.default_rng(0)
        sizes = dict(zip(self.names, self.plausible))
        numbers = {name: np.full(_TRIED, sizes[name]) for name in self.names}
        signals = {signal: random.choice((-1.0, 1.0), _TRIED)
                   * 10.0 ** random.uniform(-_DECADES, _DECADES, _TRIED) for signal in self.of}
        with np.errstate(all="ignore"):
            value = self.formula(signals | numbers)[0]
        return bool(np.all(np.abs(value) < _NO_SIZE_RAD))  # without a value at some place: not zero

    @property
    def label(self) -> str:
        if len(self.form) <= _LONGEST_LABEL:
            return f"{self.name}_{self.joint}: {self.form}"
        return (f"{self.name}_{self.joint}: series in {', '.join(self.of)} "
                f"({hashlib.sha256(self.form.encode()).hexdigest()[:6]})")

    @property
    def in_plain_words(self) -> str:
        return f"a formula of {' and '.join(self.of)}" if self.of else self.name

    @property
    def driven_by(self) -> int | None:
        return self.other_axes[0] if len(self.other_axes) == 1 else self.joint

    @property
    def other_axes(self) -> tuple[int, ...]:
        return tuple(dict.fromkeys(int(match[2]) for match in map(_OF_AXIS.match, self.of) if match))

    @property
    def title(self) -> str:
        return self.heading or f"expression of axis {self.joint}"

    def describe(self) -> str:
        numbers = ", ".join(f"{name} = {value:.3g}" for name, value in zip(self.names, self.values))
        return f"axis {self.joint} is off by {self.form} rad ({numbers})"

    @cached_property
    def linear(self) -> frozenset[str]:
        """Parameters that the formula is linear in; the others (a width, a place) are searched from where the
        draft has them."""
        return frozenset(linear_names(self.formula, self.names))

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(self._parameter(*each) for each in zip(self.names, self.values, self.plausible))

    def _parameter(self, name: str, value: float, size: float) -> Parameter:
        if name in self.linear:
            return Parameter(name, size)
        grid = self.grids.get(name, (value,))
        if name not in divisors(self.formula):
            return Parameter(name, size, search=grid)
        ends = sorted((min(grid, key=abs) / _RANGE, max(grid, key=abs) * _RANGE))
        return Parameter(name, size, *ends, search=grid)

    def change(self, view) -> Change:
        signals = {signal: signal_of(view, signal) for signal in self.of}
        numbers = dict(zip(self.names, self.values))
        value, slopes = self.formula({**signals, **{n: np.full(view.rows, v) for n, v in numbers.items()}})
        value = np.broadcast_to(value, (view.rows,))
        derivative = np.zeros((view.rows, 1, len(self.names)))
        for k, name in enumerate(self.names):
            derivative[:, 0, k] = slopes.get(name, 0.0)
        by_signal: dict[str, np.ndarray] = {}
        for signal in self.of:
            match = _OF_AXIS.match(signal)
            if match and match[1] in _SIGNAL:
                factor = by_signal.setdefault(_SIGNAL[match[1]], np.zeros((view.rows, 1, view.axes)))
                factor[:, 0, int(match[2]) - 1] += slopes.get(signal, 0.0)
        return Change((self.index,), value[:, None], derivative, by_signal)

    def to_table(self):
        table = {"effect": self.name, "joint": self.joint, "title": self.heading, "form": self.form,
                 "of": list(self.of)}
        table["values"] = dict(zip(self.names, self.values))
        return table | {"plausible": dict(zip(self.names, self.plausible))}

    @classmethod
    def from_table(cls, table) -> Effect:
        """Raises KeyError for what is missing, FormulaError for what is no formula, DoesNotFit for a name in
        it that is no signal and no parameter."""
        formula, of = Formula.of(str(table["form"])), tuple(str(signal) for signal in table["of"])
        names = tuple(name for name in formula.names if name not in of)
        values, sizes = table["values"], table.get("plausible", {})
        for name in names:
            if name not in values:
                raise DoesNotFit(_unlisted(name, of))
        return cls(int(table["joint"]), tuple(float(values[name]) for name in names), form=formula.text,
                   of=of, names=names,
                   plausible=tuple(abs(float(sizes.get(name, values[name]))) or 1.0 for name in names),
                   heading=str(table.get("title", "")))

    def emptied(self) -> Expression:
        """At zero size: linear parameters are zero, the others where the draft has them."""
        values = (0.0 if name in self.linear else value for name, value in zip(self.names, self.values))
        return replace(self, values=tuple(values))

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        """The drafts that the user has accepted, on this robot's axes, where the data have their signals."""
        for table in accepted_drafts():
            effect = cls.from_table(table)
            if effect.joint <= robot.axes and all(_present(view, signal) for signal in effect.of):
                yield effect.emptied()


def _unlisted(name: str, of: tuple[str, ...]) -> str:
    """What is wrong with a name that a formula has, and that is neither a signal nor a parameter of it."""
    listed = f"(it has {', '.join(of)})" if of else "(it has none)"
    if match := _OF_AXIS.match(name):
        return (f"the formula has {name}, a signal of axis {match[2]}, and the list `of` has not {listed}; "
                "expected every signal there, of axes that the arm has")
    return (f"the formula has {name}, and neither the list of signals `of` {listed} nor the table `values` "
            "has; expected every signal in the one and every parameter in the other")


def signal_of(view, signal: str) -> np.ndarray:
    """(N,) a signal by the name that it has in formulas."""
    match = _OF_AXIS.match(signal)
    if match is None and signal not in ("time_h", *view.data.covariates):
        raise InputError(f"no column {signal}, which an effect of the robot file follows; expected one of "
                         "that name, or a robot file without the effect", file=view.data.first_file)
    if match is None:
        return (np.nan_to_num(slow_signal(view.data, TIME))
                if signal == "time_h" else np.asarray(view.data.covariates[signal], float))
    kind, index = match[1], int(match[2]) - 1
    if kind == "q":
        return view.phi[:, index] + view.robot.offsets[index]
    return view.direction[:, index] if kind == "approach" else view.signals[kind][:, index]


def _present(view, signal: str) -> bool:
    match = _OF_AXIS.match(signal)
    if match is None:
        return signal in view.data.covariates or (signal == "time_h" and view.data.time is not None)
    return 1 <= int(match[2]) <= view.axes
