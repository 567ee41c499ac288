"""What has moved, and since which day: every hypothesis fitted as it is, not as its derivative.

Parted at a first day tau, the days tell of the displacement f (m,) since then

    z = T f + sigma e,    T = Lambda^(1/2) V',  V Lambda V' = I_2 - I_2 (I_1 + I_2)^-1 I_2

with I_1, I_2 the information of the days before and from tau on, level and noise unknown; what no f changes
is the pure scatter S. A hypothesis says f = f_j(delta), and its model errs about it with covariance E
(`Hypothesis.moved`). The fit is

    Q = S + (z - T f)' W^-1 (z - T f),    W = 1 + T E T' / sigma^2

by Levenberg's and Marquardt's steps in delta, the day chosen again by the derivative at the fit. How likely
hypothesis and day are follows from the marginal likelihood under priors of delta as wide as its own estimate
(local empirical Bayes: Liang et al. 2008),

    -1/2 nu log Q - 1/2 log det W - 1/2 r log(1 + (z'z + S - Q) / (r sigma^2))
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, special

from exactarm.numerics.factors import lstsq, svd
from exactarm.verify.change import RANK, WINDOW, Alarms, Days, Evidence, Hypothesis, Moved, level_of

CREDIBLE = 0.95
_STEPS, _ROUNDS, _MOST_DAMPING = 60, 6, 1e6
_LEAST_FALL = 1e-9  # of the square sum, relative: the search ends
# Of a displacement: a model that is right to a part in some hundreds tells nothing by less (a base that is
# found anew every day)
_LEAST_SEEN = 1e-2
_SETTLED = 1e-4  # of the variance of a number: the displacement stays


@dataclass(frozen=True)
class Cause:
    """One explanation at its likeliest first day: estimates (r,) with intervals (r, 2).

    unexplained: p-value of what it leaves of the displacement.
    """

    name: str
    probability: float
    first_day: int
    days: tuple[int, int]
    parameters: tuple[str, ...]
    estimate: np.ndarray
    intervals: np.ndarray
    unexplained: float


@dataclass(frozen=True)
class Explanation:
    """causes: sorted, the likeliest first; apart: names that explain the days as well as the first; sigma,
    freedom: noise of a number."""

    causes: tuple[Cause, ...]
    apart: tuple[str, ...]
    sigma: float
    freedom: int

    @property
    def unexplained(self) -> float:
        return self.causes[0].unexplained


@dataclass(frozen=True)
class _Parted:
    """The days parted at one first day: root T (k, m), z (k,), scatter S, freedom nu."""

    root: np.ndarray
    z: np.ndarray
    scatter: float
    freedom: int

    @cached_property
    def size(self) -> float:
        """Largest singular value of T: as dear as all the rest of a fit."""
        return float(np.linalg.norm(self.root, 2))

    def slope(self, half: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """L^-1 T H; zero where the days show next to nothing of what a parameter moves."""
        seen = self.root @ columns
        whole = np.linalg.norm(columns, axis=0) * self.size
        return _whitened(half, np.where(np.linalg.norm(seen, axis=0) > _LEAST_SEEN * whole, seen, 0.0))

    @property
    def variance(self) -> float:
        return max(self.scatter / max(self.freedom - len(self.z), 1), 1e-300)

    def half(self, error: np.ndarray) -> np.ndarray:
        """Lower triangle L (k, k), L L' = W of the covariance E (m, m)."""
        return np.linalg.cholesky(np.eye(len(self.z)) + self.root @ error @ self.root.T / self.variance)


@dataclass(frozen=True)
class _Fit:
    """A hypothesis at one first day: value (r,), Q - S, log det W, and the log of how likely it is."""

    value: np.ndarray
    left: float
    log_det: float
    rank: int
    covariance: np.ndarray
    score: float


