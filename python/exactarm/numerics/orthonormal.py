"""Orthonormal bases of tall matrices, whose columns may be nearly dependent."""

from __future__ import annotations

import numpy as np
from scipy import linalg
from scipy.linalg import lapack

from exactarm.numerics.factors import svd

# Least of the Cholesky factor of columns of unit length: above the first, one pass is orthonormal to
# 1e-11 (rounding over its square); below the second, the Gram matrix loses a direction.
_APART, _NEARLY = 1e-2, 1e-4
_ROUNDING = 1e-13  # length beside the longest column, below which one would be zero without rounding


def orthonormal(columns: np.ndarray, weakest: float = 1e-6) -> np.ndarray:
    """Orthonormal basis (R, b) of the span of `columns`: Cholesky QR, where they are not well apart twice for
    accuracy (Yamamoto et al. 2015).

    Far faster than a rank-revealing factorisation for tall matrices. Where the columns are nearly dependent,
    the eigenvectors of their Gram matrix serve, without the directions weaker than `weakest` (beside the
    strongest; above 3e-8, where the Gram matrix shows rounding only).
    """
    basis = _of_unit_length(columns)
    basis, apart = _whitened(basis, weakest)
    return basis if apart else _whitened(basis, weakest)[0]


def shown(columns: np.ndarray, weakest: float) -> np.ndarray:
    """(R, b) the same of directions that may be as weak as rounding allows (1e-14 of the strongest), by
    singular values: slower."""
    norm = np.linalg.norm(columns, axis=0)
    basis, values, _ = svd(columns[:, norm > 0.0] / norm[norm > 0.0], full_matrices=False)
    return basis[:, values > weakest * values.max(initial=0.0)]


def extended(basis: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """(R, b + c) an orthonormal basis with what columns (R, k) add to it."""
    return np.concatenate([basis, added_to(basis, columns)], axis=1)


def added_to(basis: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """(R, c) what columns (R, k) add to an orthonormal basis, orthonormal too, without what is weaker than
    1e-6."""
    added = _of_unit_length(columns)
    for least in (1e-12, 0.5):  # twice for accuracy: the second time all are of unit length
        added = added - basis @ (basis.T @ added)
        values, vectors = linalg.eigh(added.T @ added)
        added = added @ (vectors[:, values > least] / np.sqrt(values[values > least]))
    return added


def narrowed(basis: np.ndarray, coordinates: np.ndarray, gone: np.ndarray) -> np.ndarray:
    """(R, c) an orthonormal basis of the c columns that stay, of all (R, b) that `basis` (R, b) spans.

    coordinates (b, b): inverse of the columns' coordinates in the basis; its rows are orthogonal to every
    column but their own. gone (b,) bool: the columns that do not stay. The basis is turned by reflections
    until its first columns are orthogonal to all that stays.
    """
    turn, tau, _, _ = lapack.dgeqrf(coordinates[gone].T)
    work = int(lapack.dormqr("R", "N", turn, tau, basis, -1)[1][0])
    return lapack.dormqr("R", "N", turn, tau, basis, work)[0][:, len(tau) :]


def _of_unit_length(columns: np.ndarray) -> np.ndarray:
    """Those that are there."""
    norm = np.linalg.norm(columns, axis=0)
    seen = norm > _ROUNDING * np.max(norm, initial=0.0)
    return columns[:, seen] / norm[seen]


def _whitened(basis: np.ndarray, weakest: float) -> tuple[np.ndarray, bool]:
    """A basis that is more orthonormal, and whether it is so to rounding."""
    if not basis.shape[1]:
        return basis, True
    gram = basis.T @ basis
    try:
        factor = linalg.cholesky(gram, lower=True, check_finite=False)
        least = np.diag(factor).min()
        if least > _NEARLY:
            return linalg.solve_triangular(factor, basis.T, lower=True, check_finite=False).T, least > _APART
    except linalg.LinAlgError:
        pass
    values, vectors = linalg.eigh(gram)
    keep = values > weakest**2 * values[-1]
    return basis @ (vectors[:, keep] / np.sqrt(values[keep])), False
