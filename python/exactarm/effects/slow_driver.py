"""What slow drift follows: a measured temperature where there is one, else time, else the order of the rows.

`drivers(data)`: the names to choose from. `slow_signal(data, name)`: (N,) the driver less its mean over each
session (poses: the frames of a session absorb the mean) or less its first value (time series), and
`unit(name)` the unit it is in: degC, h or row.
"""

from __future__ import annotations

import numpy as np

TIME, ROW = "time", "row"


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


def unit(name: str) -> str:
    return {TIME: "h", ROW: "row"}.get(name, "degC")


def slow_signal(data, name: str, from_start: bool = False) -> np.ndarray:
    if name == TIME:
        values = data.time / 3600.0
    elif name == ROW:
        values = data.row.astype(float)
    else:
        values = data.covariates[name]
    signal = np.array(values, float)
    if from_start:
        return signal - signal[0]
    for session in np.unique(data.session):
        rows = data.session == session
        signal[rows] -= signal[rows].mean()
    return signal
