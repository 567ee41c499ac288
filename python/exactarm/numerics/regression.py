"""Weighted non-linear least squares with an analytic Jacobian, and what may be said of its result.

    minimise  sum_r rho(|w_r (y_r - f_r(x))|^2)   over lower <= x <= upper

Trust region on scaled columns (Moré 1978), inside the bounds (trust_region.py); where the radius binds, the
step is bent along the valley by geodesic acceleration (Transtrum and Sethna 2012). A robust loss is handled
by iteratively reweighted residuals (Huber 1964). The search ends where the linear model promises no fall (the
relative offset of Bates and Watts 1981), not where one step happened to be short: in a curved valley every
step is short.

Covariance: s^2 (J' W J)^{-1} with s^2 from N - P degrees of freedom (frames and all other free parameters
counted), intervals by Student's t, one-sided where a bound cuts them off (`bounded_interval`). Under the
robust loss s^2 is taken from the clipped residuals psi over
their mean slope, sum psi^2 / mean(psi')^2, and J keeps its plain weights (Huber 1973), so that gross errors
widen nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import linalg, special

from exactarm.numerics.trust_region import Model, Step, bounded_step

HUBER = 1.345  # 95 % efficiency at the normal distribution
CONVERGED = "converged"
_STUCK = "no step lowers the square sum"
_GOOD, _POOR, _LEAST_RATIO = 0.9, 0.25, 1e-4  # actual fall beside the promised one: grow, shrink, refuse
_FIRST = 10.0  # first radius beside the size of parameters and data
_GROWTH = 2.5  # of the radius after a good step, beside its length
_MOST_BENT = 0.75  # acceleration beside the step (Transtrum and Sethna 2012)
_PROBE = 0.01  # share of the step at which the second derivative is probed
_ROUNDING = 1e-15  # of the size of the predicted values: a step of no effect
# Where no step gives what the model promises: a kink of the model (a gap, a stop), rounding, or derivatives
# good to a few digits, as long as it is worth less than this, in standard deviations of a parameter; more is
# no convergence.
_UNSEEN = 0.5
_HIDDEN = 1e-12  # of the size of the predicted values: so much may rounding hide of exact data
_KINK = 8  # steps in a row that fall short of their promise: a smooth model keeps it at 2^-8 of a step
# Steps that together gain less than _UNSEEN, where all that is promised is worth less than two standard
# deviations: going on would take hundreds of steps for nothing that counts.
_CRAWL, _NEAR = 40, 2.0
_UNTOLD = 1e-10  # share of a column's square sum beside all others, below which nothing is known of it
_LEAST_PROMISE = 1e-4  # standard deviations: no shorter step is tried


class Evaluation(NamedTuple):
    """residual (R,) = y - f(x), jacobian (R, P) = df/dx; None where only the residual was asked for."""

    residual: np.ndarray
    jacobian: np.ndarray | None


@dataclass(frozen=True)
class Fit:
    """x (P,), covariance (P, P), sigma (weighted residual standard deviation), freedom, state of the search.

    reason: why the search ended; offset: share of the square sum that a linear step from x would still take
    off, computed anew from the last residual and Jacobian; rank: so many directions of the free parameters
    are seen. at_bound (P,) bool; weights (R,) of the robust
    loss, square roots (1 without); slope: mean slope of the clipped residual; cost = half the weighted square
    sum. bounds (2, P); unbounded (2, P): estimate and standard deviation of each parameter were it alone free
    of its bounds (x and the root of the covariance where no bound holds it).
    """

    x: np.ndarray
    covariance: np.ndarray
    sigma: float
    freedom: int
    reason: str
    iterations: int
    cost: float
    at_bound: np.ndarray
    weights: np.ndarray
    residual: np.ndarray
    slope: float
    offset: float
    rank: float
    bounds: np.ndarray
    unbounded: np.ndarray

    @property
    def converged(self) -> bool:
        return self.reason == CONVERGED

    @property
    def clipped(self) -> np.ndarray:
        """(R,) the residual, under the robust loss clipped and scaled so that its spread is that of good
        data."""
        return self.weights**2 * self.residual / self.slope

    def interval(self, level: float = 0.95) -> np.ndarray:
        """(P, 2) confidence intervals, inside the bounds."""
        spread = np.sqrt(np.diag(self.covariance))
        centre, sigma = np.where(self.at_bound, self.unbounded, [self.x, spread])
        return bounded_interval(centre, sigma, self.bounds, self.freedom, level)

    def known_by(self, covariance: np.ndarray, freedom: float) -> Fit:
        """With another covariance (P, P) of the free parameters and its degrees of freedom; what a bound
        holds is as much less certain as they are in the median."""
        own, other = np.sqrt(np.diag(self.covariance)), np.sqrt(np.diag(covariance))
        seen = ~self.at_bound & (own > 0.0)
        wider = float(np.median(other[seen] / own[seen])) if seen.any() else 1.0
        return replace(self, covariance=covariance, freedom=freedom,
                       unbounded=self.unbounded * [[1.0], [wider]])

    def half_width(self, sigma: np.ndarray | float, level: float = 0.95) -> np.ndarray | float:
        """Of the confidence interval of any number with the standard deviation `sigma`."""
        return special.stdtrit(max(self.freedom, 1), 0.5 + 0.5 * level) * sigma


def bounded_interval(centre: np.ndarray, sigma: np.ndarray, bounds: np.ndarray, freedom: float,
                     level: float = 0.95) -> np.ndarray:
    """(P, 2) intervals of numbers between bounds (2, P), whose estimates without them are centre (P,).

    An estimate inside has the common interval, cut off at the bounds: none of what is cut off could be true.
    One beyond a bound has the one-sided interval of the normal (Student's t) posterior that the bound
    truncates: it reaches `level` of what is left of it. The two are the same at the bound itself, and neither
    holds a true value inside the bounds less often than the common interval does.
    """
    lower, upper = bounds
    freedom = max(freedom, 1.0)
    half = special.stdtrit(freedom, 0.5 + 0.5 * level) * sigma
    low, high = centre - half, centre + half
    unit = np.where(sigma > 0.0, sigma, 1.0)
    with np.errstate(invalid="ignore"):
        inside_low, inside_high = ((centre - lower) / unit, (upper - centre) / unit)
    beyond = lambda inside: -special.stdtrit(freedom, (1.0 - level) * special.stdtr(freedom, inside))
    high = np.where(centre < lower, np.maximum(centre + unit * beyond(inside_low), lower), high)
    low = np.where(centre > upper, np.minimum(centre - unit * beyond(inside_high), upper), low)
    return np.stack([np.clip(low, lower, upper), np.clip(high, lower, upper)], axis=1)


def beyond_bounds(estimate: np.ndarray, gram: np.ndarray, downhill: np.ndarray, at_bound: np.ndarray,
                  variance: float) -> np.ndarray:
    """(2, P) values and standard deviations, those at a bound replaced by what the linear model would have
    without it, the free ones moved along and the others at bounds held; infinite where nothing is known.

    gram (P, P) = J'J, downhill (P,): J' times the residual, variance of the residual.
    """
    found, free = estimate.copy(), ~at_bound
    scale = np.sqrt(np.where(np.diag(gram) > 0.0, np.diag(gram), 1.0))
    gram, downhill = gram / np.outer(scale, scale), downhill / scale
    inner = _inverse(gram[np.ix_(free, free)])
    for i in np.flatnonzero(at_bound):
        moved = inner @ gram[free, i]
        left = gram[i, i] - float(gram[i, free] @ moved)
        known = left > _UNTOLD
        found[0, i] += (downhill[i] - float(moved @ downhill[free])) / (left * scale[i]) if known else 0.0
        found[1, i] = np.sqrt(variance / left) / scale[i] if known else np.inf
    return found


def least_squares(
    evaluate: Callable[[np.ndarray, bool], Evaluation],
    start: np.ndarray,
    *,
    weights: np.ndarray | None = None,
    bounds: tuple[np.ndarray, np.ndarray] | None = None,
    robust: bool = False,
    group: int = 1,
    data_rows: int | None = None,
    numbers: float | None = None,
    tolerance: float = 1e-10,
    most_iterations: int = 200,
    normal: Callable[[Evaluation], np.ndarray] | None = None,
) -> Fit:
    """Minimises the weighted residual; `evaluate(x, with_jacobian)`.

    weights (R,): square roots of the inverse variances; `group`: consecutive residuals that share one robust
    weight (3 for a position); `data_rows`: the first so many residuals are data, the rest pseudo-observations
    of a prior, which no robust loss touches; `numbers`: independent numbers that the residuals are worth (as
    many as there are). `tolerance`: converged where the linear model, inside the bounds
    and without any radius, promises a fall of the square sum by less than this share of it. `normal`: J'WJ of
    an evaluation, where there is a shorter way to it; for a loss that is not robust.
    """
    x = np.array(start, float)
    lower, upper = bounds if bounds is not None else (np.full(x.size, -np.inf), np.full(x.size, np.inf))
    x = np.clip(x, lower, upper)
    now = evaluate(x, True)
    w = np.ones_like(now.residual) if weights is None else weights
    data = len(w) if data_rows is None else data_rows
    soft = _robust_weights(w * now.residual, group, data) if robust else np.ones_like(w)
    numbers = len(w) if numbers is None else numbers
    shrunk, least = 0, np.inf  # steps in a row that shrank the radius; square sum where the past was left
    squares: list[float] = []
    radius, scale, reason = np.inf, np.zeros(x.size), f"stopped at the limit of {most_iterations} iterations"
    for iteration in range(1, most_iterations + 1):  # noqa: B007 (told at the end)
        weight = w * soft
        model = _model(now, weight, normal)
        norms = np.sqrt(np.diag(model.normal))
        size, square = _length(norms * x), _length(weight * now.residual) ** 2
        enough = max(tolerance * square, (_ROUNDING * size) ** 2)
        # Never shorter than before (Moré 1978): a column that fades is not let loose. At the end it counts as
        # it is.
        widest = np.maximum(scale, norms)
        for scale in (norms,) if np.array_equal(widest, norms) else (widest, norms):
            unit = np.where(scale > 0.0, scale, 1.0)
            model = model.scaled(unit)
            low, high = (lower - x) * unit, (upper - x) * unit
            whole = bounded_step(model, low, high, np.inf)
            fall = 2.0 * model.fall(whole.step)
            if fall > enough:
                break
        else:
            reason = CONVERGED
            break
        radius = _FIRST * max(size, np.sqrt(square)) if radius == np.inf else radius
        hidden, before, trial = max(_UNSEEN**2 * square / numbers, (_HIDDEN * size) ** 2), radius, None
        squares.append(square)
        near = not robust and fall < _NEAR**2 * square / numbers
        crawls = near and len(squares) > _CRAWL and squares[-1 - _CRAWL] - square < hidden
        if shrunk < _KINK and not crawls:
            trial, there, radius = _descend(evaluate, model, whole, x, now, weight, unit, (lower, upper),
                                            radius, shrunk == 0)
        if trial is None and not crawls and np.any(scale > norms) and least - square > hidden:
            # The past holds columns too short: once more without it, where the last time was worth it.
            scale, radius, shrunk, least = norms, np.inf, 0, square
            continue
        if trial is None:
            short = f"{_CRAWL} steps lower the square sum by less than noise does" if crawls else _STUCK
            reason = CONVERGED if fall <= hidden else short
            break
        shrunk = shrunk + 1 if radius < before else 0
        x, now = trial, there if there.jacobian is not None else evaluate(trial, True)
        if robust:
            soft = _robust_weights(w * now.residual, group, data)
    else:
        model = _model(now, w * soft, normal)
    return _finish(now, w, soft, _mean_slope(soft[:data], group), x, lower, upper, reason, iteration, model)


def _model(now: Evaluation, weight: np.ndarray, normal) -> Model:
    return Model(now.jacobian, -weight * now.residual, weight=weight, normal=normal and normal(now))


def _descend(evaluate, model: Model, whole: Step, x, now: Evaluation, weight, unit, bounds, radius: float,
             hopeful: bool):
    """(next x, its evaluation, next radius): the first step, of shrinking radius, that lowers the square sum;
    None where none does. hopeful: the first is evaluated with its Jacobian, which the next one asks for.

    Inside a curved valley the step follows the geodesic to second order (Transtrum and Sethna 2012): the
    second derivative along the step is taken from two more residuals, and a step that bends more than it
    goes is too long.
    """
    square, smallest = _length(model.residual) ** 2, _ROUNDING * _length(unit * x)
    low, high = (bounds[0] - x) * unit, (bounds[1] - x) * unit
    length_of_whole = _length(whole.step)
    while True:
        step = whole if length_of_whole <= radius else bounded_step(model, low, high, radius)
        length = _length(step.step)
        promised = 2.0 * model.fall(step.step)
        if length <= smallest or promised <= _LEAST_PROMISE**2 * square / len(
            model.residual
        ) and radius < length_of_whole:
            return None, None, radius
        bend = _bend(evaluate, model, step, x, now, weight, unit) if step.shift > 0.0 else np.zeros_like(x)
        trial = np.clip(x + (step.step + 0.5 * bend) / unit, *bounds)
        for bound, met in zip(bounds, (step.step <= low, step.step >= high)):
            trial[met] = bound[met]  # to the last digit, whatever the unit
        ratio = -1.0
        if 2.0 * _length(bend) <= _MOST_BENT * length:
            with np.errstate(over="ignore", invalid="ignore"):
                there, hopeful = evaluate(trial, hopeful), False
                ratio = (square - _length(weight * there.residual) ** 2) / promised
        if not ratio > _POOR:  # not a number where the model has no value there
            radius = 0.25 * length if not ratio > 0.0 else 0.5 * length
        elif ratio > _GOOD:
            radius = max(radius, _GROWTH * length)
        if ratio > _LEAST_RATIO:
            return trial, there, radius


def _bend(evaluate, model: Model, step: Step, x, now: Evaluation, weight, unit) -> np.ndarray:
    """(P,) the geodesic acceleration of the step, in scaled variables; infinite where the model has no
    value."""
    # not by the Jacobian: what it lacks, a percent in the chain of springs, would count twenty times
    near, far = (evaluate(x + part * step.step / unit, False).residual for part in (_PROBE, 2.0 * _PROBE))
    with np.errstate(over="ignore", invalid="ignore"):
        second = weight * (2.0 * near - now.residual - far) / _PROBE**2
    if not np.all(np.isfinite(second)):
        return np.full(len(x), np.inf)
    values, vectors = model.spectrum(step.free)
    bend = np.zeros(len(x))
    onto = vectors.T @ (model.across(second) / model.unit)[step.free]
    bend[step.free] = -vectors @ (onto / (values + step.shift))
    return bend


def _length(values: np.ndarray) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.linalg.norm(values))


def _robust_weights(all_weighted: np.ndarray, group: int, data: int) -> np.ndarray:
    """Square roots of Huber's weights, with the scale from the median of the groups' norms."""
    weighted = all_weighted[:data]
    norm = np.sqrt(np.mean(weighted.reshape(-1, group) ** 2, axis=1))
    # the median of chi-squared, by the incomplete gamma function: scipy.stats takes half a second to import
    scale = np.median(norm) / np.sqrt(2.0 * special.gammaincinv(0.5 * group, 0.5) / group)
    ratio = norm / (HUBER * max(scale, np.finfo(float).tiny))
    soft = np.repeat(np.sqrt(1.0 / np.maximum(ratio, 1.0)), group)
    return np.concatenate([soft, np.ones(len(all_weighted) - data)])


def _mean_slope(soft: np.ndarray, group: int) -> float:
    """Mean of psi': 1 inside; outside a group of g moves freely but along itself, (g - 1) / g of its
    weight."""
    return float(np.mean(np.where(soft == 1.0, 1.0, (group - 1.0) / group * soft**2)))


def gram_inverse(gram: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The inverse of J'J with unit diagonal, and the lengths of the columns of J (1 for an empty one)."""
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale == 0.0, 1.0, scale)
    return _inverse(gram / np.outer(scale, scale)), scale


