"""Has an arm changed, what, and since which day? A sequential test on the same few poses, day after day.

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

is an e-detector of the Shiryaev-Roberts kind (Shin, Ramdas and Rinaldo 2024): M_t - t is a martingale, so
that by optional stopping the mean time to a false alarm at M_t >= c is at least c days. c = days a year: at
most one false alarm a year on the mean. Limits: noise that is independent from day to day and pose to pose,
one change, the linear effect of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

# Prior sizes g of a change, all numbers of a day together, in standard deviations of one number
SCALES = (1.0, 4.0, 16.0)
# Days back that a change may have begun: leaving out terms keeps the bound, and the work of a day constant
WINDOW = 120
RANK = 1e-6  # of the largest singular value: directions below are not shown by the poses
CREDIBLE = 0.95
TOLD_APART = 3.84  # chi^2 of one degree of freedom, 95 %: an explanation worse by less is as good


@dataclass(frozen=True)
class Hypothesis:
    """What may have moved: columns (m, r), derivative of a day's numbers by its parameters."""

    name: str
    columns: np.ndarray
    parameters: tuple[str, ...]


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

    def with_day(self, y: np.ndarray, seen: np.ndarray) -> Evidence:
        """y (m,): numbers of one occasion, zero where not measured; seen (m, m): projection onto what it
        shows."""
        return Evidence(
            self.information + seen,
            self.weighted + seen @ y,
            self.square + float(y @ seen @ y),
            self.numbers + int(round(np.trace(seen))),
        )

    def with_scatter(self, square: float, freedom: int) -> Evidence:
        """Further numbers that only tell the noise."""
        return Evidence(self.information, self.weighted, self.square + square, self.numbers + freedom)


@dataclass(frozen=True)
class State:
    """After day t: log_bayes (J, G, T): log L of hypothesis j, scale g and first day tau = first + 0 ... T -
    1."""

    log_bayes: np.ndarray
    first: int
    statistic: float


@dataclass(frozen=True)
class Cause:
    """One explanation at its likeliest first day: estimates (r,) with intervals (r, 2), square sum that it
    leaves."""

    name: str
    probability: float
    first_day: int
    days: tuple[int, int]
    parameters: tuple[str, ...]
    estimate: np.ndarray
    intervals: np.ndarray
    left: float


@dataclass(frozen=True)
class Change:
    """statistic (T,): M_t; alarm: first day with M_t >= boundary, or None; causes: sorted, the likeliest
    first.

    apart: names that explain the data as well as the first. unexplained: p-value of what the first leaves of
    the change.
    """

    statistic: np.ndarray
    boundary: float
    alarm: int | None
    causes: tuple[Cause, ...]
    apart: tuple[str, ...]
    unexplained: float
    sigma: float
    freedom: int


class Detector:
    """Takes day after day; keeps sums alone, so that a day costs the same after years."""

    def __init__(self, before: Evidence, hypotheses: Sequence[Hypothesis]):
        self.before, self.hypotheses = before, tuple(hypotheses)
        self._bases = [_basis(hypothesis.columns) for hypothesis in self.hypotheses]
        self._days: list[Evidence] = []
        self.gone = 0  # days that have left the window

    def step(self, y: np.ndarray, seen: np.ndarray) -> State:
        """The next day."""
        self._days.append(Evidence.none(len(y)).with_day(y, seen))
        if len(self._days) > WINDOW:
            self.before = _sum([self.before, self._days.pop(0)])
            self.gone += 1
        later, total, inverse, rest, freedom = self.sums()
        shown = later[0] - later[0] @ inverse @ later[0]
        pull = later[1] - (later[0] @ inverse @ total.weighted)
        log_bayes = np.full((len(self._bases), len(SCALES), len(self._days)), 0.0)
        for j, basis in enumerate(self._bases):
            values, vectors = np.linalg.eigh(basis.T @ shown @ basis)
            values = np.maximum(values, 0.0)
            parts = np.einsum("tir,ti->tr", vectors, pull @ basis) ** 2
            for g, scale in enumerate(SCALES):
                gain = scale**2 / (1.0 + scale**2 * values)
                taken = np.minimum(np.sum(parts * gain, axis=1) / max(rest, 1e-300), 1.0 - 1e-12)
                log_bayes[j, g] = -0.5 * np.sum(np.log1p(scale**2 * values), axis=1)
                log_bayes[j, g] -= 0.5 * freedom * np.log1p(-taken)
        weight = np.log(len(self._bases) * len(SCALES))
        statistic = float(np.exp(np.minimum(special.logsumexp(log_bayes) - weight, 700.0)))
        return State(log_bayes, self.gone, statistic)

    def sums(self) -> tuple[tuple[np.ndarray, np.ndarray], Evidence, np.ndarray, float, int]:
        """Information (T, m, m) and weighted (T, m) from each day to the last; all; its inverse; scatter and
        its freedom."""
        information = np.cumsum([day.information for day in self._days][::-1], axis=0)[::-1]
        weighted = np.cumsum([day.weighted for day in self._days][::-1], axis=0)[::-1]
        total = _sum([self.before, *self._days])
        inverse = np.linalg.pinv(total.information, rcond=RANK, hermitian=True)
        rest = max(total.square - float(total.weighted @ inverse @ total.weighted), 0.0)
        freedom = total.numbers - int(
            np.linalg.matrix_rank(total.information, tol=RANK * np.trace(total.information), hermitian=True)
        )
        return (information, weighted), total, inverse, rest, freedom


