"""What the final model leaves, over the signal that it follows most plainly: the picture of a cause that
nobody wrote down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.diagnose.contribution import movement_along, subsampled, unit_of
from exactarm.diagnose.dossier import Dossier
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.signal import Direction, Signal


@dataclass(frozen=True)
class LeftOver:
    """The residual (K,) along `direction` over a signal x (K,) of the fitted rows, in SI units."""

    signal: Signal
    signal_unit: str
    direction: Direction
    unit: str
    x: np.ndarray
    residual: np.ndarray


def left_over(problem: Problem, fitted: Fitted, dossier: Dossier) -> LeftOver | None:
    """Over the signal of the smallest p-value; None where none is followed beyond chance, or only several
    together."""
    signals, directions = problem.signals(fitted), problem.directions(fitted)
    for each in dossier.follows:
        if each.significant and each.signal in signals and each.direction in directions:
            moved = movement_along(fitted, fitted.residual, directions[each.direction])
            rows = subsampled(signals[each.signal])
            rows = rows[fitted.weight[rows] > 0.0]
            unit = each.direction.unit_beside(problem.unit)
            return LeftOver(each.signal, unit_of(each.signal), each.direction, unit,
                            signals[each.signal][rows], moved[rows])
    return None
