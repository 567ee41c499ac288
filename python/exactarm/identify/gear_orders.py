"""Orders of a gear, found one after another in what the ones before leave, and the fit of their coefficients.

`neighbours`  as the source: the highest peak of the coarse FFT, the nearest whole number and its two
              neighbours.
`refined`     chirp-z zoom to the peak, then all orders as real numbers with the coefficients eliminated
              (variable projection, Golub and Pereyra 1973), shared by both directions: one gear, one set of
                  wheels.
An order enters when noise alone would show such a peak anywhere in the band with a probability below
FALSE_ALARM. The band begins at two periods within the range; below it only what an output wheel does is
asked, once and twice a turn (effects/gear_eccentricity.py), and such an order stays the whole number that
it is. Coefficients: weighted least squares per direction (3.5), drawn to zero with a spread that no gear
exceeds, so that neighbours which a short range cannot tell apart do not grow against each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy  # scipy.ndimage is imported at its first use
from scipy import linalg
from scipy.special import chdtrc, gammaincinv

from exactarm.effects.gear_eccentricity import SPREAD_RAD
from exactarm.identify.gear_profile import FALSE_ALARM, AngleProfile, false_alarm

METHODS = ("refined", "neighbours")
_MOST_ORDERS, _MOST_ROUNDS, _MOST_PEAKS = 30, 20, 6
_LEAST_SHARE = 0.01  # of the noise's variance in the folded cells, that an order must carry
_NEIGHBOURHOOD = 40  # resolutions over which the floor of the spectrum is taken
_SIDE_LOBE, _APART = 0.15, 3.0  # peaks found at once: share of the highest, resolutions between them
_SPREAD = 1e-2  # of a and b, where the angle does not swing by more than a run-out
RUN_OUT = np.array([1.0, 2.0])
_LEAST_PERIODS = 0.5  # less of a wave is a parabola, which what is left of lines close by makes, too
_SEPARATION = 0.6  # of the resolution 1 / range: closer orders cannot be told apart
_WHOLE_NUMBERS_APART = 2.9  # resolution up to which neighbouring whole numbers are tried there
_NEWTON_PASSES = 6
_RESTS = 0.01  # standard deviations of a coefficient: a smaller step ends its fit
_TINY = 1e-300
_OVERSAMPLING = 8


@dataclass(frozen=True)
class Table:
    """Coefficients of one direction with their covariance ((2 m, 2 m), a then b) and the residual in the
    cells.

    level: of the profile, fitted beside them and dropped; it belongs to the ratio, which on a short range the
    harmonics would otherwise imitate.
    """

    orders: np.ndarray
    a: np.ndarray
    b: np.ndarray
    level: float
    covariance: np.ndarray
    residual: np.ndarray
    variance: float

    @property
    def x(self) -> np.ndarray:
        """a, b, level (2 m + 1,)."""
        return np.concatenate([self.a, self.b, [self.level]])

    def without(self, k: int) -> Table:
        """A start for the fit without the k-th order."""
        return replace(self, orders=np.delete(self.orders, k), a=np.delete(self.a, k), b=np.delete(self.b, k))


@dataclass(frozen=True)
class Found:
    """Orders (m,), sorted, with the table of every profile."""

    orders: np.ndarray
    tables: tuple[Table, ...]

    @property
    def cost(self) -> float:
        """-2 log likelihood but for constants: the variance of each direction is its own."""
        return sum(table.residual.size * np.log(max(table.variance, _TINY)) for table in self.tables)

    @property
    def criterion(self) -> float:
        estimated = np.count_nonzero(np.abs(self.orders - np.round(self.orders)) > 1e-9)
        return self.cost + 2.0 * (estimated + 2 * self.orders.size * len(self.tables))


def fit_table(profile: AngleProfile, orders: np.ndarray, start: Table | None = None) -> Table:
    """Coefficients at fixed orders, by Gauss-Newton from `start` (the model is nearly linear)."""
    m = orders.size
    x = start.x if start is not None and start.orders.size == m else np.zeros(2 * m + 1)
    drawn = np.append(drawn_to_zero(orders), 0.0)
    for _ in range(_NEWTON_PASSES):
        normal, gradient, residual = profile.normal(orders, x)
        variance = profile.variance(residual, 2 * m + 1)
        factor = linalg.cho_factor(normal / max(variance, _TINY) + np.diag(drawn), check_finite=False)
        step = linalg.cho_solve(factor, gradient / max(variance, _TINY) - x * drawn, check_finite=False)
        x = x + step
        covariance = linalg.cho_solve(factor, np.eye(2 * m + 1), check_finite=False)
        if np.all(np.abs(step) <= _RESTS * np.sqrt(np.diag(covariance))):
            break
    return Table(orders, x[:m], x[m:-1], float(x[-1]), covariance[:-1, :-1], residual, variance)


def drawn_to_zero(orders: np.ndarray) -> np.ndarray:
    """(2 m,) inverse variances of the priors on all a and all b."""
    return np.tile(np.minimum(SPREAD_RAD * orders, _SPREAD) ** -2.0, 2)


def fit_all(profiles: list[AngleProfile], orders: np.ndarray,
            start: tuple[Table, ...] | None = None) -> Found:
    """The tables of all profiles at fixed orders."""
    starts = start or (None,) * len(profiles)
    return Found(orders, tuple(fit_table(profile, orders, table) for profile, table in zip(profiles, starts)))


def with_run_out(profiles: list[AngleProfile], band: tuple[float, float], found: Found) -> Found:
    """The orders found in the band, with those of a run-out below it that noise alone would not show."""
    below = RUN_OUT[(RUN_OUT < band[0]) & (RUN_OUT * longest_range(profiles) > _LEAST_PERIODS)]
    if not below.size:
        return found
    found = fit_all(profiles, np.union1d(below, found.orders))
    while below.size:
        worth = _worth(found)[: below.size]
        weakest = int(np.argmin(worth))
        if chdtrc(2 * len(profiles), worth[weakest]) < FALSE_ALARM:
            break
        below = np.delete(below, weakest)
        found = fit_all(profiles, np.delete(found.orders, weakest))
    return found


def find_orders(profiles: list[AngleProfile], band: tuple[float, float], method: str,
                start: Found | None = None, whole: Found | None = None,
                run_out: Found | None = None) -> Found:
    """Accepted orders for all directions together; `start`: orders that are in already, from other profiles
    of the same gear; `whole`: what `whole_orders` found in these profiles; `run_out`: what lies below the
    band in them, whose side lobes it begins beside.

    The refined search has two beginnings, its own peaks and the whole numbers of the other method: close
    orders that nearly cancel each other leave many local minima. Akaike's criterion (1974) decides, which
    asks for the better prediction; an order that is not estimated but a whole number costs nothing for
    itself.
    """
    if start is not None:
        start = fit_all(profiles, start.orders, start.tables)
    if method == "neighbours":
        return whole if whole is not None else whole_orders(profiles, band, start)
    settle = lambda found: _earning(profiles, _refine(profiles, found, band))
    found = [settle(_one_after_another(profiles, band, start or run_out, coarse=False))]
    if start is not None:
        found.append(start)
    # Between encoders, delay and friction colour what is left: there no criterion can judge lines closer than
    # a cell.
    elif profiles[0].rated or 1.0 / longest_range(profiles) < _WHOLE_NUMBERS_APART:
        whole = whole_orders(profiles, band, run_out) if whole is None else whole
        earning = _earning(profiles, whole)
        found += [settle(earning), earning, whole]
    best = min(found, key=lambda each: each.criterion)
    one = _one_at_the_edge(profiles, band, best)
    return best if one is None else min(best, settle(one), key=lambda each: each.criterion)


def whole_orders(profiles: list[AngleProfile], band: tuple[float, float],
                 start: Found | None = None) -> Found:
    """The nearest whole numbers of the coarse FFT's peaks with their neighbours."""
    return _one_after_another(profiles, band, start, coarse=True)


