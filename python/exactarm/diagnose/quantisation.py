"""The rounding of reported angles: a noise that repeated visits do not show, because they are rounded alike.

A column is quantised when all differences of its values have a common divisor that is more than a digit's
rounding. Rounding to a step s has the standard deviation s / sqrt(12) (uniform within half a step); through
the arm's Jacobian it moves the measurement.
"""

from __future__ import annotations

import numpy as np

from exactarm.data.kinds import kind_of
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.effects.base import Station

_LEAST_VALUES = 8  # distinct ones: fewer may lie on a grid by choice (commanded steps), which is no rounding
_EXACT = 1e-9  # rad: below it a remainder is nothing, above it lies the last digit of any table
_LEAST_STEP = 1e-7  # rad: a finer step moves no arm by a micrometre
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


def rounding_noise(problem: Problem, fitted: Fitted) -> float:
    """RMS over the rows of what the rounding of the reported angles moves the measured position (m); 0 for
    other data."""
    transfer = fitted.view.transfers.get(Station.GEAR)
    if not kind_of(problem.kind).target_at_rest or transfer is None:
        return 0.0
    square = 0.0
    for name, ratios in (("q", np.ones(fitted.view.axes)), ("theta", np.abs(fitted.robot.ratios))):
        if name not in problem.data.joints:
            continue
        for axis, column in enumerate(problem.data.joints[name].T):
            step = step_of(column) / ratios[axis]
            if 0.0 < step < _LARGEST_STEP_RAD:
                moved = transfer((axis,), np.ones((fitted.view.rows, 1, 1)))[:, :3, 0]
                square += step**2 / 12.0 * float(np.mean(np.sum(moved**2, axis=1)))
    return float(np.sqrt(square))
