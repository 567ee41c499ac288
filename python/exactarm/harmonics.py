"""Harmonics of a gear as an angle: the transmission error that (2.13) adds to a constant ratio.

    u(phi) = ratio (1 + sum_j a_j cos(w_j phi) - b_j sin(w_j phi))               thesis (2.10), E5
    e(phi) = sum_j (a_j sin(w_j phi) + b_j (cos(w_j phi) - 1)) / w_j             theta / ratio = phi + e(phi)

phi (N,) rad at the output, w (m,) cycles per output revolution, a, b (m,) relative to the ratio.
"""

from __future__ import annotations

import numpy as np

_TOLERANCE_RAD = 1e-14
_PASSES = 12


def waves(phi: np.ndarray, orders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """sin(w phi) and cos(w phi), (N, m); multiples of the first order by recurrence, which is much faster."""
    if len(orders) > 2 and np.array_equal(orders, orders[0] * np.arange(1, len(orders) + 1)):
        turn = np.exp(1j * orders[0] * phi)
        powers = np.cumprod(np.broadcast_to(turn[:, None], (len(phi), len(orders))), axis=1)
        return powers.imag, powers.real
    angle = phi[:, None] * orders
    return np.sin(angle), np.cos(angle)


def basis(phi: np.ndarray, orders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """de/da (N, m) and de/db (N, m)."""
    sine, cosine = waves(phi, orders)
    return sine / orders, (cosine - 1.0) / orders


def transmission_error(phi: np.ndarray, orders: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """e (N,) in rad."""
    sine, cosine = basis(phi, orders)
    return sine @ a + cosine @ b


def transmission_slope(phi: np.ndarray, orders: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """de/dphi (N,) = u / ratio - 1."""
    sine, cosine = waves(phi, orders)
    return cosine @ a - sine @ b


def delivered_angle(
    phi: np.ndarray,
    orders: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    factor: np.ndarray | float = 1.0,
    tolerance: float = _TOLERANCE_RAD,
) -> np.ndarray:
    """The angle x (N,) with x + factor e(x) = phi, by Newton; factor (N,) scales the error row by row."""
    x = phi
    for _ in range(_PASSES):
        sine, cosine = waves(x, orders)
        slope = np.maximum(1.0 + factor * (cosine @ a - sine @ b), 0.1)
        error = sine @ (a / orders) + cosine @ (b / orders) - np.sum(b / orders)
        step = (x + factor * error - phi) / slope
        x = x - step
        if np.max(np.abs(step), initial=0.0) < tolerance:
            break
    return x
