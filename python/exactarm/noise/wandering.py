"""Noise that neighbouring rows share: an instrument that wanders or jumps from time to time.

    cov(e_i, e_k) = base + sigma^2 ratio exp(-|t_i - t_k| / memory)

t: the order of the rows, sessions far apart (Uhlenbeck and Ornstein 1930: a first-order autoregression where
rows are missing). ratio and memory by likelihood over a grid, from residuals that the base has made
independent; accepted where the likelihood pays for both and for the search.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MEMORIES = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)  # rows; the longest are drifts
SESSIONS_APART = 1e4  # rows between sessions: the device was set up anew
_RATIOS = np.geomspace(0.05, 400.0, 40)
_PARAMETERS = 2.0
_LEAST_NATS = 3.0  # above the price of the parameters: 1 in 20, beside rows that share nothing
_NOTICED = 2.0  # standard deviations of the lag-one correlation, below which the likelihood is not asked


@dataclass(frozen=True)
class Wandering:
    """ratio: variance of what neighbours share over that of one row alone; memory in rows; gain in log
    likelihood; scale: variance of one row alone, over that of the residuals."""

    ratio: float
    memory: float
    gain: float
    scale: float = 1.0


def kernel(order: np.ndarray, memory: float) -> np.ndarray:
    """(N, N) correlation of what rows at the places `order` (N,) share."""
    return np.exp(-np.abs(order[:, None] - order[None, :]) / memory)


def wandering_of(white: np.ndarray, order: np.ndarray, through) -> Wandering | None:
    """From (N, m) residuals of unit variance; through(K): the kernel as the same whitening sees it.

    None where rows share nothing."""
    if not _neighbours_agree(white, order):
        return None
    each = [_fitted(white, through(kernel(order, memory)), memory) for memory in MEMORIES]
    best = max(each, key=lambda wandering: wandering.gain)
    least = 0.5 * _PARAMETERS * np.log(len(white)) + _LEAST_NATS
    return best if best.gain > least else None


def gain_of(white: np.ndarray, order: np.ndarray, through, ratio: float, memory: float) -> float:
    """Log likelihood of (N, m) residuals with a known wandering, less that without; scale fitted in both."""
    values, turned = _turned(white, through(kernel(order, memory)))
    return float(_gain(turned, values, np.array([ratio]), white)[0])


def _neighbours_agree(white: np.ndarray, order: np.ndarray) -> bool:
    z = white[np.argsort(order, kind="stable")]
    products, squares = float(np.sum(z[1:] * z[:-1])), float(np.sum(z**2))
    return products > _NOTICED * squares / np.sqrt(z.size)


def _fitted(white: np.ndarray, correlation: np.ndarray, memory: float) -> Wandering:
    values, turned = _turned(white, correlation)
    gains = _gain(turned, values, _RATIOS, white)
    best = int(np.argmax(gains))
    scale = float(np.sum(turned / (1.0 + _RATIOS[best] * values)) / np.sum(turned))
    return Wandering(float(_RATIOS[best]), memory, float(gains[best]), scale)


def _turned(white: np.ndarray, correlation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    values, vectors = np.linalg.eigh(correlation)
    return np.maximum(values, 0.0), np.sum((vectors.T @ white) ** 2, axis=1)


def _gain(square: np.ndarray, values: np.ndarray, ratios: np.ndarray, white: np.ndarray) -> np.ndarray:
    """For each ratio; square (N,): square sums of the residuals along the kernel's eigenvectors."""
    seen = 1.0 + ratios[:, None] * values
    scale = np.sum(square / seen, axis=1) / np.sum(square)
    rows = np.count_nonzero(np.any(white, axis=1))
    return -0.5 * white.shape[1] * (rows * np.log(scale) + np.sum(np.log(seen), axis=1))