def longest_range(profiles: list[AngleProfile]) -> float:
    """Revolutions."""
    return max(profile.range_rev for profile in profiles)


def _one_after_another(profiles, band, start: Found | None, coarse: bool) -> Found:
    found = fit_all(profiles, np.zeros(0)) if start is None else start
    for _ in range(_MOST_ROUNDS):
        peaks = _peaks(profiles, found, band, coarse)[: _MOST_ORDERS - found.orders.size]
        if not peaks.size:
            break
        if coarse:
            whole = np.maximum(2.0, np.round(peaks))
            peaks = (whole[:, None] + [-1.0, 0.0, 1.0]).ravel()
        found = fit_all(profiles, np.unique(np.concatenate([found.orders, peaks])))
        if not coarse:
            found = _refine(profiles, found, band, rounds=1)
    return found


def unidentified(profiles: list[AngleProfile], band: tuple[float, float], found: Found) -> np.ndarray:
    """(m,) the orders that a wave of less than two periods within the range may have set.

    What the orders at the lower edge of the band take away has its top below the edge: then the range tells
    that there is a wave and not which, and a run-out, their neighbours and what stands in the side lobes of
    these are parts of it.
    """
    chain, top = _at_the_edge(profiles, band, found)
    return chain & (top <= band[0])


