"""Weighted non-linear least squares with an analytic Jacobian, and what may be said of its result.

    minimise  sum_r rho(|w_r (y_r - f_r(x))|^2)   over lower <= x <= upper

Levenberg-Marquardt on scaled columns (Moré 1978) with the active bounds held; a robust loss is handled by
iteratively reweighted residuals (Huber 1964). Covariance: s^2 (J' W J)^{-1} with s^2 from N - P degrees of
freedom (frames and all other free parameters counted), intervals by Student's t. Under the robust loss s^2 is taken
from the clipped residuals psi over their mean slope, sum psi^2 / mean(psi')^2, and J keeps its plain weights (Huber
1973), so that gross errors widen nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, NamedTuple

import numpy as np
from scipy import linalg, special

HUBER = 1.345  # 95 % efficiency at the normal distribution


class Evaluation(NamedTuple):
    """residual (R,) = y - f(x), jacobian (R, P) = df/dx; None where only the residual was asked for."""

    residual: np.ndarray
    jacobian: np.ndarray | None


@dataclass(frozen=True)
class Fit:
    """x (P,), covariance (P, P), sigma (weighted residual standard deviation), freedom, state of the search.

    at_bound (P,) bool; weights (R,) of the robust loss, square roots (1 without); slope: mean slope of the clipped
    residual; cost = half the weighted square sum.
    """

    x: np.ndarray
    covariance: np.ndarray
    sigma: float
    freedom: int
    converged: bool
    iterations: int
    cost: float
    at_bound: np.ndarray
    weights: np.ndarray
    residual: np.ndarray
    slope: float = 1.0

    @property
    def clipped(self) -> np.ndarray:
        """(R,) the residual, under the robust loss clipped and scaled so that its spread is that of good data."""
        return self.weights**2 * self.residual / self.slope

    def interval(self, level: float = 0.95) -> np.ndarray:
        """(P, 2) confidence intervals."""
        half = self.half_width(np.sqrt(np.diag(self.covariance)), level)
        return np.stack([self.x - half, self.x + half], axis=1)

    def half_width(self, sigma: np.ndarray | float, level: float = 0.95) -> np.ndarray | float:
        """Of the confidence interval of any number with the standard deviation `sigma`."""
        return special.stdtrit(max(self.freedom, 1), 0.5 + 0.5 * level) * sigma


def least_squares(
    evaluate: Callable[[np.ndarray, bool], Evaluation],
    start: np.ndarray,
    *,
    weights: np.ndarray | None = None,
    bounds: tuple[np.ndarray, np.ndarray] | None = None,
    robust: bool = False,
    group: int = 1,
    data_rows: int | None = None,
    tolerance: float = 1e-10,
    most_iterations: int = 60,
) -> Fit:
    """Minimises the weighted residual; `evaluate(x, with_jacobian)`.

    weights (R,): square roots of the inverse variances; `group`: consecutive residuals that share one robust
    weight (3 for a position); `data_rows`: the first so many residuals are data, the rest pseudo-observations of a
    prior, which no robust loss touches. Converged when no scaled step is larger than `tolerance` of its parameter's
    own uncertainty-free scale, or the cost cannot fall any further.
    """
    x = np.array(start, float)
    lower, upper = bounds if bounds is not None else (np.full(x.size, -np.inf), np.full(x.size, np.inf))
    x = np.clip(x, lower, upper)
    now = evaluate(x, True)
    w = np.ones_like(now.residual) if weights is None else weights
    damping, converged, iteration = 0.0, False, 0
    data = len(w) if data_rows is None else data_rows
    soft = _robust_weights(w * now.residual, group, data) if robust else np.ones_like(w)
    for iteration in range(1, most_iterations + 1):
        weight = w * soft
        step, gain, held = _step(now, weight, x, lower, upper, damping)
        trial_x = np.clip(x + step, lower, upper)
        trial = evaluate(trial_x, False)
        cost, trial_cost = _cost(now.residual, weight), _cost(trial.residual, weight)
        if not np.isfinite(trial_cost) or trial_cost > cost * (1.0 + 1e-14):
            if gain <= tolerance * cost:
                converged = True
                break
            damping = max(10.0 * damping, 1e-6)
            if damping > 1e12:
                break
            continue
        small = cost - trial_cost <= tolerance * max(cost, np.finfo(float).tiny)
        x, damping = trial_x, 0.0 if damping <= 1e-6 else 0.1 * damping
        now = evaluate(x, True)
        changed = 0.0
        if robust:
            before, soft = soft, _robust_weights(w * now.residual, group, data)
            changed = float(np.max(np.abs(soft - before), initial=0.0))
        if small and changed < 1e-3:
            converged = True
            break
    return _finish(now, w, soft, _mean_slope(soft[:data], group), x, lower, upper, converged, iteration)


def _cost(residual: np.ndarray, weight: np.ndarray) -> float:
    return 0.5 * float(np.sum((weight * residual) ** 2))


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
    """Mean of psi': 1 inside; outside a group of g moves freely but along itself, (g - 1) / g of its weight."""
    return float(np.mean(np.where(soft == 1.0, 1.0, (group - 1.0) / group * soft**2)))


def _step(now: Evaluation, weight, x, lower, upper, damping):
    """Damped Gauss-Newton step on scaled columns; parameters that push against their bound are held."""
    jacobian, residual = weight[:, None] * now.jacobian, weight * now.residual
    gradient = jacobian.T @ residual
    held = ((x <= lower) & (gradient < 0)) | ((x >= upper) & (gradient > 0))
    free = ~held
    gram, scale = _scaled_gram(jacobian[:, free] if held.any() else jacobian)
    step = np.zeros_like(x)
    step[free] = _solve(gram, gradient[free] / scale, damping) / scale
    return step, 0.5 * float(step @ gradient), held


def _scaled_gram(jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """J'J with unit diagonal, and the lengths of the columns of J (1 for an empty one)."""
    gram = jacobian.T @ jacobian
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0.0] = 1.0
    return gram / np.outer(scale, scale), scale


def _solve(normal: np.ndarray, right: np.ndarray, damping: float) -> np.ndarray:
    """Solves the scaled normal equations; directions below rounding get no step."""
    if right.size == 0:
        return right
    factor = _cholesky(normal + damping * np.eye(len(right)))
    if factor is not None:
        return linalg.cho_solve((factor, True), right, check_finite=False)
    values, vectors = linalg.eigh(normal)
    keep = values > 1e-13 * values[-1]
    projected = vectors.T @ right
    return vectors @ np.where(keep, projected / (np.where(keep, values, 1.0) + damping), 0.0)


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
        return linalg.pinvh(gram)
    return linalg.cho_solve((factor, True), np.eye(len(gram)), check_finite=False)


def _finish(now, weight, soft, slope, x, lower, upper, converged, iterations) -> Fit:
    jacobian = weight[:, None] * now.jacobian
    at_bound = (x <= lower) | (x >= upper)
    free = ~at_bound
    freedom = int(np.sum(weight > 0) - free.sum())
    square = float(np.sum((weight * soft * now.residual) ** 2))
    clipped = float(np.sum((weight * soft**2 * now.residual / slope) ** 2))
    variance = clipped / freedom if freedom > 0 else np.nan
    covariance = np.zeros((x.size, x.size))
    gram, scale = _scaled_gram(jacobian[:, free])
    inverse = _inverse(gram)
    covariance[np.ix_(free, free)] = variance * inverse / np.outer(scale, scale)
    return Fit(
        x, covariance, float(np.sqrt(variance)), freedom, converged, iterations, 0.5 * square, at_bound, soft, now.residual,
        slope,
    )
