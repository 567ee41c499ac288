"""Orders of a gear, found one after another in what the ones before leave, and the fit of their coefficients.

`neighbours`  as the source: the highest peak of the coarse FFT, the nearest whole number and its two neighbours.
`refined`     chirp-z zoom to the peak, then all orders as real numbers with the coefficients eliminated (variable
              projection, Golub and Pereyra 1973), shared by both directions: one gear, one set of wheels.
An order enters when noise alone would show such a peak anywhere in the band with a probability below FALSE_ALARM.
Coefficients: weighted least squares per direction (3.5), drawn to zero with a spread that no gear exceeds, so that
neighbours which a short range cannot tell apart do not grow against each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg
from scipy.ndimage import median_filter
from scipy.special import gammaincinv

from exactarm.identify.gear_profile import FALSE_ALARM, AngleProfile, false_alarm

METHODS = ("refined", "neighbours")
_MOST_ORDERS, _MOST_ROUNDS, _MOST_PEAKS = 30, 20, 6
_LEAST_SHARE = 0.01  # of the noise's variance in the folded cells, that an order must carry
_NEIGHBOURHOOD = 40  # resolutions over which the floor of the spectrum is taken
_SIDE_LOBE, _APART = 0.15, 3.0  # peaks found at once: share of the highest, resolutions between them
_SPREAD = 1e-2  # of a and b
_SEPARATION = 0.6  # of the resolution 1 / range: closer orders cannot be told apart
_WHOLE_NUMBERS_APART = 2.9  # resolution up to which neighbouring whole numbers are tried there
_NEWTON_PASSES = 4
_OVERSAMPLING = 8


@dataclass(frozen=True)
class Table:
    """Coefficients of one direction with their covariance ((2 m, 2 m), a then b) and the residual in the cells."""

    orders: np.ndarray
    a: np.ndarray
    b: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    variance: float


def fit_table(profile: AngleProfile, orders: np.ndarray, start: Table | None = None) -> Table:
    """Coefficients at fixed orders, by Gauss-Newton (the model is nearly linear).

    The level of the profile is fitted beside them and dropped: it belongs to the ratio, which on a short range the
    harmonics would otherwise imitate.
    """
    m = orders.size
    x = np.zeros(2 * m + 1)
    if start is not None and start.orders.size == m:
        x[:-1] = np.concatenate([start.a, start.b])
    drawn = np.append(np.full(2 * m, 1.0 / _SPREAD**2), 0.0)
    covariance = np.zeros((2 * m + 1, 2 * m + 1))
    for _ in range(_NEWTON_PASSES if m else 2):
        residual, columns = _levelled(profile, orders, x)
        variance = profile.variance(residual, 2 * m + 1)
        weighted = columns * profile.weight[:, None]
        normal = columns.T @ weighted / max(variance, 1e-300) + np.diag(drawn)
        factor = linalg.cho_factor(normal)
        step = linalg.cho_solve(factor, weighted.T @ residual / max(variance, 1e-300) - x * drawn)
        x = x + step
        covariance = linalg.cho_solve(factor, np.eye(2 * m + 1))
        if np.max(np.abs(step)) < 1e-9:
            break
    residual, _ = _levelled(profile, orders, x)
    variance = profile.variance(residual, 2 * m + 1)
    return Table(orders, x[:m], x[m:-1], covariance[:-1, :-1], residual, variance)


def _levelled(profile: AngleProfile, orders: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residual (M,) and columns (M, 2 m + 1) at coefficients a, b and level."""
    m = orders.size
    model, columns = profile.columns(orders, x[:m], x[m:-1])
    level = model if profile.rated else np.ones_like(model)
    return profile.value - model - x[-1] * level, np.concatenate([columns, level[:, None]], axis=1)


