"""Noise that drifts: every sample keeps a part of the one before it (first-order autoregression).

    e_t = memory e_{t-1} + w_t,   w white with variance (1 - memory^2) var(e)

e_t - memory e_{t-1} (and sqrt(1 - memory^2) e at the first sample of a run) is white, so that a fit of it
gives slow and fast parts their proper weights (Prais and Winsten 1954). The noise between two encoders is of
this kind: eccentric discs, warmth and friction at rest move the angle slowly, and far more than the encoders'
steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_MOST = 0.97  # above it the slow part would count for nothing, and with it the offset of a run
_LEAST = 0.2


@dataclass(frozen=True)
class DriftingNoise:
    """runs: row indices in the order of time; memory (m,) of each component."""

    runs: tuple[np.ndarray, ...]
    memory: np.ndarray

    @staticmethod
    def of(residual: np.ndarray, runs: Sequence[np.ndarray]) -> DriftingNoise | None:
        """From a residual (N, m): the correlation of neighbouring samples. None where nothing drifts."""
        both = sum(np.sum(residual[run[1:]] * residual[run[:-1]], axis=0) for run in runs)
        memory = np.clip(both / np.maximum(np.sum(residual**2, axis=0), 1e-300), 0.0, _MOST)
        return DriftingNoise(tuple(runs), memory) if np.any(memory > _LEAST) else None

    def white(self, values: np.ndarray) -> np.ndarray:
        """(N, m, ...) behind the filter."""
        memory = self.memory.reshape((-1,) + (1,) * (values.ndim - 2))
        out = np.empty_like(values)
        for run in self.runs:
            x = values[run]
            out[run[1:]] = x[1:] - memory * x[:-1]
            out[run[:1]] = np.sqrt(1.0 - memory**2) * x[:1]
        return out
