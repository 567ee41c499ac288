"""What slow drift follows: a measured temperature where there is one, else time, else the order of the rows.

`drivers(data)`: the names to choose from. `slow_signal(data, name)`: (N,) the driver from a fixed reference
(20 degC, time 0, row 0), the same for every part of a data set: a reference taken from the rows at hand would
move between the rows that are fitted and those that judge. `unit(name)`: degC, h or row. `quickness(data,
name)`: plausible rates are those of an hour of warming up; what settles within a record of T hours (a tripod,
a clamp) goes as far in that time, 1/T times as fast. Time constants between the two are alike in their
logarithm.

`Follows`: an effect that follows a driver whose values were `between` two in its record. What it does is
counted from the middle of a temperature, and from the end of a time, where the arm has warmed up: an arm of
which nothing is known stands there. In time it goes on steadily, or as what warms up or settles does,

    x = t - end    or    x = tau (exp(-(end - start) / tau) - exp(-(t - start) / tau)),

which begins as fast and goes no farther than tau; farther than half a record from it, nothing goes on. A
measured temperature has such a course in it already. Without `between`: from 20 degC, time 0, row 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from exactarm.data.kinds.base import is_a_series, rows_of_runs
from exactarm.effects.base import Change, Effect, Parameter

TIME, ROW = "time", "row"
REFERENCE_DEGC = 20.0
_QUICKER = 10.0**0.5  # from one time constant to the next
# of the length of a record: longer ones look like a straight line, a shorter one like a step behind its start
_SHORTEST, _LONGEST, _COURSES = 0.05, 0.5, 3
_BEYOND = 0.5  # of its record, before and behind it


def temperatures(data) -> list[str]:
    """Names of the covariates that are temperatures and vary."""
    return [name for name, values in data.covariates.items()
            if (name.endswith("_degC") or "temp" in name.lower()) and np.ptp(values) > 0.0]


def clock(data) -> str:
    return TIME if data.time is not None and np.ptp(data.time) > 0.0 else ROW


def drivers(data) -> list[str]:
    return temperatures(data) or [clock(data)]


def clock_of(view) -> str:
    """Time where the rows of a set-up have one clock (a run may start its own anew), else their order."""
    return ROW if view.is_series else clock(view.data)


def in_order(data, session: int, driver: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a session in the order of the driver, and its values there."""
    rows = np.flatnonzero(data.session == session)
    x = slow_signal(data, driver)[rows]
    order = np.argsort(x, kind="stable")
    return rows[order], x[order]


