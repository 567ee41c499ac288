"""Held-out error of a candidate by cross-validation over whole poses or runs, in closed form.

In the linear picture around a fitted state, each fold is predicted from the others' normal equations; the
error is the mean weighted square of the held-out residual (1 = all noise).
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from exactarm.diagnose.problem import Fitted

_FOLDS = 10


def folds_of(groups: np.ndarray, seed: int) -> np.ndarray:
    """(N,) fold number from 0; a group stays whole."""
    names, inverse = np.unique(groups, return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(names))
    return (order % min(_FOLDS, len(names)))[inverse]


def held_out_squares(
    fitted: Fitted,
    columns: np.ndarray | None,
    folds: np.ndarray,
    prior: np.ndarray | None = None,
    units: np.ndarray | None = None,
) -> np.ndarray:
    """(units,) square sum of the held-out residual with the free parameters and `columns` (R, k), if any,
    refitted.

    prior (k,): standard deviations of the priors of the columns' coefficients, inf = none. units (N,): what
    the square sum is told by, numbers from 0; absent: the folds.
    """
    design = fitted.basis if columns is None else np.concatenate([fitted.basis, columns], axis=1)
    penalty = np.zeros(design.shape[1])
    if prior is not None:
        penalty[fitted.basis.shape[1] :] = 1.0 / prior**2
    norm = np.linalg.norm(design, axis=0)
    size = np.sqrt(norm**2 + penalty)[norm > 0]  # a column of rounding is its prior
    design, penalty = design[:, norm > 0] / size, penalty[norm > 0] / size**2
    residual, numbers = fitted.whitened, fitted.data_numbers
    order = np.argsort(np.repeat(folds, numbers // len(folds)), kind="stable")
    ends = np.cumsum(np.bincount(folds) * (numbers // len(folds)))
    parts = [(design[rows], residual[rows]) for rows in np.split(order, ends[:-1])]
    prior = design[numbers:]  # rows of no fold
    grams = [part.T @ part for part, _ in parts]
    normal, right = sum(grams) + prior.T @ prior + np.diag(penalty), design.T @ residual
    held_out = []
    for gram, (part, answer) in zip(grams, parts):
        rest = normal - gram
        values = linalg.solve(rest + 1e-10 * np.eye(len(rest)), right - part.T @ answer, assume_a="pos")
        held_out.append(answer - part @ values)
    squares = np.empty(numbers)
    squares[order] = np.concatenate(held_out) ** 2
    squares = np.sum(squares.reshape(len(folds), -1), axis=1)
    return np.bincount(folds if units is None else units, weights=squares)
