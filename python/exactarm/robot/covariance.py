"""Joint covariance of estimated parameters, as a robot file carries it.

C = F F', F (P, r): principal axes times their standard deviations, so that rounding leaves it a covariance.
Beside it the standard deviation of what the fit left in a coordinate of the position (device and model).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

_DIGITS = 6
_SMALLEST = 1e-12  # of the largest eigenvalue of the correlation: below is rounding


@dataclass(frozen=True)
class ParameterCovariance:
    """names (P,) of parameters as in [intervals]; factor (P, r); noise_m: of one coordinate, m."""

    names: tuple[str, ...]
    factor: tuple[tuple[float, ...], ...]
    noise_m: float

    @staticmethod
    def of(names: tuple[str, ...], covariance: np.ndarray, noise_m: float) -> ParameterCovariance:
        sd = np.sqrt(np.diag(covariance))
        scale = np.where(sd > 0.0, sd, 1.0)
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        keep = values > _SMALLEST * values.max(initial=0.0)
        factor = scale[:, None] * vectors[:, keep] * np.sqrt(values[keep])
        rows = tuple(tuple(float(f"{v:.{_DIGITS}g}") for v in row) for row in factor)
        return ParameterCovariance(tuple(names), rows, float(noise_m))

    def matrix(self) -> np.ndarray:
        """(P, r) the factor."""
        return np.array(self.factor, float).reshape(len(self.names), -1)

    def to_table(self) -> dict[str, Any]:
        factor = [list(row) for row in self.factor]
        return {"names": list(self.names), "noise_m": self.noise_m, "factor": factor}

    @staticmethod
    def from_table(table: Mapping[str, Any]) -> ParameterCovariance:
        """KeyError, TypeError or ValueError where it is none."""
        names, noise = tuple(str(name) for name in table["names"]), float(table["noise_m"])
        factor = tuple(tuple(float(v) for v in row) for row in table["factor"])
        if len(factor) != len(names) or len({len(row) for row in factor}) > 1 or not 0.0 <= noise < np.inf:
            raise ValueError("one row of the factor for each name, and a noise of zero or more")
        if not all(np.isfinite(v) for row in factor for v in row):
            raise ValueError("finite numbers")
        return ParameterCovariance(names, factor, noise)
