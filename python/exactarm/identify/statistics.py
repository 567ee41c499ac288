"""Summary of Euclidean errors: n, mean, rms, max, min, std, all of the same rows."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ErrorSummary:
    """Statistics of one set of errors in the unit of the errors. NaN where the set is empty."""

    n: int
    mean: float
    rms: float
    max: float
    min: float
    std: float

    def to_json(self) -> dict[str, float | int]:
        return {k: getattr(self, k) for k in ("n", "mean", "rms", "max", "min", "std")}


def summarise(errors: np.ndarray) -> ErrorSummary:
    """Summary of non-negative errors (N,), for instance Euclidean position errors in m."""
    errors = np.asarray(errors, float)
    if errors.size == 0:
        return ErrorSummary(0, *[float("nan")] * 5)
    rms = float(np.sqrt(np.mean(errors**2)))
    return ErrorSummary(int(errors.size), float(errors.mean()), rms, float(errors.max()), float(errors.min()),
                        float(errors.std()))
