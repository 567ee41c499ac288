"""The rounding of reported angles: a noise that repeated visits do not show, because they are rounded alike.

A column is quantised when all differences of its values have a common divisor that is more than a digit's
rounding. Rounding to a step s has the standard deviation s / sqrt(12) (uniform within half a step); through
the arm's Jacobian it moves the measurement.
"""

from __future__ import annotations

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.effects.base import Station
from exactarm.robot.robot import Robot
from exactarm.view import View

_LEAST_VALUES = 8  # distinct ones: fewer may lie on a grid by choice (commanded steps), which is no rounding
_EXACT = 1e-9  # rad: below it a remainder is nothing
_LEAST_STEP = 1e-7  # rad: a finer step moves no arm by a micrometre
_LEAST_MOVED_M = 1e-6  # RMS over the poses: below it no tracker sees the rounding
_LARGEST_STEP_RAD = 2e-3  # a grid coarser than any encoder is a choice of poses


def step_of(values: np.ndarray) -> float:
    """Step (in the unit of the values) of a quantised column (N,), 0 where it is not quantised."""
    distinct = np.unique(values[np.isfinite(values)])
    if len(distinct) < _LEAST_VALUES:
        return 0.0
    step = 0.0
    # greatest common divisor, by Euclid; the whole range keeps it exact
    for place in distinct[1:] - distinct[0]:
        larger, smaller = max(step, place), min(step, place)
        while smaller > _EXACT:
            larger, smaller = smaller, float(np.remainder(larger, smaller))
            smaller = min(smaller, larger - smaller)  # the remainder may lie just below a whole step
        step = place / max(round(place / larger), 1)
    return step if step > _LEAST_STEP else 0.0


def rounding_of_angles(data: Dataset, robot: Robot, view: View, size: int) -> np.ndarray | None:
    """(N, m, n): what the rounding of each axis, by its standard deviation, does to the first `size`
    components of poses at rest; None where no column is rounded, or none so that a device would see it."""
    transfer, found = view.transfers[Station.GEAR], np.zeros((view.rows, size, view.axes))
    for name, ratios in (("q", np.ones(view.axes)), ("theta", np.abs(robot.ratios))):
        for axis, column in enumerate(data.joints[name].T if name in data.joints else ()):
            step = step_of(column) / ratios[axis]
            if 0.0 < step < _LARGEST_STEP_RAD:
                moved = transfer((axis,), np.ones((view.rows, 1, 1)))[:, :size, 0]
                found[:, :, axis] = step / np.sqrt(12.0) * moved
    moved = np.sqrt(np.sum(found[:, :3] ** 2) / max(view.rows, 1))
    return found if moved > _LEAST_MOVED_M else None
