"""Own share of an effect: of the held-out square sum of the model without it, what it takes away, with all
others in the model.

    share = 1 - S / S_without;  without it, the other parameters are fitted anew (linear picture, with their
    priors: curves that the data hold in check only by them would run away on rows that were not fitted).
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem

_RIDGE = 1e-10  # of a column's square sum: what the data cannot tell stays where it is


def own_shares(problem: Problem, fitted: Fitted, first: int) -> tuple[float, ...] | None:
    """Of every effect of the layout from the place `first` on; None where the kind of data has no target."""
    judged = problem.held_out_picture(fitted)
    if judged is None:
        return None
    residual, jacobian = judged
    scale = fitted.sigma
    square = float(np.sum((residual / scale) ** 2))
    design = fitted.design
    rows = fitted.data_numbers
    norm = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    gram = design.T @ design / np.outer(norm, norm) + _RIDGE * np.eye(len(norm))
    found = []
    for place in range(first, len(fitted.layout.effects)):
        where = fitted.layout.slices[place]
        linear = np.array([not p.search for p in fitted.layout.parameters[where]], bool)
        values = np.where(linear, fitted.layout.values[where], 0.0)
        rest = np.delete(np.arange(fitted.layout.size), np.arange(where.start, where.stop))
        onto = design[:rows, rest].T @ (design[:rows, where] @ values) / norm[rest]
        step = linalg.solve(gram[np.ix_(rest, rest)], onto, assume_a="pos") / norm[rest]
        without = residual + jacobian[:, :, where] @ values - jacobian[:, :, rest] @ step
        found.append(1.0 - square / max(float(np.sum((without / scale) ** 2)), 1e-300))
    return tuple(found)
