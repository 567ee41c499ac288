"""Has an arm changed, and is it worth an alarm? A sequential test on the same few poses, day after day.

    y_d = b + H_j delta [d >= tau] + sigma e,     e ~ N(0, 1)        d: day, y (m,): residuals at the check
    poses, b: what they were

For every hypothesis j (the zero of an axis, base, tool) and every first day tau the Bayes factor against
"nothing has changed" is

    L_(tau,j) = int p(y | b, delta, sigma, tau) / int p(y | b, sigma),  b flat, 1 / sigma, delta ~ N(0,
    sigma^2 g^2 (H' H)^-1)

With these priors of location and scale it is a likelihood ratio of what no unknown b and sigma can change
(the maximal invariant), so that under "nothing has changed" its mean is 1 whatever b and sigma are, from day
tau on (right Haar prior: Berger, Pericchi and Varshavsky 1998; Perez-Ortiz, Lardy, de Heide and Gruenwald
2024). Their sum over tau, with weights over j and g that add up to 1,

    M_t = sum_tau sum_j w_j L_(tau,j)

with H = 1, every number by itself and g at its largest, among the hypotheses (what none of the others can
do, as rows that stand in another order, would leave all of them as unlikely as no change), is an e-detector
of the Shiryaev-Roberts kind (Shin, Ramdas and Rinaldo 2024): M_t - t is a martingale, so that by optional
stopping the mean time to a false alarm at M_t >= c is at least c days. c = days a year: at
most one false alarm a year on the mean. H is the derivative where nothing has moved, so that the prior is the
same whatever is measured; what has moved is then told by fits of the changes themselves (explanation.py).

Limits: noise that is independent from day to day and pose to pose, one change. A day that no other day
repeats counts by its own scatter; the last may be the first of a change, and counts in full where the others
give no alarm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import special

from exactarm.numerics.orthonormal import shown

# Prior sizes g of a change, all numbers of a day together, in standard deviations of one number
SCALES = (1.0, 4.0, 16.0)
# Days back that a change may have begun: leaving out terms keeps the bound, and the work of a day constant
WINDOW = 120
RANK = 1e-6  # of the largest singular value: directions below are not shown by the poses
# p-value of the distance to the nearest other day, below which a day counts by its own scatter
SCATTERED = 1e-3


class Moved(NamedTuple):
    """Displacement f (m,) of a day's numbers, its derivative (m, r), and the covariance (m, m) of what the
    model errs about it."""

    f: np.ndarray
    columns: np.ndarray
    error: np.ndarray


@dataclass(frozen=True)
class Hypothesis:
    """What may have moved.

    columns (m, r): derivative of a day's numbers by its parameters where nothing has moved; at: parameters
    (r,) -> what they do, None: linear.
    """

    name: str
    columns: np.ndarray
    parameters: tuple[str, ...]
    at: Callable[[np.ndarray], Moved] | None = None

    def moved(self, value: np.ndarray) -> Moved:
        if self.at:
            return self.at(value)
        return Moved(self.columns @ value, self.columns, np.zeros((len(self.columns),) * 2))


@dataclass(frozen=True)
class Evidence:
    """Sums over occasions: information (m, m), weighted (m,) = sum A y, square = sum y' A y, numbers = sum
    rank A."""

    information: np.ndarray
    weighted: np.ndarray
    square: float
    numbers: int

    @staticmethod
    def none(size: int) -> Evidence:
        return Evidence(np.zeros((size, size)), np.zeros(size), 0.0, 0)

    def with_day(self, y: np.ndarray, seen: np.ndarray, weight: float = 1.0) -> Evidence:
        """y (m,): numbers of one occasion, zero where not measured; seen (m, m): projection onto what it
        shows; weight: sigma^2 over the variance of this occasion."""
        return self + Evidence(
            weight * seen, weight * (seen @ y), weight * float(y @ seen @ y), int(round(np.trace(seen)))
        )

    def with_scatter(self, square: float, freedom: int) -> Evidence:
        """Further numbers that only tell the noise."""
        return Evidence(self.information, self.weighted, self.square + square, self.numbers + freedom)

    def __add__(self, other: Evidence) -> Evidence:
        return Evidence(
            self.information + other.information,
            self.weighted + other.weighted,
            self.square + other.square,
            self.numbers + other.numbers,
        )


Days = Sequence[tuple[np.ndarray, np.ndarray]]  # y (m,), seen (m, m) of each, as `Evidence.with_day` has them


@dataclass(frozen=True)
class State:
    """After day t: log_bayes (J + 1, G, T): log L of hypothesis j, the last one any move of all numbers,
    scale g of its own and first day tau = first + 0 ... T - 1; -inf where it has fewer scales."""

    log_bayes: np.ndarray
    first: int
    statistic: float


@dataclass(frozen=True)
class Alarms:
    """statistic (T,): M_t; alarm: first day with M_t >= boundary, or None; weights (T,) of the days."""

    statistic: np.ndarray
    boundary: float
    alarm: int | None
    weights: np.ndarray


class Detector:
    """Takes day after day; keeps sums alone, so that a day costs the same after years."""

    def __init__(self, before: Evidence, hypotheses: Sequence[Hypothesis]):
        self.before, self.hypotheses = before, tuple(hypotheses)
        # directions (m, r) and scales of each hypothesis; the last one is any move of all numbers
        self._moves = [(shown(hypothesis.columns, RANK), SCALES) for hypothesis in self.hypotheses]
        self._moves.append((np.eye(len(before.weighted)), SCALES[-1:]))
        self._days: list[Evidence] = []
        self.gone = 0  # days that have left the window

    def step(self, y: np.ndarray, seen: np.ndarray, weight: float = 1.0) -> State:
        """The next day."""
        self._days.append(Evidence.none(len(y)).with_day(y, seen, weight))
        if len(self._days) > WINDOW:
            self.before = self.before + self._days.pop(0)
            self.gone += 1
        information = np.cumsum([day.information for day in self._days][::-1], axis=0)[::-1]
        weighted = np.cumsum([day.weighted for day in self._days][::-1], axis=0)[::-1]
        total = sum(self._days, self.before)
        inverse, rest, freedom = level_of(total)
        shown = information - information @ inverse @ information
        pull = weighted - information @ (inverse @ total.weighted)
        log_bayes = np.full((len(self._moves), len(SCALES), len(self._days)), -np.inf)
        for j, (basis, scales) in enumerate(self._moves):
            values, vectors = np.linalg.eigh(basis.T @ shown @ basis)
            values = np.maximum(values, 0.0)
            parts = np.einsum("tir,ti->tr", vectors, pull @ basis) ** 2
            for g, scale in enumerate(scales):
                gain = scale**2 / (1.0 + scale**2 * values)
                taken = np.minimum(np.sum(parts * gain, axis=1) / max(rest, 1e-300), 1.0 - 1e-12)
                log_bayes[j, g] = -0.5 * np.sum(np.log1p(scale**2 * values), axis=1)
                log_bayes[j, g] -= 0.5 * freedom * np.log1p(-taken)
        weight_of_one = np.log(_priors(len(self.hypotheses)))
        statistic = float(np.exp(np.minimum(special.logsumexp(log_bayes) - weight_of_one, 700.0)))
        return State(log_bayes, self.gone, statistic)


def _priors(count: int) -> int:
    """How many pairs of hypothesis and scale share the weight, with so many causes."""
    return count * len(SCALES) + 1


def detect(before: Evidence, days: Days, hypotheses: Sequence[Hypothesis], boundary: float) -> Alarms:
    """boundary: mean number of days to a false alarm, at the least."""
    weights = day_weights(before, days)
    found = _alarms(before, days, hypotheses, boundary, weights)
    if found.alarm is None and weights[-1] < 1.0:
        found = _alarms(before, days, hypotheses, boundary, np.append(weights[:-1], 1.0))
    return found


def _alarms(
    before: Evidence, days: Days, hypotheses: Sequence[Hypothesis], boundary: float, weights: np.ndarray
) -> Alarms:
    detector = Detector(before, hypotheses)
    steps = zip(days, weights, strict=True)
    statistic = np.array([detector.step(y, seen, float(weight)).statistic for (y, seen), weight in steps])
    over = np.flatnonzero(statistic >= boundary)
    return Alarms(statistic, boundary, int(over[0]) if over.size else None, weights)


def day_weights(before: Evidence, days: Days) -> np.ndarray:
    """(T,) sigma^2 over the variance of each day, 1 where BEFORE or another day repeats it.

    The variance is the mean square distance from the nearest of them in what both show: a change lasts, so
    that each of its days has another one beside it; a day of larger noise has none.
    """
    inverse, rest, freedom = level_of(before)
    variance = rest / max(freedom, 1)
    y, seen = (np.array(parts) for parts in zip(*days, strict=True))
    known = before.information @ inverse  # projection onto what BEFORE shows
    others = np.concatenate([y, [inverse @ before.weighted]])
    shows = np.concatenate([seen, [known]])
    weights = np.ones(len(y))
    for d in range(len(y)):
        both = seen[d] @ shows @ seen[d]
        numbers = np.trace(both, axis1=1, axis2=2)
        apart = y[d] - others
        spread = np.full(len(others), 2.0) * numbers  # mean square of `apart`, over sigma^2
        spread[-1] = numbers[-1] + np.trace(both[-1] @ inverse)
        ratio = np.einsum("ti,tij,tj->t", apart, both, apart) / np.maximum(spread * variance, 1e-300)
        ratio[(numbers < 0.5) | (np.arange(len(others)) == d)] = np.inf
        near = int(np.argmin(ratio))
        if np.isfinite(ratio[near]) and special.fdtrc(numbers[near], freedom, ratio[near]) < SCATTERED:
            weights[d] = 1.0 / ratio[near]
    return weights


def level_of(evidence: Evidence) -> tuple[np.ndarray, float, int]:
    """Inverse information of one level for all occasions, square sum that it leaves, and its freedom."""
    information = evidence.information
    inverse = np.linalg.pinv(information, rcond=RANK, hermitian=True)
    rest = evidence.square - float(evidence.weighted @ inverse @ evidence.weighted)
    rank = np.linalg.matrix_rank(information, tol=RANK * max(np.trace(information), 1e-300), hermitian=True)
    return inverse, max(rest, 0.0), evidence.numbers - int(rank)


def detectable(
    hypothesis: Hypothesis, column: int, occasions: float, days: int, boundary: float, count: int
) -> float:
    """Size of one parameter's change, in sigma, that raises the alarm within so many days where the noise is
    at its mean.

    occasions: of each pose before; count: of hypotheses. Large degrees of freedom.
    """
    share = occasions * days / (occasions + days)
    rank = shown(hypothesis.columns, RANK).shape[1]
    goal = np.log(boundary * _priors(count))
    sizes = []
    for scale in SCALES:
        spread = scale**2 * share
        sizes.append(
            np.sqrt(2.0 * (goal + 0.5 * rank * np.log1p(spread)) * (1.0 + spread) / (share * spread))
        )
    return float(min(sizes) / max(np.linalg.norm(hypothesis.columns[:, column]), 1e-300))
