"""Harmonics of a gear as an angle: the transmission error that (2.13) adds to a constant ratio.

    u(phi) = ratio (1 + sum_j a_j cos(w_j phi) - b_j sin(w_j phi))               thesis (2.10), E5
    e(phi) = sum_j (a_j sin(w_j phi) + b_j (cos(w_j phi) - 1)) / w_j             theta / ratio = phi + e(phi)

phi (N,) rad at the output, w (m,) cycles per output revolution, a, b (m,) relative to the ratio.
"""

from __future__ import annotations

import numpy as np

from exactarm import _core

_TOLERANCE_RAD = 1e-13


def waves(phi: np.ndarray, orders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """sin(w phi) and cos(w phi), (N, m)."""
    return _core.waves(phi, orders)


def basis(phi: np.ndarray, orders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """de/da (N, m) and de/db (N, m)."""
    sine, cosine = waves(phi, orders)
    return sine / orders, (cosine - 1.0) / orders


def delivered_angle(
    phi: np.ndarray, orders: np.ndarray, a: np.ndarray, b: np.ndarray, factor: np.ndarray | float = 1.0
) -> np.ndarray:
    """The angle x (N,) with x + factor e(x) = phi, by Newton; factor (N,) scales the error row by row."""
    return delivered(phi, orders, a, b, factor)[0]


def delivered(
    phi: np.ndarray, orders: np.ndarray, a: np.ndarray, b: np.ndarray, factor: np.ndarray | float = 1.0,
    threads: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """The delivered angle x (N,) and u / ratio - 1 there."""
    scaled = isinstance(factor, np.ndarray) or factor != 1.0
    factors = np.broadcast_to(factor, phi.shape) if scaled else np.zeros(0)
    return _core.delivered_angle(phi, orders, a, b, factors, _TOLERANCE_RAD, threads)
