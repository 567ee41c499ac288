"""What slow drift follows: a measured temperature where there is one, else time, else the order of the rows.

`drivers(data)`: the names to choose from. `slow_signal(data, name)`: (N,) the driver from a fixed reference
(20 degC, time 0, row 0), the same for every part of a data set: a reference taken from the rows at hand would
move between the rows that are fitted and those that judge. `unit(name)`: degC, h or row. `quickness(data,
name)`: plausible rates are those of an hour of warming up; what settles within a record of T hours (a tripod,
a clamp) goes as far in that time, 1/T times as fast. Time constants between the two are alike in their
logarithm.
"""

import numpy as np

from exactarm.data.kinds.base import is_a_series, rows_of_runs

TIME, ROW = "time", "row"
REFERENCE_DEGC = 20.0
_QUICKER = 10.0**0.5  # from one time constant to the next


def temperatures(data) -> list[str]:
    """Names of the covariates that are temperatures and vary."""
    return [name for name, values in data.covariates.items()
            if (name.endswith("_degC") or "temp" in name.lower()) and np.ptp(values) > 0.0]


def drivers(data) -> list[str]:
    found = temperatures(data)
    if found:
        return found
    return [TIME] if data.time is not None and np.ptp(data.time) > 0.0 else [ROW]


def clock_of(view) -> str:
    """Time where the rows of a set-up have one clock (a run may start its own anew), else their order."""
    data = view.data
    return TIME if data.time is not None and np.ptp(data.time) > 0.0 and not view.is_series else ROW


def in_order(data, session: int, driver: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a session in the order of the driver, and its values there."""
    rows = np.flatnonzero(data.session == session)
    x = slow_signal(data, driver)[rows]
    order = np.argsort(x, kind="stable")
    return rows[order], x[order]


def unit(name: str) -> str:
    return {TIME: "h", ROW: "row"}.get(name, "degC")


def quickness(data, name: str) -> tuple[float, ...]:
    """Factors on a plausible rate, each as likely as the others."""
    length = float(np.ptp(slow_signal(data, TIME))) if name == TIME else 0.0
    steps = int(np.ceil(np.log(1.0 / length) / np.log(_QUICKER))) if 0.0 < length < 1.0 else 0
    return tuple(_QUICKER**k for k in range(steps + 1))


def slow_signal(data, name: str) -> np.ndarray:
    """(N,); poses that are planned have neither time nor temperature yet: they stand at the reference."""
    if name == ROW:
        return data.row.astype(float)
    if name == TIME:
        return np.zeros(len(data.row)) if data.time is None else _elapsed(data) / 3600.0
    measured = data.covariates.get(name)
    return np.zeros(len(data.row)) if measured is None else np.asarray(measured, float) - REFERENCE_DEGC


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
