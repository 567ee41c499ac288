"""One gear, from its samples to ratio, orders and coefficients per direction.

    gyroscope   output = rate / scale * 1 / (1 + s(phi)) + bias
    encoders    output = angle / scale - e(phi) + disturbances (offsets of the runs, delay, wind-up, friction)
with scale = true ratio over declared ratio. Ratio with disturbances and harmonics are fitted in turn until
they rest; both directions share the ratio. Once and twice a turn a wheel may run out, which on a part of a
turn looks much like another ratio: such terms are free beside it where they stand out of the noise, and else
widen its interval by what they may be. The bias is left at zero where nothing tells it from the ratio: one
direction at one speed without a standstill.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from exactarm.errors import InputError
from exactarm.identify.gear_declared import SIDES
from exactarm.identify.gear_orders import (
    RUN_OUT,
    Found,
    Table,
    drawn_to_zero,
    find_orders,
    fit_all,
    order_uncertainty,
    reduced,
    unidentified,
    whole_orders,
    with_run_out,
)
from exactarm.identify.gear_profile import AngleProfile, angle_profile, fast_rows, highest_order
from exactarm.identify.gear_samples import GearSamples
from exactarm.numerics.harmonics import delivered, waves
from exactarm.robot.robot import GearTable

_ROUNDS = 12
# of its standard deviation: ratio and harmonics, fitted in turn, have settled on each other
_RATIO_RESTS = 0.1
_SEARCH_ROUNDS = 2
_TELLS_BIAS = 1e-4  # share of the bias column that the rate cannot imitate
_LEAST_CELLS = 64
_LARGEST_FACTOR = 2.0  # between the measured ratio and the declared one


@dataclass(frozen=True)
class GearEstimate:
    """ratio and its standard deviation; tables and profiles by side ("cw", "ccw"); sigma of the orders (m,).

    disturbance (k,): coefficients of the samples' disturbance columns; dropped: orders that were fitted
    beside the others and that the range does not identify; lowest: the order of two periods within the range.
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
    dropped: np.ndarray
    lowest: float

    @property
    def scale(self) -> float:
        return self.ratio / self.samples.ratio

    def gear_table(self, side: str) -> GearTable:
        table = self.tables[side]
        return GearTable(table.orders, table.a, table.b)


@dataclass(frozen=True)
class FirstLook:
    """Profiles by side with the first ratio, the band of orders that they can tell, what lies below it, and
    the whole numbers in it."""

    ratio: Ratio
    profiles: dict[str, AngleProfile]
    band: tuple[float, float]
    run_out: Found
    whole: Found


@dataclass(frozen=True)
class Ratio:
    """scale with its standard deviation at the orders of the tables, and with what run-outs may be left
    open; disturbance (k,)."""

    scale: float
    disturbance: np.ndarray
    sigma: float
    open_sigma: float


def first_look(samples: GearSamples) -> FirstLook | None:
    """What both methods begin with; None where there are too few identification rows."""
    fitted = samples.identification & samples.keep
    if fitted.sum() < _LEAST_CELLS:
        return None
    ratio, _ = _ratio(samples, fitted, {}, 1.0, 0.0)
    _require_like(samples, ratio.scale)
    profiles = _profiles(samples, fitted, ratio)
    if not profiles:
        return None
    sides = list(profiles.values())
    # from two periods within the range on
    band = 2.0 / max(profile.range_rev for profile in sides), highest_order(samples)
    run_out = with_run_out(sides, band, fit_all(sides, np.zeros(0)))
    whole = whole_orders(sides, band, run_out) if band[1] > band[0] else run_out
    return FirstLook(ratio, profiles, band, run_out, whole)


