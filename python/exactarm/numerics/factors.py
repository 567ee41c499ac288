"""Singular values, least squares and triangular factors that always end.

LAPACK's divide and conquer (gesdd, gelsd) is fast, and now and then does not converge on a finite matrix
whose columns depend on each other, differently from one processor to another; QR iterations (gesvd) then do.
Arguments and results are those of numpy.linalg.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg


def svd(matrix: np.ndarray, full_matrices: bool = True, compute_uv: bool = True):
    """u (..., m, k), values (..., k), vt (..., k, n) of matrices (..., m, n), or the values alone."""
    try:
        return np.linalg.svd(matrix, full_matrices=full_matrices, compute_uv=compute_uv)
    except np.linalg.LinAlgError:
        each = [_by_iterations(one, full_matrices) for one in matrix.reshape(-1, *matrix.shape[-2:])]
        u, values, vt = (np.stack(part).reshape(*matrix.shape[:-2], *part[0].shape) for part in zip(*each))
        return (u, values, vt) if compute_uv else values


def lstsq(matrix: np.ndarray, right: np.ndarray, rcond: float | None = None):
    """x, residuals, rank and singular values: the shortest x that makes matrix @ x nearest to right."""
    try:
        return np.linalg.lstsq(matrix, right, rcond=rcond)
    except np.linalg.LinAlgError:
        u, values, vt = _by_iterations(matrix, False)
        least = np.finfo(float).eps * max(matrix.shape) if rcond is None else rcond
        seen = values > least * values.max(initial=0.0)
        x = vt[seen].T @ ((u[:, seen].T @ right).T / values[seen]).T
        left = np.atleast_1d(np.sum((right - matrix @ x) ** 2, axis=0))
        whole = seen.all() and matrix.shape[0] > matrix.shape[1]
        return x, left if whole else np.zeros(0), int(seen.sum()), values


def pinv(matrix: np.ndarray, rcond: float = 1e-15) -> np.ndarray:
    """(..., n, m) pseudoinverses, of singular values above rcond times the largest of each."""
    u, values, vt = svd(matrix, full_matrices=False)
    seen = values > rcond * values.max(axis=-1, initial=0.0, keepdims=True)
    inverse = np.where(seen, 1.0 / np.where(seen, values, 1.0), 0.0)
    return np.swapaxes(vt, -1, -2) @ (inverse[..., None] * np.swapaxes(u, -1, -2))


def cholesky(matrix: np.ndarray) -> np.ndarray:
    """Lower factor of a positive semidefinite matrix; where rounding leaves it indefinite, with the least on
    its diagonal that does not."""
    more = np.finfo(float).eps * float(np.max(np.abs(np.diag(matrix)), initial=1.0))
    while np.isfinite(more):
        try:
            return np.linalg.cholesky(matrix)
        except np.linalg.LinAlgError:
            matrix, more = matrix + more * np.eye(len(matrix)), 10.0 * more
    raise np.linalg.LinAlgError("a number is not finite")


def _by_iterations(matrix: np.ndarray, full_matrices: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Not finite: LinAlgError, as from the other."""
    if not np.isfinite(matrix).all():
        raise np.linalg.LinAlgError("a number is not finite")
    return linalg.svd(matrix, full_matrices=full_matrices, lapack_driver="gesvd", check_finite=False)