def _at_the_edge(profiles, band, found: Found) -> tuple[np.ndarray, float]:
    """(m,) the orders from the lower edge of the band on that side lobes may join, with the run-outs below,
    and the order at the top of what they take away beside these; none: no order near the edge."""
    longest, orders = longest_range(profiles), found.orders
    low, high, apart = _LEAST_PERIODS / longest, band[0] + 1.0 / longest, _APART / longest
    searched = ~np.isin(orders, RUN_OUT)
    if not np.any(searched & (orders < high)):
        return np.zeros(orders.size, bool), np.inf
    steps = np.diff(np.maximum(orders, band[0]), prepend=band[0])
    chain = np.logical_and.accumulate(steps < apart)
    searched &= chain
    if np.count_nonzero(searched) == 1:  # its fit says more than the top of its peak
        return chain, float(orders[searched][0])
    without = fit_all(profiles, orders[~searched])
    count = 1 + int(np.ceil(_OVERSAMPLING * longest * (high - low)))
    grid, power = _power(profiles, without, low, high, count)
    return chain, _summit(grid, power, int(np.argmax(power)))


def _one_at_the_edge(profiles, band, found: Found) -> Found | None:
    """One order in place of several at the lower edge of the band, where the top of what they take away lies
    in it: whole numbers may imitate a wave between them. None: nothing of the kind."""
    chain, top = _at_the_edge(profiles, band, found)
    several = chain & ~np.isin(found.orders, RUN_OUT)
    if np.count_nonzero(several) < 2 or top <= band[0]:
        return None
    return fit_all(profiles, np.union1d(found.orders[~several], top))


def reduced(profiles: list[AngleProfile], found: Found, kept: np.ndarray) -> Found:
    """The orders (m,) that are kept, with the coefficients that they have beside the others."""
    pairs = np.tile(kept, 2)

    def without(profile: AngleProfile, table: Table) -> Table:
        x = table.x[np.append(pairs, True)]
        residual = profile.normal(table.orders[kept], x)[2]
        return Table(table.orders[kept], table.a[kept], table.b[kept], table.level,
                     table.covariance[np.ix_(pairs, pairs)], residual, profile.variance(residual, x.size))

    return Found(found.orders[kept], tuple(map(without, profiles, found.tables)))


def _earning(profiles, found: Found) -> Found:
    """The orders without those that predict worse than nothing (Akaike), the weakest first."""
    price = 2.0 * (1 + 2 * len(profiles))
    while found.orders.size:
        worth = _worth(found)
        weakest = int(np.argmin(worth))
        if worth[weakest] >= price:
            break
        rest = tuple(table.without(weakest) for table in found.tables)
        found = fit_all(profiles, np.delete(found.orders, weakest), rest)
    return found


def _worth(found: Found) -> np.ndarray:
    """(m,) square of each order's coefficients in their standard deviations, of all directions."""
    worth = np.zeros(found.orders.size)
    for table in found.tables:
        for k in range(found.orders.size):
            pair = [k, k + found.orders.size]
            x = np.array([table.a[k], table.b[k]])
            worth[k] += x @ np.linalg.solve(table.covariance[np.ix_(pair, pair)], x)
    return worth


def _peaks(profiles, already: Found, band, coarse: bool) -> np.ndarray:
    """Peaks that pass the test against noise, away from each other and from the orders already in, highest
    first.

    Only those within a factor of the highest are told at once: beside a strong line its side lobes stand.
    """
    (low, high), orders, longest = band, already.orders, longest_range(profiles)
    per_cell = 1 if coarse else _OVERSAMPLING
    count = max(16, int(np.ceil(per_cell * longest * (high - low))))
    grid, power = _power(profiles, already, low, high, count)
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