def explain(
    before: Evidence, days: Days, hypotheses: Sequence[Hypothesis], alarms: Alarms,
    displaced: Callable[[np.ndarray], Days] | None = None,
) -> Explanation:
    """displaced: displacement f (m,) -> the days as they are seen beside it, where that depends on it."""
    start = max((len(days) - 1 if alarms.alarm is None else alarms.alarm) + 1 - WINDOW, 0)
    evidence = _evidence(days, alarms.weights)
    early, present = sum(evidence[:start], before), evidence[start:]
    still = _parted(early, present, present)

    def parted(f: np.ndarray) -> list[_Parted]:
        if displaced is None:
            return still
        return _parted(early, present, _evidence(displaced(f), alarms.weights)[start:])

    found = [(hypothesis, *_search(hypothesis, still, parted)) for hypothesis in hypotheses]
    total = special.logsumexp([fit.score for _, fits, _, _ in found for fit in fits])
    rows = []
    for hypothesis, fits, parts, day in found:
        share = np.exp(np.array([fit.score for fit in fits]) - total)
        rows.append((_cause(hypothesis, fits[day], parts[day], day, share, start), fits[day], parts[day]))
    rows.sort(key=lambda row: -row[0].probability)
    (best, fitted, part), *others = rows
    likely = lambda fit, part_: (part_.scatter + fit.left) / part.variance + fit.log_det  # -2 log, + constant
    apart = tuple(
        cause.name for cause, fit, other in others
        if likely(fit, other) - likely(fitted, part)
        < special.chdtri(max(fitted.rank - fit.rank, 1), 1.0 - CREDIBLE)
    )
    causes = (best, *(cause for cause, _, _ in others))
    return Explanation(causes, apart, float(np.sqrt(part.variance)), max(part.freedom - len(part.z), 0))


def _evidence(days: Days, weights: np.ndarray) -> list[Evidence]:
    none = Evidence.none(len(days[0][0]))
    return [none.with_day(y, seen, float(weight)) for (y, seen), weight in zip(days, weights, strict=True)]


def _search(
    hypothesis: Hypothesis, parts: list[_Parted], parted: Callable[[np.ndarray], list[_Parted]]
) -> tuple[list[_Fit], list[_Parted], int]:
    """The fits at every first day, by the derivative at the best; the days so parted; the best day."""
    value, day = np.zeros(hypothesis.columns.shape[1]), -1
    moved = hypothesis.moved(value)
    for _ in range(_ROUNDS):
        fits = _by_derivative(parts, value, moved)
        before, day, f = day, int(np.argmax([fit.score for fit in fits])), moved.f
        value, moved = _at_its_best(hypothesis, parts[day], value, moved)
        if day == before and np.sum((moved.f - f) ** 2) <= _SETTLED * parts[day].variance:
            break
        parts = parted(moved.f)
    fits = _by_derivative(parts, value, moved)
    return fits, parts, int(np.argmax([fit.score for fit in fits]))


def _at_its_best(hypothesis: Hypothesis, part: _Parted, value: np.ndarray,
                 moved: Moved) -> tuple[np.ndarray, Moved]:
    """delta from `value` on, by Levenberg and Marquardt, and what it moves."""
    damping = 1e-6
    for _ in range(_STEPS):
        half = part.half(moved.error)
        residual = _whitened(half, part.z - part.root @ moved.f)
        slope = part.slope(half, moved.columns)
        scale = np.maximum(np.linalg.norm(slope, axis=0), 1e-300)
        damped = np.vstack([slope / scale, np.sqrt(damping) * np.eye(len(value))])
        step = lstsq(damped, np.append(residual, np.zeros(len(value))), rcond=RANK)[0] / scale
        trial = hypothesis.moved(value + step)
        new = _whitened(half, part.z - part.root @ trial.f)
        fall = residual @ residual - new @ new
        if fall <= 0.0 and damping > _MOST_DAMPING:
            break
        damping *= 0.1 if fall > 0.0 else 10.0
        if fall > 0.0:
            value, moved = value + step, trial
            if fall < _LEAST_FALL * (new @ new + part.scatter):
                break
    return value, moved


