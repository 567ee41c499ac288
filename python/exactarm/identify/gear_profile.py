"""Angle profile: the samples of one direction averaged into narrow cells of the output angle.

The error of a gear depends on its angle, so all runs of a direction fold onto one another. In a cell
    gyroscope:  value = sum rate output / sum rate^2,   model 1 / (1 + s(phi)), s = du/u0 by the harmonics
    encoders:   value = mean (angle - output),          model e(phi)
with weights sum rate^2 (count), which make the folded fit the fit of all samples as long as a cell is narrow
beside the shortest period.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincc

from exactarm import _core
from exactarm.identify.gear_samples import LEAST_SPEED_SHARE
from exactarm.numerics.signals import zoom

_CELL_PHASE_RAD = 0.25  # of the highest order
FALSE_ALARM = 1e-3


@dataclass(frozen=True)
class AngleProfile:
    """Cells of one direction: motor angle over the ratio (M,) rad, value (M,), weight (M,); `step`: cell
    width.

    sums over cells are sums over samples; `place` (M,) numbers the cells on the uniform grid.
    """

    angle: np.ndarray
    value: np.ndarray
    weight: np.ndarray
    place: np.ndarray
    step: float
    rated: bool

    @property
    def range_rev(self) -> float:
        return float(np.ptp(self.angle)) / (2.0 * np.pi)

    def normal(self, orders: np.ndarray, x: np.ndarray,
               with_orders: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """J' W J (P, P), J' W r (P,) and the residual r (M,) at x (2 m + 1,): all a, all b, the level.

        P = 2 m + 1, with the derivatives by the orders behind them 3 m + 1
        (cpp/exactarm/robot/gear_profile.hpp).
        """
        m = orders.size
        return _core.profile_normal(
            self.angle, self.value, self.weight, self.rated, orders, x[:m], x[m : 2 * m], float(x[-1]),
            with_orders)

    def spectrum(self, residual: np.ndarray, low: float, high: float,
                 count: int) -> tuple[np.ndarray, np.ndarray]:
        """Orders and complex weighted sums of residual exp(-i order angle) by the chirp-z zoom."""
        grid = np.zeros(int(self.place.max()) + 1)
        grid[self.place] = self.weight * residual
        orders, transform = zoom(grid, self.step, low, high, count)
        return orders, 0.5 * grid.size * transform

    def variance(self, residual: np.ndarray, spent: int = 0) -> float:
        """Residual variance per unit of weight."""
        return float(self.weight @ residual**2) / max(self.angle.size - spent, 1)

    def amplitude(self, residual: np.ndarray, low: float, high: float,
                  count: int) -> tuple[np.ndarray, np.ndarray]:
        """Orders and the relative amplitude (of the ratio) at each."""
        orders, sums = self.spectrum(residual, low, high, count)
        size = 2.0 * np.abs(sums) / self.weight.sum()
        return orders, size if self.rated else size * orders


def angle_profile(samples, chosen: np.ndarray, highest: float, scale: float, disturbance: np.ndarray):
    """Profile of the chosen rows; scale: true ratio over declared one; disturbance (N,): what to take out of
    the output."""
    chosen = fast_rows(samples, chosen)
    angle = samples.angle[chosen] / scale
    output = samples.output[chosen] - disturbance[chosen]
    step = _CELL_PHASE_RAD / highest
    place = ((angle - angle.min()) / step).astype(int)
    fold = lambda weights: np.bincount(place, weights=weights)
    count = np.bincount(place)
    full = np.flatnonzero(count)
    if samples.rated:
        rate = samples.rate[chosen] / scale
        weight = fold(rate**2)[full]
        value = fold(rate * output)[full] / weight
    else:
        weight = count[full].astype(float)
        value = fold(angle - output)[full] / weight
    centre = fold(angle)[full] / count[full]
    return AngleProfile(centre, value, weight, full, step, samples.rated)


def fast_rows(samples, chosen: np.ndarray) -> np.ndarray:
    """(N,) bool: the chosen rows that a profile is made of."""
    if not samples.rated:
        return chosen
    speed = np.abs(samples.rate)
    return chosen & (speed > LEAST_SPEED_SHARE * np.max(speed[samples.keep], initial=0.0))


def highest_order(samples) -> float:
    """That the samples of a gear can tell: five per motor revolution or Nyquist's."""
    spacing = np.median(np.abs(np.diff(samples.angle))[samples.keep[1:]])
    return min(5.0 * max(abs(samples.ratio), 20.0), 0.8 * np.pi / max(spacing, 1e-12))


def false_alarm(power: float, profiles: int, range_rev: float, low: float, high: float) -> float:
    """Probability that noise alone shows a peak so high somewhere in the band (Scargle 1982; sum over
    profiles).

    power: sum over profiles of |sum w r exp|^2 / (variance sum w), each exponential with mean 1 under noise.
    """
    single = float(gammaincc(profiles, power))
    independent = max(1.0, range_rev * (high - low))
    return float(-np.expm1(independent * np.log1p(-min(single, 1.0 - 1e-16))))

