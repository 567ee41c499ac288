"""What slow drift follows: a measured temperature where there is one, else time, else the order of the rows.

`drivers(data)`: the names to choose from. `slow_signal(data, name)`: (N,) the driver from a fixed reference
(20 degC, time 0, row 0), the same for every part of a data set: a reference taken from the rows at hand would
move between the rows that are fitted and those that judge. `unit(name)`: degC, h or row.
"""

from __future__ import annotations

import numpy as np

TIME, ROW = "time", "row"
REFERENCE_DEGC = 20.0


def temperatures(data) -> list[str]:
    """Names of the covariates that are temperatures and vary."""
    return [
        name
        for name, values in data.covariates.items()
        if (name.endswith("_degC") or "temp" in name.lower()) and np.ptp(values) > 0.0
    ]


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


def slow_signal(data, name: str) -> np.ndarray:
    """(N,); poses that are planned have neither time nor temperature yet: they stand at the reference."""
    if name == ROW:
        return data.row.astype(float)
    measured = data.time if name == TIME else data.covariates.get(name)
    if measured is None:
        return np.zeros(len(data.row))
    return (
        np.asarray(measured, float) / 3600.0 if name == TIME else np.asarray(measured, float) - REFERENCE_DEGC
    )