def find_orders(
    profiles: list[AngleProfile], band: tuple[float, float], method: str, start: np.ndarray | None = None
) -> np.ndarray:
    """Accepted orders (m,), sorted, for all directions together; `start`: orders that are in already.

    The refined search has two beginnings, its own peaks and the whole numbers of the other method: close orders
    that nearly cancel each other leave many local minima. Akaike's criterion (1974) decides, which asks for the
    better prediction; an order that is not estimated but a whole number costs nothing for itself.
    """
    whole = _one_after_another(profiles, band, None, coarse=True) if method == "neighbours" or start is None else None
    if method == "neighbours":
        return whole if start is None else _one_after_another(profiles, band, start, coarse=True)
    settle = lambda orders: _earning(profiles, _refine(profiles, orders, band))
    found = [settle(_one_after_another(profiles, band, start, coarse=False))]
    resolution = 1.0 / max(profile.range_rev for profile in profiles)
    # Between encoders, delay and friction colour what is left: there no criterion can judge lines closer than a cell.
    if whole is not None and (profiles[0].rated or resolution < _WHOLE_NUMBERS_APART):
        found += [settle(_earning(profiles, whole)), _earning(profiles, whole), whole]
    elif start is not None:
        found.append(start)
    return min(found, key=lambda orders: _criterion(profiles, orders))


def _one_after_another(profiles, band, start, coarse: bool) -> np.ndarray:
    orders = np.zeros(0) if start is None else start
    tables = [fit_table(profile, orders) for profile in profiles]
    for _ in range(_MOST_ROUNDS):
        peaks = _peaks(profiles, tables, band, orders, coarse)[: _MOST_ORDERS - orders.size]
        if not peaks.size:
            break
        if coarse:
            whole = np.maximum(2.0, np.round(peaks))
            peaks = (whole[:, None] + [-1.0, 0.0, 1.0]).ravel()
        orders = np.unique(np.concatenate([orders, peaks]))
        if not coarse:
            orders = _refine(profiles, orders, band, rounds=1)
        tables = [fit_table(profile, orders) for profile in profiles]
    return np.sort(orders)


def _criterion(profiles, orders: np.ndarray) -> float:
    estimated = np.count_nonzero(np.abs(orders - np.round(orders)) > 1e-9)
    free = estimated + 2 * orders.size * len(profiles)
    return _cost(profiles, [fit_table(profile, orders) for profile in profiles]) + 2.0 * free


def _earning(profiles, orders: np.ndarray) -> np.ndarray:
    """The orders without those that predict worse than nothing (Akaike), the weakest first."""
    price = 2.0 * (1 + 2 * len(profiles))
    while orders.size:
        worth = np.zeros(orders.size)
        for profile in profiles:
            table = fit_table(profile, orders)
            for k in range(orders.size):
                pair = [k, k + orders.size]
                x = np.array([table.a[k], table.b[k]])
                worth[k] += x @ np.linalg.solve(table.covariance[np.ix_(pair, pair)], x)
        weakest = int(np.argmin(worth))
        if worth[weakest] >= price:
            break
        orders = np.delete(orders, weakest)
    return orders


def _peaks(profiles, tables, band, orders, coarse: bool) -> np.ndarray:
    """Peaks that pass the test against noise, away from each other and from the orders already in, highest first.

    Only those within a factor of the highest are told at once: beside a strong line its side lobes stand.
    """
    low, high = band
    longest = max(profile.range_rev for profile in profiles)
    per_cell = 1 if coarse else _OVERSAMPLING
    count = max(16, int(np.ceil(per_cell * longest * (high - low))))
    power = np.zeros(count)
    for profile, table in zip(profiles, tables):
        grid, sums = profile.spectrum(table.residual, low, high, count)
        power += np.abs(sums) ** 2 / (max(table.variance, 1e-300) * profile.weight.sum())
    power /= _colour(power, len(profiles), max(3, int(_NEIGHBOURHOOD * per_cell)))
    cells = sum(profile.angle.size for profile in profiles)
    nearest = np.min(np.abs(grid[:, None] - orders), axis=1) if orders.size else np.full(count, np.inf)
    power = np.where(nearest > (0.75 if coarse else _SEPARATION / longest), power, 0.0)
    found: list[float] = []
    highest = power.max()
    for _ in range(_MOST_PEAKS):
        best = int(np.argmax(power))
        # Of all cells' variance an order takes about 2 power / cells.
        too_small = 2.0 * power[best] < _LEAST_SHARE * cells or power[best] < _SIDE_LOBE * highest
        if too_small or false_alarm(power[best], len(profiles), longest, low, high) > FALSE_ALARM:
            break
        found.append(float(grid[best]) if coarse else _summit(grid, power, best))
        power = np.where(np.abs(grid - grid[best]) > _APART / longest, power, 0.0)
    return np.array(found)


