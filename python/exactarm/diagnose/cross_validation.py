"""Held-out error of a candidate by cross-validation over whole poses or runs, in closed form.

In the linear picture around a fitted state, each fold is predicted from the others' normal equations; the error
is the mean weighted square of the held-out residual (1 = all noise).
"""

from __future__ import annotations

import numpy as np

from exactarm.diagnose.problem import Fitted

FOLDS = 10


def folds_of(groups: np.ndarray, seed: int, folds: int = FOLDS) -> np.ndarray:
    """(N,) fold number from 0; a group stays whole."""
    names, inverse = np.unique(groups, return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(names))
    return (order % min(folds, len(names)))[inverse]


def held_out_squares(fitted: Fitted, columns: np.ndarray, folds: np.ndarray) -> np.ndarray:
    """(folds,) square sum of the held-out residual with the free parameters and `columns` (R, k) refitted."""
    design = np.concatenate([fitted.basis, columns], axis=1)
    norm = np.linalg.norm(design, axis=0)
    design = design[:, norm > 0] / norm[norm > 0]
    residual = fitted.whitened
    fold_of_row = np.repeat(folds, residual.size // len(folds))
    normal, right = design.T @ design, design.T @ residual
    squares = []
    for fold in range(int(folds.max()) + 1):
        rows = fold_of_row == fold
        part, answer = design[rows], residual[rows]
        rest = normal - part.T @ part
        values = np.linalg.lstsq(rest, right - part.T @ answer, rcond=1e-10)[0]
        squares.append(float(np.sum((answer - part @ values) ** 2)))
    return np.array(squares)