@dataclass(frozen=True)
class Follows(Effect):
    """An effect that follows `driver` (a covariate, time, or row), `between` its ends in the record; settles:
    with a time constant, which is its last value; tried: time constants to search."""

    driver: str = TIME
    between: tuple[float, float] | None = None
    settles: bool = False
    tried: tuple[float, ...] = ()

    may_settle: ClassVar[bool] = False
    in_record: ClassVar[bool] = False  # counted from its record; what belongs to values of 20 degC is not

    def rates(self) -> tuple[Parameter, ...]:
        """Its parameters, but for the time constant."""
        raise NotImplementedError

    def at(self, view, x: np.ndarray) -> Change:
        """What it does where its driver has gone x (N, 1); by its rates."""
        raise NotImplementedError

    @property
    def rate_values(self) -> tuple[float, ...]:
        return self.values[:-1] if self.settles else self.values

    @property
    def unit(self) -> str:
        return unit(self.driver)

    @property
    def in_time(self) -> str:
        """For a sentence: how fast it settles."""
        if not self.settles:
            return ""
        units = "rows" if self.driver == ROW else self.unit
        return f" at first, and settles with a time constant of {self.values[-1]:.3g} {units}"

    def parameters(self) -> tuple[Parameter, ...]:
        if not self.settles:
            return self.rates()
        usual = self.tried or (self.values[-1],) if self.values else (1.0,)
        # ends: a step at the start, and a straight line, beyond what can be told of either
        bounds = 0.2 * min(usual), 10.0 * max(usual)
        return (*self.rates(), Parameter(f"settling_{self.unit}", max(usual), *bounds, search=self.tried))

    @property
    def where_unknown(self) -> str:
        if self.driver in (TIME, ROW):
            return f"{self.label} (taken as at the {'end of its record' if self.between else 'start'})"
        usual = np.mean(self.between) if self.between else REFERENCE_DEGC
        return f"{self.label} (taken as at {usual:.3g} degC)"

    def quickness(self, view) -> tuple[float, ...]:
        return quickness(view.data, self.driver)

    def to_table(self):
        between = {} if self.between is None else {"between": list(self.between)}
        return super().to_table() | {"driver": self.driver} | between

    def change(self, view) -> Change:
        x, slower = self._course(slow_signal(view.data, self.driver)[:, None])
        if not self.settles:
            return self.at(view, x)
        steady, by_tau = self.at(view, x), self.at(view, slower).value
        return replace(steady, by_parameters=np.append(steady.by_parameters, by_tau[:, :, None], axis=2))

    def _course(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x of drivers t (N, 1), NaN where nothing is known of them, and its slope by the time constant."""
        if self.between is None:
            return np.nan_to_num(t), np.zeros_like(t)
        start, end = self.between
        if self.driver not in (TIME, ROW):
            return np.nan_to_num(t + REFERENCE_DEGC - 0.5 * (start + end)), np.zeros_like(t)
        beyond = _BEYOND * (end - start)
        since = np.nan_to_num(np.clip(t, start - beyond, end + beyond), nan=end) - start
        if not self.settles:
            return since - (end - start), np.zeros_like(t)
        tau = self.values[-1]
        course = lambda s: (np.exp(-s / tau), (1.0 + s / tau) * np.exp(-s / tau))  # and d (tau exp) / d tau
        (last, last_slope), (here, slope) = course(end - start), course(np.maximum(since, 0.0))
        return tau * (last - here), last_slope - slope

    def forms_on(self, data) -> Iterator[Effect]:
        """Its forms on these rows, at zero size: steady, and where the driver has no course of its own,
        settling. By the order of rows only within one set-up: how long it took to move to the next no row
        tells."""
        t = slow_signal(data, self.driver)
        if not self.in_record or not np.ptp(t) > 0.0:
            yield self
            return
        zero = 0.0 if self.driver in (TIME, ROW) else REFERENCE_DEGC
        steady = replace(self, between=(zero + float(t.min()), zero + float(t.max())))
        yield steady
        clock = self.driver == TIME or self.driver == ROW and np.ptp(data.session) == 0
        if self.may_settle and clock:
            tried = tuple(np.ptp(t) * np.geomspace(_SHORTEST, _LONGEST, _COURSES))
            yield replace(steady, values=(*self.values, float(tried[-1])), settles=True, tried=tried)


def pair_of(table) -> tuple[float, float] | None:
    """Ends of the record in an entry of a robot file. Raises TypeError if they are none."""
    between = table.get("between")
    if between is None:
        return None
    if not isinstance(between, list) or len(between) != 2 or not between[0] < between[1]:
        raise TypeError("between: expected two rising numbers")
    return float(between[0]), float(between[1])


def settles_in(table) -> bool:
    """Whether an entry of a robot file has a time constant. Raises TypeError if it is none, or the ends of
    the record are missing."""
    constants = [value for key, value in table.items() if key.startswith("settling_")]
    if constants and not (constants[0] > 0.0 and "between" in table):
        raise TypeError("settling: expected a time above zero, and between")
    return bool(constants)


def unit(name: str) -> str:
    return {TIME: "h", ROW: "row"}.get(name, "degC")


def quickness(data, name: str) -> tuple[float, ...]:
    """Factors on a plausible rate, each as likely as the others."""
    length = float(np.ptp(slow_signal(data, TIME))) if name == TIME else 0.0
    steps = int(np.ceil(np.log(1.0 / length) / np.log(_QUICKER))) if 0.0 < length < 1.0 else 0
    return tuple(_QUICKER**k for k in range(steps + 1))


def slow_signal(data, name: str) -> np.ndarray:
    """(N,); NaN for poses that are planned: they have neither time nor temperature yet."""
    if name == ROW:
        return data.row.astype(float)
    if name == TIME:
        return np.full(len(data.row), np.nan) if data.time is None else _elapsed(data) / 3600.0
    measured = data.covariates.get(name)
    return (np.full(len(data.row), np.nan) if measured is None
            else np.asarray(measured, float) - REFERENCE_DEGC)


def _elapsed(data) -> np.ndarray:
    """(N,) s. A run of a series that starts its own clock begins when the rows before it in its file have
    passed: a clock that goes on cannot show less. So every part of a data set has the same time."""
    elapsed = np.array(data.time, float)
    if not is_a_series(data):
        return elapsed
    for rows in rows_of_runs(data):
        time, row = elapsed[rows], data.row[rows].astype(float)
        steps = np.diff(row)
        if not np.any(steps > 0.0):
            continue
        before = (row[0] - 1.0) * np.median(np.diff(time)[steps > 0.0] / steps[steps > 0.0])
        if time[0] < 0.5 * before:
            elapsed[rows] += before - time[0]
    return elapsed
