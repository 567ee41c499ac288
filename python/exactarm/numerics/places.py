"""Places at which an axis stands again and again, as a quill does above a plate.

What its readings scatter by at one place is the device's, no angle of its gear: it errs with what the rows
are judged by (errors in variables), and a bin or a short wave would follow it.
"""

import numpy as np

_ONE_PLACE = 0.02  # of the range: an axis that moves by less of the others' range stands still, too


def at_places(values: np.ndarray) -> np.ndarray:
    """(N,) for each value the mean of its place; what lies closer than the places are wide is as it was."""
    order = np.argsort(values, kind="stable")
    least = _ONE_PLACE * np.ptp(values)
    place = np.empty(len(values), int)
    place[order] = np.cumsum(np.diff(values[order], prepend=values[order[:1]]) > least)
    count = np.bincount(place)
    first = np.cumsum(count) - count
    wide = values[order][first + count - 1] - values[order][first] > least
    return np.where(wide[place], values, (np.bincount(place, values) / count)[place])


def places_of(values: np.ndarray) -> int:
    """How many different ones there are."""
    return len(np.unique(at_places(values)))
