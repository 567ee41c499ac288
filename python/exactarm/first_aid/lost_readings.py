"""Readings that were lost and written as 0: a column is exactly 0 for a moment, between readings of one sign
that are far from it, and again and again.

What passes 0 comes near it before, and has another sign behind. A brake that holds, or a stop, lasts longer.
A fit takes such zeros for measured ones: one torque of fifty lost makes masses and friction 2 % too small.
Of poses at rest, which have no moment before and behind, a position that is 0 in x, y and z is one.
"""

from collections.abc import Iterator

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.kinds import kind_of
from exactarm.data.kinds.base import runs_in_time
from exactarm.first_aid.suspicion import Suspicion

MOST_ROWS = 5  # of one moment
LEAST_MOMENTS = 3
FAR = 0.2  # of the RMS of the column, at least: the readings on both sides
# of the rows: so many zeros are a rounding, not a loss, where the readings on both sides are one step away
OFTEN, STEPS = 0.05, 1.5
USUAL = 2.0  # times what 99 % of neighbours differ by, at least: noise and coarse readings come to 0, too
_READINGS = ("tau", "tau_motor", "current", "theta", "q")


def lost_readings(data: Dataset) -> Iterator[Suspicion]:
    """One line for the column in which most are lost."""
    if data.time is None or kind_of(data.kind).at_rest:
        return
    columns = {f"{name}_{i + 1}": values for name in _READINGS if name in data.joints
               for i, values in enumerate(data.joints[name].T)}
    for names, vector in (("xyz", data.position), ("gyro_x gyro_y gyro_z".split(), data.gyro)):
        columns |= {} if vector is None else dict(zip(names, vector.T))
    found = {name: _moments(values, data) for name, values in columns.items()}
    name, rows = max(found.items(), key=lambda pair: pair[1].size, default=("", np.zeros(0)))
    if rows.size >= LEAST_MOMENTS:
        yield Suspicion(f"column {name} is exactly 0 for a moment between readings of another size "
                        f"{rows.size} times, first at {data.place_of(int(rows[0]))}: were readings lost?")


def lost_targets(data: Dataset) -> Iterator[Suspicion]:
    """One line where x, y and z are exactly 0 in some rows, which no device reads."""
    rows = np.flatnonzero(np.all(data.position == 0.0, axis=1))
    if 0 < rows.size < len(data):
        others = " and in others" if rows.size > 1 else ""
        yield Suspicion(f"x, y and z are exactly 0 in {data.place_of(int(rows[0]))}{others}: had the device "
                        "lost its target? Leave such rows out")


def _moments(values: np.ndarray, data: Dataset) -> np.ndarray:
    """First row of every such moment."""
    others = np.abs(values[(values != 0.0) & ~np.isnan(values)])
    if not others.size or others.size == values.size:
        return np.zeros(0, int)
    change = np.abs(np.diff(values))[(values[1:] != 0.0) & (values[:-1] != 0.0)]
    usual = float(np.nanquantile(change, 0.99)) if change.size else np.inf
    far = max(FAR * float(np.sqrt(np.mean(others**2))), USUAL * usual)
    if np.count_nonzero(values == 0.0) > OFTEN * values.size:
        far = max(far, STEPS * float(np.min(np.diff(np.unique(np.abs(values[~np.isnan(values)]))))))
    found = [np.zeros(0, int)]
    for rows in runs_in_time(data):
        zero = np.concatenate([[False], values[rows] == 0.0, [False]]).astype(int)
        begin, end = np.flatnonzero(np.diff(zero) == 1), np.flatnonzero(np.diff(zero) == -1)
        inside = (begin > 0) & (end < rows.size) & (end - begin <= MOST_ROWS)
        begin, end = begin[inside], end[inside]
        before, behind = values[rows[begin - 1]], values[rows[end]]
        same = (np.sign(before) == np.sign(behind)) & (np.minimum(abs(before), abs(behind)) > far)
        found.append(rows[begin[same]])
    return np.concatenate(found)