def detect(
    before: Evidence,
    days: Sequence[tuple[np.ndarray, np.ndarray]],
    hypotheses: Sequence[Hypothesis],
    boundary: float,
) -> Change:
    """days: (y, seen) of each; boundary: mean number of days to a false alarm, at the least."""
    detector = Detector(before, hypotheses)
    states = [detector.step(y, seen) for y, seen in days]
    statistic = np.array([state.statistic for state in states])
    over = np.flatnonzero(statistic >= boundary)
    causes, unexplained, sigma, freedom = _causes(detector, states[-1])
    best = causes[0]
    apart = tuple(other.name for other in causes[1:] if other.left - best.left < TOLD_APART * sigma**2)
    return Change(
        statistic, boundary, int(over[0]) if over.size else None, causes, apart, unexplained, sigma, freedom
    )


def detectable(
    hypothesis: Hypothesis, column: int, occasions: float, days: int, boundary: float, count: int
) -> float:
    """Size of one parameter's change, in sigma, that raises the alarm within so many days where the noise is
    at its mean.

    occasions: of each pose before; count: of hypotheses. Large degrees of freedom.
    """
    share = occasions * days / (occasions + days)
    rank = _basis(hypothesis.columns).shape[1]
    goal = np.log(boundary * count * len(SCALES))
    sizes = []
    for scale in SCALES:
        spread = scale**2 * share
        sizes.append(
            np.sqrt(2.0 * (goal + 0.5 * rank * np.log1p(spread)) * (1.0 + spread) / (share * spread))
        )
    return float(min(sizes) / max(np.linalg.norm(hypothesis.columns[:, column]), 1e-300))


def _causes(detector: Detector, state: State) -> tuple[tuple[Cause, ...], float, float, int]:
    """Every hypothesis at its likeliest day; what the best one leaves of the change; the noise beside the
    best one."""
    later, total, inverse, rest, freedom = detector.sums()
    weight = special.logsumexp(state.log_bayes, axis=1)
    over_days = special.logsumexp(weight, axis=1)
    probability = np.exp(over_days - special.logsumexp(over_days))
    found, whole = [], {}
    for j, hypothesis in enumerate(detector.hypotheses):
        share = np.exp(weight[j] - over_days[j])
        day = int(np.argmax(share))
        shown = later[0][day] - later[0][day] @ inverse @ later[0][day]
        pull = later[1][day] - later[0][day] @ inverse @ total.weighted
        columns = hypothesis.columns
        information = columns.T @ shown @ columns
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        spread = np.linalg.pinv(
            information / np.outer(scale, scale), rcond=RANK**2, hermitian=True
        ) / np.outer(scale, scale)
        estimate = spread @ (columns.T @ pull)
        explained = float(estimate @ columns.T @ pull)
        rank = int(np.linalg.matrix_rank(information / np.outer(scale, scale), tol=RANK**2, hermitian=True))
        all_of_it = float(pull @ np.linalg.pinv(shown, rcond=RANK, hermitian=True) @ pull)
        directions = int(
            np.linalg.matrix_rank(shown, tol=RANK * max(np.trace(shown), 1e-300), hermitian=True)
        )
        variance = max(rest - all_of_it, 0.0) / max(freedom - directions, 1)
        half = special.stdtrit(max(freedom - rank, 1), 0.975) * np.sqrt(
            max(rest - explained, 0.0) / max(freedom - rank, 1) * np.maximum(np.diag(spread), 0.0)
        )
        days = _credible(share)
        found.append(
            Cause(
                hypothesis.name,
                float(probability[j]),
                detector.gone + day,
                (detector.gone + days[0], detector.gone + days[1]),
                hypothesis.parameters,
                estimate,
                np.stack([estimate - half, estimate + half], axis=1),
                rest - explained,
            )
        )
        whole[hypothesis.name] = (all_of_it - explained, directions - rank, variance, freedom - directions)
    found.sort(key=lambda cause: -cause.probability)
    left, more, variance, others = whole[found[0].name]
    unexplained = 1.0
    if more > 0 and others > 0 and variance > 0.0:
        unexplained = float(special.fdtrc(more, others, max(left, 0.0) / more / variance))
    return tuple(found), unexplained, float(np.sqrt(variance)), max(others, 0)


def _credible(share: np.ndarray) -> tuple[int, int]:
    """First and last day of the smallest set of days that holds `CREDIBLE` of the probability."""
    order = np.argsort(-share)
    kept = order[: int(np.searchsorted(np.cumsum(share[order]), CREDIBLE)) + 1]
    return int(kept.min()), int(kept.max())


def _basis(columns: np.ndarray) -> np.ndarray:
    """(m, r) orthonormal, of what the poses show of the columns."""
    scale = np.linalg.norm(columns, axis=0)
    u, values, _ = np.linalg.svd(columns / np.where(scale > 0.0, scale, 1.0), full_matrices=False)
    return u[:, values > RANK * max(values.max(initial=0.0), 1e-300)]


def _sum(parts: Sequence[Evidence]) -> Evidence:
    return Evidence(
        np.sum([part.information for part in parts], axis=0),
        np.sum([part.weighted for part in parts], axis=0),
        float(sum(part.square for part in parts)),
        sum(part.numbers for part in parts),
    )