def _power(profiles, found: Found, low: float, high: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Orders (K,) and the power (K,) of what is left at each, summed over the profiles: of each, 1 on average
    in white noise."""
    power = np.zeros(count)
    for profile, table in zip(profiles, found.tables):
        grid, sums = profile.spectrum(table.residual, low, high, count)
        power += np.abs(sums) ** 2 / (max(table.variance, _TINY) * profile.weight.sum())
    return grid, power


def _colour(power: np.ndarray, profiles: int, width: int) -> np.ndarray:
    """(K,) how far the spectrum around each order lies above white noise (median over the neighbourhood), at
    least 1.

    What friction and delays leave is not white: without this, its slow part would pass for orders. At an end
    the neighbourhood is mirrored: the outermost cell, repeated, would take a line there for the floor.
    """
    white = gammaincinv(profiles, 0.5)
    few = max(1, width // 100)
    around = 2 * (width // (2 * few)) + 1
    floor = scipy.ndimage.median_filter(power[::few], size=around, mode="reflect") / white
    return np.maximum(np.interp(np.arange(power.size), np.arange(0, power.size, few), floor), 1.0)


def _summit(grid: np.ndarray, power: np.ndarray, best: int) -> float:
    """The top of the parabola through a peak and its neighbours."""
    if best in (0, grid.size - 1):
        return float(grid[best])
    left, middle, right = power[best - 1 : best + 2]
    bend = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / bend if bend < 0.0 and left * right > 0.0 else 0.0
    return float(grid[best] + np.clip(shift, -1.0, 1.0) * (grid[1] - grid[0]))


def _refine(profiles, found: Found, band, rounds: int = 5) -> Found:
    """Gauss-Newton on the orders in the band with the coefficients eliminated; a step that does not help is
    shortened, then dropped."""
    orders, free = found.orders, found.orders >= band[0]
    if not free.any():
        return found
    gap = _SEPARATION / longest_range(profiles)
    closest = min(0.7 * gap, 0.9 * np.min(np.diff(orders), initial=np.inf))
    for _ in range(rounds):
        normal, gradient = _projected(profiles, found)
        normal, gradient = normal[np.ix_(free, free)], gradient[free]
        normal += np.eye(gradient.size) * 1e-9 * np.trace(normal) / gradient.size
        # A third of what can be told apart is all that the linear picture carries.
        step = np.clip(np.linalg.solve(normal, gradient), -0.3 * gap, 0.3 * gap)
        before = found
        for share in (1.0, 0.3):
            moved = found.orders.copy()
            moved[free] = np.sort(np.clip(moved[free] + share * step, *band))
            if orders.size > 1 and np.min(np.diff(moved)) < closest:
                continue
            trial = fit_all(profiles, moved, found.tables)
            if trial.cost < found.cost:
                found = trial
                break
        if before.cost - found.cost < 0.1:
            break
    return found


def _projected(profiles, found: Found) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrix (m, m) and gradient (m,) of the orders, coefficients eliminated (Schur's complement)."""
    m = found.orders.size
    normal, gradient = np.zeros((m, m)), np.zeros(m)
    own, order = slice(0, 2 * m + 1), slice(2 * m + 1, None)
    for profile, table in zip(profiles, found.tables):
        full, slope, _ = profile.normal(found.orders, table.x, with_orders=True)
        full, slope = full / max(table.variance, _TINY), slope / max(table.variance, _TINY)
        drawn = np.append(drawn_to_zero(found.orders), 0.0)
        factor = linalg.cho_factor(full[own, own] + np.diag(drawn), check_finite=False)
        eliminated = linalg.cho_solve(factor, full[own, order], check_finite=False)
        normal += full[order, order] - full[order, own] @ eliminated
        gradient += slope[order] - eliminated.T @ (slope[own] - table.x * drawn)
    return normal, gradient


def order_uncertainty(profiles: list[AngleProfile], found: Found) -> np.ndarray:
    """(m,) standard deviation of the orders with the coefficients eliminated."""
    if not found.orders.size:
        return np.zeros(0)
    return np.sqrt(np.diag(linalg.pinvh(_projected(profiles, found)[0])))
