"""Does a residual vary smoothly over a space: are rows that lie close together off in the same way?

    T = e' A e / e' e,    A = P K P,    K_nm = sum_d p_dn' p_dm k_nm  (n != m)

e: residual (rows of m numbers, stacked), P: projection onto what the fitted parameters leave, k: closeness of
two rows, p_d: patterns along which something could move. For white noise e / |e| is a random direction, so
that the first three moments of T follow from traces of powers of A; they are matched by a shifted gamma
(score test of a variance component, Lin 1997). Where noise differs from place to place (it grows with the
distance from a tracker) T is another one on average, for P leaves a row more or less of itself,

    sum_n f_n' A_nn f_n / e' e,    f_n = P_nn^-1/2 e_n    (MacKinnon and White 1985, HC2)

and scatters by what the signs of the rows alone make of it (wild signs, Wu 1986); the larger ones count. No
bins: it works where poses are few and the space has several dimensions.
"""

from __future__ import annotations

import numpy as np
from scipy import special

_LEAST_SKEW = 1e-3
_ROUNDING = 1e-12
_LEAST_LEFT = 0.05  # of a row that nearly fits itself


def follows_space(residual: np.ndarray, basis: np.ndarray, patterns: list[np.ndarray],
                  kernel: np.ndarray) -> tuple[float, float]:
    """p-value, and the share of the square sum that the smooth part accounts for (method of moments).

    residual (N, m), free of `basis` (N m, b, orthonormal); patterns, each (N, m); kernel (N, N) of unit
    diagonal.
    """
    apart = kernel - np.diag(np.diag(kernel))
    rows, m = residual.shape
    full = sum(pattern[:, :, None, None] * pattern[None, None] for pattern in patterns)
    full = (full * apart[:, None, :, None]).reshape(rows * m, rows * m)
    onto = full @ basis
    cross = basis @ onto.T
    a = full - cross - cross.T + basis @ ((basis.T @ onto) @ basis.T)
    e, freedom = residual.ravel(), rows * m - basis.shape[1]
    square = float(e @ e)
    if freedom < 2 or square <= 0.0:
        return 1.0, 0.0
    first, second = float(np.trace(a)), float(np.sum(a**2))
    third = float(np.sum((a @ a) * a))
    mean = first / freedom
    spread = second - first * mean
    if not spread > _ROUNDING * second:  # no two rows are close, or the fit has taken what they share
        return 1.0, 0.0
    own = np.einsum("ninj->nij", a.reshape(rows, m, rows, m))
    deviation = (float(e @ a @ e) - max(mean * square, _own_part(residual, basis, own))) / square
    variance = 2.0 * spread / (freedom * (freedom + 2.0))
    skewed = 8.0 * (third - 3.0 * mean * second
                    + 2.0 * mean**2 * first) / (freedom * (freedom + 2.0) * (freedom + 4.0))
    skew = max(skewed / variance**1.5, _LEAST_SKEW)
    shape = 4.0 / skew**2
    between = np.einsum("ni,nimj,mj->nm", residual, a.reshape(rows, m, rows, m), residual, optimize=True)
    by_signs = 2.0 * (np.sum(between**2) - np.sum(np.diag(between) ** 2)) / square**2
    at = shape + np.sqrt(shape) * deviation / np.sqrt(max(variance, by_signs))
    p_value = float(special.gammaincc(shape, at)) if at > 0.0 else 1.0
    size = deviation / spread * sum(float(np.sum(pattern**2)) for pattern in patterns)
    return p_value, min(max(size, 0.0), 1.0)


def _own_part(residual: np.ndarray, basis: np.ndarray, own: np.ndarray) -> float:
    """Sum of f_n' A_nn f_n; own (N, m, m): A_nn."""
    rows, m = residual.shape
    of_row = basis.reshape(rows, m, -1)
    values, vectors = np.linalg.eigh(np.eye(m) - of_row @ np.swapaxes(of_row, 1, 2))
    along = np.einsum("nij,ni->nj", vectors, residual) / np.sqrt(np.maximum(values, _LEAST_LEFT))
    turned = np.einsum("nij,nj->ni", vectors, along)
    return float(np.einsum("ni,nij,nj->", turned, own, turned))


def closeness(points: np.ndarray, reach: float | np.ndarray) -> np.ndarray:
    """(N, N) Gaussian kernel of points (N, d); `reach` (d,) where it has fallen to exp(-1/2)."""
    scaled = points / reach
    square = np.sum(scaled**2, axis=1)
    return np.exp(-0.5 * np.maximum(square[:, None] + square - 2.0 * scaled @ scaled.T, 0.0))


def second_order(angles: np.ndarray) -> np.ndarray:
    """(N, b) columns of a second-order surface: every angle, its square, and every product of two (Box and
    Wilson 1951)."""
    scaled = (angles - angles.mean(axis=0)) / np.maximum(np.std(angles, axis=0), 1e-12)
    products = [scaled[:, i] * scaled[:, j] for i in range(scaled.shape[1]) for j in range(i + 1)]
    return np.stack([np.ones(len(scaled)), *scaled.T, *products], axis=1)
