"""The rounding of reported angles: a noise that repeated visits do not show, because they are rounded alike.

A column is quantised when all differences of neighbouring values have a common divisor (Euclid), but for the
digits that they were written with, which are a grid of their own and mostly a finer one. Rounding to a step s
has the standard deviation s / sqrt(12) (uniform within half a step); through the arm's Jacobian it moves the
measurement.
"""

from __future__ import annotations

import numpy as np

from exactarm.data.copied_rows import step_of as written_in
from exactarm.data.dataset import Dataset
from exactarm.diagnose.decisions import LEVELS, SURE
from exactarm.effects.base import Station
from exactarm.robot.robot import Robot
from exactarm.view import View

_ENOUGH_VALUES = 500  # neighbours: each tells a grid as well as the next, and few are quick
_EXACT = 1e-9  # rad: a difference below it is nothing
_TOLD = 0.2  # of a grid: what is not known to so much of it is told from no grid by chance
_LEAST_STEP = 1e-7  # rad: a finer step moves no arm by a micrometre
_LEAST_MOVED_M = 1e-6  # RMS over the poses: below it no tracker sees the rounding
# a grid coarser than an encoder's of ten bits is a choice of poses; finer ones may be, too, as the likelihood
# tells (noise/estimate.py)
_LARGEST_STEP_RAD = 2.0 * np.pi / 1024.0


def step_of(values: np.ndarray) -> float:
    """Step (in the unit of the values) of a quantised column (N,), 0 where it is not quantised."""
    distinct = np.unique(values[np.isfinite(values)])
    middle = max(len(distinct) - _ENOUGH_VALUES, 0) // 2
    steps = np.sort(np.diff(distinct[middle : middle + _ENOUGH_VALUES]))
    steps = steps[steps > _EXACT].tolist()
    if len(steps) + 1 < LEVELS:  # so few may lie on a grid by choice (commanded steps), which is no rounding
        return 0.0
    digit = max(unit * written_in(distinct / unit) for unit in (1.0, np.pi / 180.0))
    arithmetic = 8.0 * np.finfo(float).eps * float(np.max(np.abs(distinct)))
    exact = _grid(steps, arithmetic)  # the digits themselves, or a grid of few digits
    found = exact if exact > 1.5 * digit else _grid(steps, digit) or digit
    return found if found > _LEAST_STEP else 0.0


def _grid(steps: list[float], digit: float) -> float:
    """Of ascending steps that are wrong by up to a digit; 0 where there is none that can be told."""
    grid, wrong = steps[0], digit
    while grid > max(_LEAST_STEP, digit / _TOLD):
        grid, wrong, rest = _agreed(steps, grid, wrong, digit)
        if rest == 0.0:
            return grid
        grid = rest
    return 0.0


def _agreed(steps: list[float], grid: float, wrong: float, digit: float) -> tuple[float, float, float]:
    """The grid that ascending steps agree on, begun with a guess of it that is `wrong` by so much, and 0; or
    what the first step that disagrees leaves of a multiple, and by how much that is wrong. Each step is wrong
    by a digit, and a multiple of the grid by what all steps before it leave unknown."""
    onto = square = 0.0
    for step in steps:
        count = round(step / grid)
        rest, allowed = abs(step - count * grid), digit + count * wrong
        if allowed > _TOLD * grid or rest > allowed:
            return grid, allowed, max(rest, digit)
        onto, square = onto + count * step, square + count * count
        if square:
            # each step's standard deviation is a digit / sqrt(6)
            grid, wrong = onto / square, SURE * digit / np.sqrt(6.0 * square)
    return grid, wrong, 0.0


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
