"""One gear, from its samples to ratio, orders and coefficients per direction.

    gyroscope   output = rate / scale * 1 / (1 + s(phi)) + bias
    encoders    output = angle / scale - e(phi) + disturbances (offsets of the runs, delay, wind-up, friction)
with scale = true ratio over declared ratio. Ratio with disturbances and harmonics are fitted in turn until
they rest; both directions share the ratio. The bias is left at zero where nothing tells it from the ratio:
one direction at one speed without a standstill.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from exactarm.errors import InputError
from exactarm.harmonics import delivered
from exactarm.identify.gear_declared import SIDES
from exactarm.identify.gear_orders import Found, Table, find_orders, fit_all, order_uncertainty, whole_orders
from exactarm.identify.gear_profile import AngleProfile, angle_profile, highest_order
from exactarm.identify.gear_samples import GearSamples
from exactarm.robot import GearTable

_ROUNDS = 3
# of its standard deviation: ratio and harmonics, fitted in turn, have settled on each other
_RATIO_RESTS = 0.1
_SEARCH_ROUNDS = 2
_TELLS_BIAS = 1e-4  # share of the bias column that the rate cannot imitate
_LEAST_CELLS = 64
_LARGEST_FACTOR = 2.0  # between the measured ratio and the declared one


@dataclass(frozen=True)
class GearEstimate:
    """ratio and its standard deviation; tables and profiles by side ("cw", "ccw"); sigma of the orders (m,).

    disturbance (k,): coefficients of the samples' disturbance columns.
    """

    samples: GearSamples
    method: str
    ratio: float
    ratio_sigma: float
    disturbance: np.ndarray
    orders: np.ndarray
    order_sigma: np.ndarray
    tables: dict[str, Table]
    profiles: dict[str, AngleProfile]
    converged: bool

    @property
    def scale(self) -> float:
        return self.ratio / self.samples.ratio

    def gear_table(self, side: str) -> GearTable:
        table = self.tables[side]
        return GearTable(table.orders, table.a, table.b)


@dataclass(frozen=True)
class FirstLook:
    """Profiles by side with the first ratio, the band of orders that they can tell, and the whole numbers in
    it."""

    scale: float
    disturbance: np.ndarray
    sigma: float
    profiles: dict[str, AngleProfile]
    band: tuple[float, float]
    whole: Found


def first_look(samples: GearSamples) -> FirstLook | None:
    """What both methods begin with; None where there are too few identification rows."""
    fitted = samples.identification & samples.keep
    if fitted.sum() < _LEAST_CELLS:
        return None
    scale, disturbance, sigma = _ratio(samples, fitted, {}, 1.0)
    _require_like(samples, scale)
    profiles = _profiles(samples, fitted, scale, disturbance)
    if not profiles:
        return None
    sides = list(profiles.values())
    # from two periods within the range on
    band = 2.0 / max(profile.range_rev for profile in sides), highest_order(samples)
    nothing = fit_all(sides, np.zeros(0))
    whole = whole_orders(sides, band, nothing) if band[1] > band[0] else nothing
    return FirstLook(scale, disturbance, sigma, profiles, band, whole)


def identify_axis(samples: GearSamples, method: str, first: FirstLook) -> GearEstimate:
    """Estimate from the identification rows."""
    fitted = samples.identification & samples.keep
    scale, disturbance, sigma, profiles = first.scale, first.disturbance, first.sigma, first.profiles
    found = None
    for turn in range(_ROUNDS):
        if turn:
            profiles = _profiles(samples, fitted, scale, disturbance)
        sides, band = list(profiles.values()), first.band
        if turn < _SEARCH_ROUNDS and band[1] > band[0]:
            found = find_orders(sides, band, method, found, None if turn else first.whole)
        else:
            found = (
                fit_all(sides, np.zeros(0)) if found is None else fit_all(sides, found.orders, found.tables)
            )
        before = scale
        scale, disturbance, sigma = _ratio(samples, fitted, dict(zip(profiles, found.tables)), scale)
        settled = abs(scale - before) < _RATIO_RESTS * sigma
        if turn >= _SEARCH_ROUNDS - 1 and settled:
            break
    return GearEstimate(
        samples, method, samples.ratio * scale, abs(samples.ratio) * sigma, disturbance, found.orders,
        order_uncertainty(sides, found), dict(zip(profiles, found.tables)), profiles, bool(settled),
    )


def _require_like(samples: GearSamples, scale: float) -> None:
    """Refuses a reading that has nothing to do with the motor's: a unit or a ratio far off, another axis."""
    if not 1.0 / _LARGEST_FACTOR < scale < _LARGEST_FACTOR:
        sensor = "gyroscope" if samples.rated else "encoder behind the gear"
        raise InputError(
            f"axis {samples.axis + 1}: motor angle and {sensor} give a gear ratio of "
            f"{samples.ratio * scale:.4g} where the robot file has {samples.ratio:.4g}; expected less than a "
            f"factor {_LARGEST_FACTOR:.0f} between them: check units and ratio"
        )


def _profiles(samples, fitted, scale, disturbance) -> dict[str, AngleProfile]:
    beside = samples.disturbances @ disturbance
    sides = {side: fitted & samples.side(way) for side, way in SIDES.items()}
    sides = {side: rows for side, rows in sides.items()
             if rows.sum() >= _LEAST_CELLS and np.ptp(samples.angle[rows]) > 0}
    return {
        side: angle_profile(samples, rows, SIDES[side], highest_order(samples), scale, beside)
        for side, rows in sides.items()
    }


def _ratio(samples: GearSamples, fitted: np.ndarray, tables: dict[str, Table], scale: float):
    """scale, disturbance (k,) and the standard deviation of the scale, at fixed harmonics."""
    shape = np.ones(samples.rate.size)
    error = np.zeros(samples.rate.size)
    for side, table in tables.items():
        rows = samples.direction == SIDES[side]
        phi = samples.angle[rows] / scale
        x, slope = delivered(phi, table.orders, table.a, table.b)
        shape[rows], error[rows] = 1.0 / (1.0 + slope), phi - x
    motor = samples.rate * shape if samples.rated else samples.angle
    output = samples.output if samples.rated else samples.output + error
    chosen = _tellable(motor[fitted], samples.disturbances[fitted])
    columns = np.concatenate([motor[fitted][:, None], samples.disturbances[fitted][:, chosen]], axis=1)
    normal = columns.T @ columns
    size = np.sqrt(np.diag(normal))
    inverse = linalg.pinvh(normal / np.outer(size, size)) / np.outer(size, size)
    x = inverse @ (columns.T @ output[fitted])
    residual = output[fitted] - columns @ x
    sigma = np.sqrt(residual @ residual / max(residual.size - x.size, 1) * inverse[0, 0])
    disturbance = np.zeros(samples.disturbances.shape[1])
    disturbance[chosen] = x[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        return 1.0 / x[0], disturbance, float(sigma / x[0] ** 2)


def _tellable(motor: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """(k,) disturbances that neither the motor's column nor an earlier disturbance imitates."""
    basis = [motor / np.linalg.norm(motor)]
    chosen = np.zeros(columns.shape[1], bool)
    for k, column in enumerate(columns.T):
        norm = np.linalg.norm(column)
        rest = column - sum(one * (one @ column) for one in basis)
        if norm > 0.0 and np.linalg.norm(rest) > np.sqrt(_TELLS_BIAS) * norm:
            chosen[k] = True
            basis.append(rest / np.linalg.norm(rest))
    return chosen
