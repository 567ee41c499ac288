"""One gear, from its samples to ratio, orders and coefficients per direction.

    gyroscope   output = rate / scale * 1 / (1 + s(phi)) + bias
    encoders    output = angle / scale - e(phi) + disturbances (offsets of the runs, delay, wind-up, friction)
with scale = true ratio over declared ratio. Ratio with disturbances and harmonics are fitted in turn until they rest;
both directions share the ratio. The bias is left at zero where nothing tells it from the ratio: one direction at
one speed without a standstill.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from exactarm.harmonics import delivered_angle, transmission_slope
from exactarm.identify.gear_declared import SIDES
from exactarm.identify.gear_orders import Table, find_orders, fit_table, order_uncertainty
from exactarm.identify.gear_profile import AngleProfile, angle_profile, search_band
from exactarm.identify.gear_samples import GearSamples
from exactarm.robot import GearTable

_ROUNDS = 3
_SEARCH_ROUNDS = 2
_TELLS_BIAS = 1e-4  # share of the bias column that the rate cannot imitate
_LEAST_CELLS = 64
_POINTS_PER_PERIOD = 80  # of the shortest period, where a table is looked up instead of evaluated


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

    @property
    def scale(self) -> float:
        return self.ratio / self.samples.ratio

    def gear_table(self, side: str) -> GearTable:
        table = self.tables[side]
        return GearTable(table.orders, table.a, table.b)


def identify_axis(samples: GearSamples, method: str) -> GearEstimate | None:
    """Estimate from the identification rows; None where they are too few."""
    fitted = samples.identification & samples.keep
    scale, disturbance, sigma = _ratio(samples, fitted, {}, 1.0)
    tables: dict[str, Table] = {}
    orders = np.zeros(0)
    for turn in range(_ROUNDS):
        profiles = _profiles(samples, fitted, scale, disturbance)
        if not profiles:
            return None
        if turn < _SEARCH_ROUNDS:
            band = search_band(list(profiles.values()), samples.ratio, samples)
            if band[1] > band[0]:
                orders = find_orders(list(profiles.values()), band, method, orders if orders.size else None)
        tables = {side: fit_table(profile, orders) for side, profile in profiles.items()}
        before = scale
        scale, disturbance, sigma = _ratio(samples, fitted, tables, scale)
        if turn >= _SEARCH_ROUNDS - 1 and abs(scale - before) < 0.1 * sigma:
            break
    order_sigma = order_uncertainty(list(profiles.values()), orders, list(tables.values()))
    return GearEstimate(
        samples, method, samples.ratio * scale, abs(samples.ratio) * sigma, disturbance, orders, order_sigma, tables, profiles
    )


def _profiles(samples, fitted, scale, disturbance) -> dict[str, AngleProfile]:
    beside = samples.disturbances @ disturbance
    sides = {side: fitted & samples.side(way) for side, way in SIDES.items()}
    sides = {side: rows for side, rows in sides.items() if rows.sum() >= _LEAST_CELLS and np.ptp(samples.angle[rows]) > 0}
    if not sides:
        return {}
    # A first look at the range and the sampling sets the band, the band the width of the cells.
    spacing = np.median(np.abs(np.diff(samples.angle))[samples.keep[1:]])
    highest = min(5.0 * max(abs(samples.ratio), 20.0), 0.8 * np.pi / max(spacing, 1e-12))
    return {
        side: angle_profile(samples, rows, SIDES[side], highest, scale, beside)
        for side, rows in sides.items()
    }


def _ratio(samples: GearSamples, fitted: np.ndarray, tables: dict[str, Table], scale: float):
    """scale, disturbance (k,) and the standard deviation of the scale, at fixed harmonics."""
    shape = np.ones(samples.rate.size)
    error = np.zeros(samples.rate.size)
    for side, table in tables.items():
        rows = samples.direction == SIDES[side]
        slope, transmission = looked_up(samples.angle[rows] / scale, table.orders, table.a, table.b)
        shape[rows], error[rows] = 1.0 / (1.0 + slope), transmission
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


def looked_up(phi: np.ndarray, orders: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """u / u0 - 1 and e at the delivered angle of each motor angle phi = theta / ratio, from a fine grid over its range."""
    if not orders.size or not phi.size:
        return np.zeros(phi.size), np.zeros(phi.size)
    low, high = phi.min(), phi.max()
    points = int(np.ceil((high - low) * orders.max() / (2.0 * np.pi) * _POINTS_PER_PERIOD)) + 2
    grid = np.linspace(low, high, min(points, 200_000)) if phi.size > points else phi
    x = delivered_angle(grid, orders, a, b, tolerance=1e-6)
    slope, error = transmission_slope(x, orders, a, b), grid - x
    return (slope, error) if grid is phi else (np.interp(phi, grid, slope), np.interp(phi, grid, error))