def identify_axis(samples: GearSamples, method: str, first: FirstLook) -> GearEstimate:
    """Estimate from the identification rows."""
    fitted = samples.identification & samples.keep
    ratio, profiles, band, found = first.ratio, first.profiles, first.band, None
    for turn in range(_ROUNDS):
        if turn:
            profiles = _profiles(samples, fitted, ratio)
        sides = list(profiles.values())
        if turn < _SEARCH_ROUNDS and band[1] > band[0]:
            found = find_orders(sides, band, method, found, None if turn else first.whole, first.run_out)
        else:
            found = first.run_out if found is None else fit_all(sides, found.orders, found.tables)
        if turn:  # beside the harmonics, with a bias that was estimated beside them
            found = with_run_out(sides, band, found)
        before = ratio
        ratio, tables = _ratio(samples, fitted, dict(zip(profiles, found.tables)), ratio.scale, band[0])
        found = replace(found, tables=tuple(tables.values()))
        settled = abs(ratio.scale - before.scale) < _RATIO_RESTS * ratio.sigma
        if turn >= _SEARCH_ROUNDS - 1 and settled:
            break
    order_sigma, lost = order_uncertainty(sides, found), unidentified(sides, band, found)
    dropped, sigma = found.orders[lost], ratio.open_sigma
    if lost.any():
        found, order_sigma, beside = reduced(sides, found, ~lost), order_sigma[~lost], ratio.scale
        ratio, tables = _ratio(samples, fitted, dict(zip(profiles, found.tables)), beside, band[0])
        found = replace(found, tables=tuple(tables.values()))
        # Nothing tells how much of the ratio is the wave's: what it is with and without lies in its interval.
        sigma = float(np.hypot(ratio.open_sigma, ratio.scale - beside))
    return GearEstimate(
        samples, method, samples.ratio * ratio.scale, abs(samples.ratio) * sigma, ratio.disturbance,
        found.orders, order_sigma, dict(zip(profiles, found.tables)), profiles, bool(settled), dropped,
        band[0])


def _require_like(samples: GearSamples, scale: float) -> None:
    """Refuses a reading that has nothing to do with the motor's: a unit or a ratio far off, another axis."""
    if not 1.0 / _LARGEST_FACTOR < scale < _LARGEST_FACTOR:
        sensor = "gyroscope" if samples.rated else "encoder behind the gear"
        raise InputError(
            f"axis {samples.axis + 1}: motor angle and {sensor} give a gear ratio of "
            f"{samples.ratio * scale:.4g} where the robot file has {samples.ratio:.4g}; expected less than a "
            f"factor {_LARGEST_FACTOR:.0f} between them: check units and ratio")


def _profiles(samples, fitted, ratio: Ratio) -> dict[str, AngleProfile]:
    beside = samples.disturbances @ ratio.disturbance
    sides = {side: fast_rows(samples, fitted & samples.side(way)) for side, way in SIDES.items()}
    sides = {side: rows for side, rows in sides.items()
             if rows.sum() >= _LEAST_CELLS and np.ptp(samples.angle[rows]) > 0}
    return {side: angle_profile(samples, rows, highest_order(samples), ratio.scale, beside)
            for side, rows in sides.items()}


