"""How well a curve of an angle is known, angle by angle, gaps between the measured angles included.

A curve g(x) of the output angle x (rad, one turn), a sum of regularised waves, has after a fit the
coefficients' covariance C. Around its mean over the measured angles, which is the joint's zero,

    sd(x)^2 = (B(x) - mean B) C (B(x) - mean B)',    w(x) = max(0, 1 - sd(x)^2 / prior^2),
    prior^2 = sum of the waves' prior variances,

w is the share of the prior's variance that the data have removed: 1 where the curve was measured, 0 where
nothing is known. The standard deviations stand on a grid of `POINTS` angles in the robot file. The curve
itself is used as it is: its slow waves and the geometry were estimated together, and its mean plus w times
the rest in its place parts them (series B of the UR10 to C 0.709 mm instead of 0.428, C to B 0.475 instead
of 0.454).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # scipy.interpolate is imported at its first use

from exactarm.numerics.quadratic import variances

POINTS = 120  # every 3 degrees: waves of order 40 are 9 degrees long
_WRAPPED = 3  # grid points repeated at either end of the turn
_HALF = 0.5  # w from which an angle counts as measured
_DIGITS = 3  # of a standard deviation in the robot file
_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class KnownCurve:
    """sd (POINTS,) rad at the angles 0, 3 ... 357 degrees; prior in rad."""

    sd: tuple[float, ...]
    prior: float

    @staticmethod
    def of(basis: Callable[[np.ndarray], np.ndarray], covariance: np.ndarray,
           prior: float, measured: np.ndarray) -> KnownCurve:
        """basis: angles (N,) -> (N, k) of coefficients with covariance (k, k); measured (N,) angles, rad."""
        seen = basis(measured)
        mean = seen.mean(axis=0)
        around = basis(_TURN * np.arange(POINTS) / POINTS) - mean
        variance = variances(around, covariance)
        sd = tuple(float(f"{value:.{_DIGITS}g}") for value in np.sqrt(np.maximum(variance, 0.0)))
        return KnownCurve(sd, prior)

    def to_table(self) -> dict[str, float | list[float]]:
        """Keys of a robot file."""
        return {"prior_rad": self.prior, "sd_rad": list(self.sd)}

    @staticmethod
    def from_table(table: Mapping[str, Any]) -> KnownCurve | None:
        """None where a file has no such keys; ValueError for numbers that are no standard deviations."""
        if "sd_rad" not in table:
            return None
        sd = tuple(map(float, table["sd_rad"]))
        known = KnownCurve(sd, float(table["prior_rad"]))
        if len(known.sd) < _WRAPPED or not (known.prior > 0.0 and all(0.0 <= sd < np.inf for sd in known.sd)):
            raise ValueError("expected standard deviations of at least three angles, and a prior above zero")
        return known

    @cached_property
    def _weight(self) -> scipy.interpolate.PchipInterpolator:
        weight = np.clip(1.0 - (np.asarray(self.sd) / self.prior) ** 2, 0.0, 1.0)
        places = _TURN * np.arange(-_WRAPPED, len(weight) + _WRAPPED) / len(weight)
        around = np.take(weight, range(-_WRAPPED, len(weight) + _WRAPPED), mode="wrap")
        return scipy.interpolate.PchipInterpolator(places, around)

    def weight(self, angle: np.ndarray) -> np.ndarray:
        """w (N,)."""
        return self._weight(np.mod(angle, _TURN))

    def measured(self, angle: np.ndarray) -> np.ndarray:
        """(N,) bool: angles at which the data have removed half of the prior's variance or more."""
        return self.weight(angle) >= _HALF

    def deviation(self, angle: np.ndarray) -> np.ndarray:
        """(N,) rad: standard deviation, at most the prior's."""
        places = _TURN * np.arange(len(self.sd) + 1) / len(self.sd)
        return np.minimum(np.interp(np.mod(angle, _TURN), places, (*self.sd, self.sd[0])), self.prior)