def _colour(power: np.ndarray, profiles: int, width: int) -> np.ndarray:
    """(K,) how far the spectrum around each order lies above white noise (median over the neighbourhood), at least 1.

    What friction and delays leave is not white: without this, its slow part would pass for orders.
    """
    white = gammaincinv(profiles, 0.5)
    few = max(1, width // 100)
    floor = median_filter(power[::few], size=2 * (width // (2 * few)) + 1, mode="nearest") / white
    return np.maximum(np.interp(np.arange(power.size), np.arange(0, power.size, few), floor), 1.0)


def _summit(grid: np.ndarray, power: np.ndarray, best: int) -> float:
    """The top of the parabola through a peak and its neighbours."""
    if best in (0, grid.size - 1):
        return float(grid[best])
    left, middle, right = power[best - 1 : best + 2]
    bend = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / bend if bend < 0.0 and left * right > 0.0 else 0.0
    return float(grid[best] + np.clip(shift, -1.0, 1.0) * (grid[1] - grid[0]))


def _refine(profiles, orders: np.ndarray, band, rounds: int = 5) -> np.ndarray:
    """Gauss-Newton on the orders with the coefficients eliminated; a step that does not help is shortened, then dropped."""
    if not orders.size:
        return orders
    gap = _SEPARATION / max(profile.range_rev for profile in profiles)
    closest = min(0.7 * gap, 0.9 * np.min(np.diff(orders), initial=np.inf))
    tables = [fit_table(profile, orders) for profile in profiles]
    cost = _cost(profiles, tables)
    for _ in range(rounds):
        normal, gradient = _projected(profiles, orders, tables)
        normal += np.eye(orders.size) * 1e-9 * np.trace(normal) / orders.size
        # A third of what can be told apart is all that the linear picture carries.
        step = np.clip(np.linalg.solve(normal, gradient), -0.3 * gap, 0.3 * gap)
        for share in (1.0, 0.3):
            moved = np.sort(np.clip(orders + share * step, *band))
            if orders.size > 1 and np.min(np.diff(moved)) < closest:
                continue
            trial = [fit_table(profile, moved, table) for profile, table in zip(profiles, tables)]
            if _cost(profiles, trial) < cost:
                orders, tables = moved, trial
                break
        else:
            break
        before, cost = cost, _cost(profiles, tables)
        if before - cost < 0.1:
            break
    return orders


def _projected(profiles, orders: np.ndarray, tables) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrix (m, m) and gradient (m,) of the orders, orthogonal to all coefficients."""
    normal, gradient = np.zeros((orders.size, orders.size)), np.zeros(orders.size)
    for profile, table in zip(profiles, tables):
        slopes = _order_slopes(profile, table)
        _, columns = _levelled(profile, orders, np.concatenate([table.a, table.b, [0.0]]))
        root = np.sqrt(profile.weight / max(table.variance, 1e-300))[:, None]
        q, _ = np.linalg.qr(columns * root)
        projected = slopes * root - q @ (q.T @ (slopes * root))
        normal += projected.T @ projected
        gradient += projected.T @ (table.residual * root[:, 0])
    return normal, gradient


def _cost(profiles, tables) -> float:
    """-2 log likelihood but for constants: the variance of each direction is its own."""
    return sum(profile.angle.size * np.log(max(table.variance, 1e-300)) for profile, table in zip(profiles, tables))


def _order_slopes(profile: AngleProfile, table: Table) -> np.ndarray:
    """(M, m) d model / d order at the table's coefficients."""
    _, columns = profile.columns(table.orders, table.a, table.b)
    m = table.orders.size
    x, w = profile.angle[:, None], table.orders
    by_a, by_b = columns[:, :m], columns[:, m:]
    if not profile.rated:
        sine, cosine = by_a * w, by_b * w + 1.0
        error = by_a * table.a + by_b * table.b
        return (x * (cosine * table.a - sine * table.b) - error) / w
    # d/dw of cos(w x) is -x sin(w x): the columns trade places.
    return x * (by_b * table.a - by_a * table.b)


def order_uncertainty(profiles, orders: np.ndarray, tables) -> np.ndarray:
    """(m,) standard deviation of the orders with the coefficients eliminated."""
    if not orders.size:
        return np.zeros(0)
    return np.sqrt(np.diag(linalg.pinvh(_projected(profiles, orders, tables)[0])))
