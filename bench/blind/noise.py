"""Noise of a drawn case: Gaussian or Student-t, with or without a memory, even or uneven in components."""

from __future__ import annotations

import numpy as np

from blind.conditions import Conditions


def draw_noise(
    conditions: Conditions,
    shape: tuple[int, int],
    random,
    group=None,
    rows_per_memory: float = 1.0,
    joined: bool = False,
) -> np.ndarray:
    """(N, c) of unit variance: Gaussian or Student-t, with a memory where the conditions say so.

    group (N,): where the memory begins anew; rows_per_memory: rows per unit of `conditions.memory`;
    joined: the components of one row of heavy-tailed noise are large together (one bad reading).
    """
    noise = random.normal(size=shape)
    if np.isfinite(conditions.freedom):
        width = random.chisquare(conditions.freedom, (shape[0], 1 if joined else shape[1]))
        noise *= np.sqrt((conditions.freedom - 2.0) / width)
    if conditions.memory > 0.0:
        noise = np.sqrt(0.5) * (
            noise + with_memory(random.normal(size=shape), conditions.memory * rows_per_memory, group)
        )
    return noise


def with_memory(noise: np.ndarray, memory_rows: float, group=None) -> np.ndarray:
    """First-order autoregression of unit variance that forgets in `memory_rows`, from white noise."""
    keep = np.exp(-1.0 / memory_rows)
    group = np.zeros(len(noise)) if group is None else group
    out = noise.copy()
    for k in range(1, len(out)):
        if group[k] == group[k - 1]:
            out[k] = keep * out[k - 1] + np.sqrt(1.0 - keep**2) * noise[k]
    return out


def component_noise(conditions: Conditions, count: int, random) -> np.ndarray:
    """(count,) noise of the components beside each other, mean square 1."""
    if conditions.spread == 1.0:
        return np.ones(count)
    share = random.permutation(np.geomspace(1.0, conditions.spread, max(count, 2)))[:count]
    return share / np.sqrt(np.mean(share**2))
