"""How a gear passes from the table of one direction to that of the other about a reversal.

The share of each table follows the direction behind two moving means, each over half of the passage: it
leaves the old table at the moment of the reversal, and has reached the new one when the passage is over.
"""

from __future__ import annotations

import numpy as np


def passed(direction: np.ndarray, run: np.ndarray, step: float, passage_s: float) -> np.ndarray:
    """(N, n) directions -1 to 1 that take `passage_s` after each reversal, a parabola and its mirror image.

    direction: -1, 0, +1; an axis at rest keeps the direction in which it came to rest (before its first
    motion: that in which it will move).
    """
    half = max(1, round(0.5 * passage_s / step))
    out = np.empty(direction.shape)
    for number in np.unique(run):
        rows = np.flatnonzero(run == number)
        for axis in range(direction.shape[1]):
            out[rows, axis] = _boxed(_boxed(_kept(direction[rows, axis]), half), half)
    return out


def _kept(sign: np.ndarray) -> np.ndarray:
    """Zeros take the value before them, the first ones the first value that is not zero."""
    moving = np.flatnonzero(sign)
    if not moving.size:
        return np.zeros(len(sign))
    last = np.maximum.accumulate(np.where(sign != 0.0, np.arange(len(sign)), moving[0]))
    return sign[np.maximum(last, moving[0])].astype(float)


def _boxed(values: np.ndarray, length: int) -> np.ndarray:
    """Mean of each value and the `length - 1` before it."""
    total = np.cumsum(np.concatenate([np.full(length, values[0]), values]))
    return (total[length:] - total[:-length]) / length