def _ratio(samples: GearSamples, fitted: np.ndarray, tables: dict[str, Table], scale: float,
           lowest: float) -> tuple[Ratio, dict[str, Table]]:
    """The ratio at fixed harmonics, and the tables with the run-outs below the order `lowest` beside it."""
    shape = np.ones(samples.rate.size)
    error = np.zeros(samples.rate.size)
    below = RUN_OUT[RUN_OUT < lowest]
    open_columns, centre, known = [], [], []
    for side, table in tables.items():
        rows = samples.direction == SIDES[side]
        phi = samples.angle[rows] / scale
        x, slope = delivered(phi, table.orders, table.a, table.b)
        shape[rows], error[rows] = 1.0 / (1.0 + slope), phi - x
        used, columns = fitted[rows], np.zeros((np.count_nonzero(fitted), 2 * below.size))
        rate = samples.rate[rows][used] * shape[rows][used] ** 2 / scale if samples.rated else None
        columns[rows[fitted]] = _run_out_columns(x[used], below, rate)
        open_columns.append(columns)
        has = np.isin(below, table.orders)
        lacks = np.zeros((2, below.size))
        lacks[:, has] = -table.a[: has.sum()], -table.b[: has.sum()]  # the lowest of its orders
        centre.append(lacks.ravel())
        known.append(np.tile(has, 2))
    motor = samples.rate * shape if samples.rated else samples.angle
    output = (samples.output if samples.rated else samples.output + error)[fitted]
    chosen = _tellable(motor[fitted], samples.disturbances[fitted])
    columns = [motor[fitted][:, None], samples.disturbances[fitted][:, chosen], *open_columns]
    whole = np.concatenate(columns, axis=1)
    normal, right = whole.T @ whole, whole.T @ output
    nothing = np.zeros(1 + np.count_nonzero(chosen))
    plain = slice(nothing.size)
    x, inverse = _solved(normal[plain, plain], right[plain], nothing, nothing)
    residual = output - whole[:, plain] @ x
    variance = float(residual @ residual) / max(residual.size - x.size, 1)
    open_square = inverse[0, 0] * variance
    if below.size and tables:
        priors = variance * np.concatenate([nothing, *[drawn_to_zero(below)] * len(tables)])
        centres = np.concatenate([nothing, *centre])
        free, its = _solved(normal, right, priors, centres)
        kept = np.concatenate([nothing == 0.0, *known])
        x, inverse = _solved(normal[np.ix_(kept, kept)], right[kept], priors[kept], centres[kept])
        open_square = variance * its[0, 0] + (free[0] - x[0]) ** 2
    steps = iter(np.split(x[nothing.size :], len(tables)) if tables else ())
    tables = {side: _moved(table, step) for (side, table), step in zip(tables.items(), steps)}
    disturbance = np.zeros(samples.disturbances.shape[1])
    disturbance[chosen] = x[1 : nothing.size]
    sigmas = np.sqrt([variance * inverse[0, 0], open_square])
    with np.errstate(divide="ignore", invalid="ignore"):
        return Ratio(1.0 / x[0], disturbance, *(float(sigma / x[0] ** 2) for sigma in sigmas)), tables


def _moved(table: Table, step: np.ndarray) -> Table:
    """The table with its lowest orders' a, then b, moved."""
    by_a, by_b = np.split(step, 2)
    rest = np.zeros(table.orders.size - by_a.size)
    return replace(table, a=table.a + np.append(by_a, rest), b=table.b + np.append(by_b, rest))


def _run_out_columns(x: np.ndarray, orders: np.ndarray, rate: np.ndarray | None) -> np.ndarray:
    """(N, 2 m) what all a and all b do to the output at the angle x: a rate, or the angle itself."""
    sine, cosine = waves(x, orders)
    if rate is not None:
        return rate[:, None] * np.concatenate([-cosine, sine], axis=1)
    return np.concatenate([-sine / orders, (1.0 - cosine) / orders], axis=1)


def _solved(normal: np.ndarray, right: np.ndarray, priors: np.ndarray,
            centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and the inverse of their normal matrix, drawn to `centre` with `priors`: their inverse
    variances times the variance of a row."""
    normal = normal + np.diag(priors)
    size = np.sqrt(np.diag(normal))
    inverse = linalg.pinvh(normal / np.outer(size, size)) / np.outer(size, size)
    return inverse @ (right + priors * centre), inverse


def _tellable(motor: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """(k,) disturbances that neither the motor's column nor an earlier disturbance imitates: what is left of
    their squares, beside those, stands on the diagonal of the products."""
    across = motor @ columns
    left = columns.T @ columns - np.outer(across, across) / (motor @ motor)
    least, chosen = _TELLS_BIAS * np.einsum("ij,ij->j", columns, columns), np.zeros(columns.shape[1], bool)
    for k in range(columns.shape[1]):
        if left[k, k] > least[k]:
            chosen[k] = True
            left = left - np.outer(left[:, k], left[k]) / left[k, k]
    return chosen
