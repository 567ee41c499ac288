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
    parts, order = _predicted(fitted, columns, folds, prior)
    squares = np.empty(fitted.data_numbers)
    squares[order] = np.concatenate([answer - part @ values for part, answer, _, values in parts]) ** 2
    squares = np.sum(squares.reshape(len(folds), -1), axis=1)
    return np.bincount(folds if units is None else units, weights=squares)


def held_out_deviances(
    fitted: Fitted, columns: np.ndarray | None, folds: np.ndarray, prior: np.ndarray | None = None
) -> np.ndarray:
    """(folds,) -2 log density, up to a constant, of each fold as the others predict it, with the uncertainty
    of their prediction:

        e' V^-1 e + log det V,    V = I + X C X',    C: covariance of the coefficients without the fold

    by Woodbury's identity. Where a fold lies far from the others, what they cannot know of it is no error of
    the model.
    """
    found = []
    for part, answer, rest, values in _predicted(fitted, columns, folds, prior)[0]:
        error = answer - part @ values
        known, all_of_it = linalg.cholesky(rest), linalg.cholesky(rest + part.T @ part)
        shared = linalg.solve_triangular(all_of_it, part.T @ error, trans=1)
        widened = np.sum(np.log(np.diag(all_of_it)) - np.log(np.diag(known)))
        found.append(float(error @ error - shared @ shared + 2.0 * widened))
    return np.array(found)


def held_out_unknown(
    fitted: Fitted, columns: np.ndarray | None, folds: np.ndarray, prior: np.ndarray | None = None
) -> np.ndarray:
    """(folds,) what the square sums of `held_out_squares` are expected to hold beside the noise, if the
    model is right: trace of X C X', for what the others do not know of the coefficients."""
    parts = _predicted(fitted, columns, folds, prior)[0]
    return np.array([np.sum(linalg.solve_triangular(linalg.cholesky(rest), part.T, trans=1) ** 2)
                     for part, _, rest, _ in parts])


def _predicted(fitted: Fitted, columns: np.ndarray | None, folds: np.ndarray, prior: np.ndarray | None):
    """Of each fold its rows of the design, its residual, the others' normal equations and the coefficients
    that they give; and the order (R,) of the numbers by folds."""
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
    own = design[numbers:]  # rows of no fold
    grams = [part.T @ part for part, _ in parts]
    normal, right = sum(grams) + own.T @ own + np.diag(penalty), design.T @ residual
    predicted = []
    for gram, (part, answer) in zip(grams, parts):
        rest = normal - gram + 1e-10 * np.eye(len(normal))
        values = linalg.solve(rest, right - part.T @ answer, assume_a="pos")
        predicted.append((part, answer, rest, values))
    return predicted, order