def _cholesky(gram: np.ndarray) -> np.ndarray | None:
    """Lower factor of a matrix with unit diagonal; None where it is singular to working accuracy."""
    try:
        factor = linalg.cholesky(gram, lower=True, check_finite=False)
    except linalg.LinAlgError:
        return None
    return factor if gram.size == 0 or np.diag(factor).min() > 1e-6 else None


def _inverse(gram: np.ndarray) -> np.ndarray:
    factor = _cholesky(gram)
    if factor is None:
        return np.linalg.pinv(gram, rcond=len(gram) * np.finfo(float).eps, hermitian=True)
    return linalg.cho_solve((factor, True), np.eye(len(gram)), check_finite=False)


def _finish(now, weight, soft, slope, x, lower, upper, reason, iterations, model: Model) -> Fit:
    at_bound = (x <= lower) | (x >= upper)
    free = ~at_bound
    freedom = int(np.sum(weight > 0) - free.sum())
    square = float(np.sum((weight * soft * now.residual) ** 2))
    clipped = float(np.sum((weight * soft**2 * now.residual / slope) ** 2))
    variance = clipped / freedom if freedom > 0 else np.nan
    gram, downhill = model.normal, -model.downhill
    if np.any(soft != 1.0):
        plain = weight[:, None] * now.jacobian
        gram = plain.T @ plain
    covariance = np.zeros((x.size, x.size))
    inverse, scale = gram_inverse(gram[np.ix_(free, free)])
    covariance[np.ix_(free, free)] = variance * inverse / np.outer(scale, scale)
    rank = float(np.sum(inverse * (gram[np.ix_(free, free)] / np.outer(scale, scale))))
    unbounded = np.stack([x, np.sqrt(np.diag(covariance))])
    if at_bound.any():
        unbounded = beyond_bounds(unbounded, gram, downhill / slope, at_bound, variance)
    if gram is not model.normal:
        inverse, scale = gram_inverse(model.normal[np.ix_(free, free)])
    onto = downhill[free] / scale
    return Fit(
        x=x, covariance=covariance, sigma=float(np.sqrt(variance)), freedom=freedom, reason=reason,
        iterations=iterations, cost=0.5 * square, at_bound=at_bound, weights=soft, residual=now.residual,
        slope=slope, rank=rank, bounds=np.stack([lower, upper]), unbounded=unbounded,
        offset=float(onto @ inverse @ onto) / square if square > 0.0 else 0.0,
    )
