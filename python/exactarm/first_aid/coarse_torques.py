"""Torques or currents that are written in so few steps that their rounding looks like a cause.

Rounding follows the torque itself, and no low-pass takes it away. Of clean motions whose torques were
rounded to so many steps over their range (seeds 11 to 16, at 80 and 120 to 22), a diagnosis was wrong in: 8
steps, 4 of 6; 12, 2; 16, 2; 20, 1; 30, 2; 50, 1; 80, none of 12; 120, 2 of 12; not rounded, none of 20 (seeds
11 to 30; `python bench/coarse_torques.py`, `tests/python/test_coarse_torques.py` has one of each side).
"""

from collections.abc import Iterator

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.first_aid.suspicion import Suspicion
from exactarm.robot.axes_in_words import axes_in_words

MOST_VALUES = 51  # of 50 steps
LEAST_ROWS = 200
_COLUMNS = ("tau", "tau_motor", "current")


def coarse_torques(data: Dataset) -> Iterator[Suspicion]:
    """One line for all axes; what never changes was not measured."""
    for name in _COLUMNS:
        torques = data.joints.get(name, np.zeros((0, 0)))
        values = [np.unique(column[~np.isnan(column)]) for column in torques.T]
        coarse = [axis for axis, each in enumerate(values) if 1 < each.size <= MOST_VALUES]
        if coarse and data.time is not None and len(data) >= LEAST_ROWS:
            most = max(values[axis].size for axis in coarse)
            yield Suspicion(f"columns {name} of {axes_in_words(coarse)} hold {most} different values at "
                            "most: such rounding looks like causes that are not there; log more digits")
