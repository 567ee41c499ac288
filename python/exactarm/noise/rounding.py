"""What the rounding of reported angles does to rows: an error of known size.

    L_ik = J_ik step_k / sqrt(12),     J_ik (m,): what a unit turn of axis k does to row i

(uniform within half a step). Poses that are reached again are rounded alike and err alike; a stretched arm
errs more. Rows are `evened` so that their scatter tells the rest of the noise:

    (1 + L_i L_i' / sigma^2)^(-1/2) e_i     has the variance sigma^2 of a row without rounding.
"""

from __future__ import annotations

import numpy as np

_PASSES = 40
_SETTLED = 1e-3  # of a scale: rows weigh the same
_GROSS = 25.0  # times the median square: rows that are wrong by themselves tell nothing of the scale


def evened(residual: np.ndarray, rounding: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """Rows (N, m) as they would scatter without rounding (N, m, n); kinds: how many components are alike."""
    rounding = rounding @ np.swapaxes(rounding, 1, 2)
    sigma = np.sqrt(_mean_squares(residual, kinds))
    for _ in range(_PASSES):
        each = np.repeat(sigma, kinds)
        value, vector = np.linalg.eigh(rounding / np.outer(each, each))
        part = 1.0 / np.sqrt(1.0 + np.maximum(value, 0.0))
        rows = np.einsum("nij,nj,nkj,nk->ni", vector, part, vector, residual / each, optimize=True)
        change = np.sqrt(_mean_squares(rows, kinds))
        if np.all(np.abs(change - 1.0) < _SETTLED):
            break
        sigma *= np.maximum(change, 1e-3)
    return rows * each


def _mean_squares(rows: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """Of a component of each kind, without rows that are far wider than the middle one."""
    squares = np.add.reduceat(rows**2, np.cumsum(kinds) - kinds, axis=1)
    median = np.median(squares, axis=0)
    used = np.all(squares <= _GROSS * median, axis=1)
    return np.maximum(np.mean(squares[used], axis=0) / kinds, 1e-30)