def _by_derivative(parts: list[_Parted], value: np.ndarray, moved: Moved) -> list[_Fit]:
    """At every first day, by the derivative at `value`."""
    offset = moved.f - moved.columns @ value
    return [_linear(part, offset, moved.columns, part.half(moved.error)) for part in parts]


def _linear(part: _Parted, offset: np.ndarray, columns: np.ndarray, half: np.ndarray) -> _Fit:
    """f = offset + columns delta at its best delta."""
    slope, target = part.slope(half, columns), _whitened(half, part.z - part.root @ offset)
    scale = np.maximum(np.linalg.norm(slope, axis=0), 1e-300)
    u, values, vt = svd(slope / scale, full_matrices=False)
    kept = values > RANK * max(values.max(initial=0.0), 1e-300)
    inverse = (vt[kept].T / values[kept]) / scale[:, None]
    value = inverse @ (u[:, kept].T @ target)
    left = float(np.sum((target - slope @ value) ** 2))
    rank, log_det = int(np.count_nonzero(kept)), 2.0 * float(np.sum(np.log(np.diag(half))))
    taken = max(float(part.z @ part.z) - left, 0.0) / (max(rank, 1) * part.variance)
    score = -0.5 * part.freedom * np.log(max(part.scatter + left, 1e-300))
    score -= 0.5 * log_det + 0.5 * rank * np.log1p(taken)
    return _Fit(value, left, log_det, rank, inverse @ inverse.T, float(score))


def _whitened(half: np.ndarray, values: np.ndarray) -> np.ndarray:
    return linalg.solve_triangular(half, values, lower=True)


def _cause(
    hypothesis: Hypothesis, fit: _Fit, part: _Parted, day: int, share: np.ndarray, start: int
) -> Cause:
    freedom = max(part.freedom - fit.rank, 1)
    half = special.stdtrit(freedom, 0.5 + 0.5 * CREDIBLE) * np.sqrt(
        (part.scatter + fit.left) / freedom * np.maximum(np.diag(fit.covariance), 0.0)
    )
    more, others = len(part.z) - fit.rank, part.freedom - len(part.z)
    unexplained = 1.0
    if more > 0 and others > 0 and part.scatter > 0.0:
        unexplained = float(special.fdtrc(more, others, fit.left / more / part.variance))
    first, last = _credible(share / max(share.sum(), 1e-300))
    return Cause(
        hypothesis.name,
        float(share.sum()),
        start + day,
        (start + first, start + last),
        hypothesis.parameters,
        fit.value,
        np.stack([fit.value - half, fit.value + half], axis=1),
        unexplained,
    )


def _parted(before: Evidence, days: Sequence[Evidence], later: Sequence[Evidence]) -> list[_Parted]:
    """At each first day: the days before it as in `days`, those from it on as in `later`."""
    late = [later[-1]]
    for day in reversed(later[:-1]):
        late.insert(0, day + late[0])
    parts, early = [], before
    for day, rest in zip(days, late, strict=True):
        parts.append(_part(early, rest))
        early = early + day
    return parts


def _part(early: Evidence, late: Evidence) -> _Parted:
    total = early + late
    inverse, rest, freedom = level_of(total)
    shown = late.information - late.information @ inverse @ late.information
    pull = late.weighted - late.information @ (inverse @ total.weighted)
    values, vectors = np.linalg.eigh(0.5 * (shown + shown.T))
    kept = values > RANK * max(np.trace(total.information), 1e-300)
    values, vectors = values[kept], vectors[:, kept]
    z = (vectors.T @ pull) / np.sqrt(values)
    return _Parted(np.sqrt(values)[:, None] * vectors.T, z, max(rest - float(z @ z), 0.0), freedom)


def _credible(share: np.ndarray) -> tuple[int, int]:
    """First and last day of the smallest set of days that holds `CREDIBLE` of the probability."""
    order = np.argsort(-share)
    kept = order[: int(np.searchsorted(np.cumsum(share[order]), CREDIBLE)) + 1]
    return int(kept.min()), int(kept.max())
