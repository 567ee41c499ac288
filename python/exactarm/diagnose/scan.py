"""Scan: how much of the residual each candidate would explain beyond what the declared parameters can absorb.

For whitened residual r, basis Q of the free parameters and a candidate's columns C:
    C~ = C - Q Q'C,    gain = r'C~ (C~'C~)^{-1} C~'r,
the fall of the weighted square sum if the candidate were fitted jointly with everything else. Non-linear
parameters run over their search grids. Evidence (Schwarz 1978; the last two terms pay for what was tried):
    log B = n/2 log(S / (S - gain)) - k/2 log n - log(grid points) - log(candidates) + prior log odds.
A candidate of many regularised terms (Gaussian priors, standard deviations P) pays by its marginal likelihood
instead: gain = r'C~ (C~'C~ + P^-2)^{-1} C~'r, and 1/2 log det(I + P C~'C~ P) in place of k/2 log n (MacKay
1992).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import product

import numpy as np

from exactarm.diagnose.decisions import ABSORBED, INVISIBLE
from exactarm.diagnose.fitted import Fitted
from exactarm.effects.base import Effect
from exactarm.numerics.factors import lstsq


@dataclass(frozen=True)
class Candidate:
    """An effect at its best values in the linear picture, and what it would earn."""

    effect: Effect
    gain: float
    free: int
    tried: int
    evidence: float

    @property
    def label(self) -> str:
        return self.effect.label


def log_evidence(square: float, gain: float, count: float, free: int, tried: float) -> float:
    """Log Bayes factor of a candidate against the model without it."""
    left = max(square - gain, 1e-12 * square)
    return 0.5 * count * np.log(square / left) - 0.5 * free * np.log(count) - np.log(tried)


def grid(effect: Effect) -> list[Effect]:
    """The effect at every combination of its non-linear parameters' search values."""
    parameters = effect.parameters()
    searched = [(i, dict.fromkeys((*p.search, effect.values[i]))) for i, p in enumerate(parameters)
                if p.search]
    variants = []
    for combination in product(*(values for _, values in searched)):
        values = list(effect.values)
        for (i, _), value in zip(searched, combination):
            values[i] = value
        variants.append(effect.with_values(values))
    return variants


def free_mask(effect: Effect) -> np.ndarray:
    """(k,) the parameters that are estimated linearly: neither fixed nor searched."""
    return np.array([not p.fixed and not p.search for p in effect.parameters()], bool)


def linear_columns(fitted: Fitted, effect: Effect) -> np.ndarray:
    """(R, k) whitened response to the parameters that are estimated linearly."""
    return fitted.columns(effect)[:, free_mask(effect)]


def scan(fitted: Fitted, candidates: list[Effect], count: float) -> list[Candidate]:
    """All candidates, best evidence first; of each (name, axis) only its best point."""
    square = float(fitted.free_residual @ fitted.free_residual)
    best: dict[str, Candidate] = {}
    families = len({effect.label for effect in candidates})
    variants = [(effect.label, mask, point) for effect, mask in zip(candidates, map(free_mask, candidates))
                for point in grid(effect)]
    points = Counter(label for label, *_ in variants)
    # a searched order may be in the label
    tried = {point.label: points[label] for label, _, point in variants}
    linear: list[tuple[Effect, np.ndarray]] = []
    for _, mask, point in variants:
        kept = point.keep(fitted.view)
        if kept is not None:
            best[point.label] = _excluding(fitted, point, kept, count, families)
        else:
            linear.append((point, mask))
    products = fitted.products_of([point for point, _ in linear], [mask for _, mask in linear])
    _score(linear, products, square, count, tried, families, best)
    return sorted(best.values(), key=lambda c: -c.evidence)


def _excluding(fitted: Fitted, point: Effect, kept: np.ndarray, count: float, families: int) -> Candidate:
    """An effect that leaves rows out earns their square sum and pays a parameter for every number left
    out."""
    rows = fitted.residual * fitted.scale
    out = ~kept & (fitted.weight > 0)
    gain, free = float(np.sum(rows[out] ** 2)), int(out.sum()) * rows.shape[1]
    square = float(fitted.whitened @ fitted.whitened)
    return Candidate(point, gain, free, 1, log_evidence(square, gain, count, free, families))


def _score(linear, products, square, count, tried, families, best) -> None:
    for (point, mask), each in zip(linear, products):
        k, normal, onto = int(mask.sum()), each.normal, each.onto
        plausible, prior, lower, upper = np.array(
            [(p.plausible, p.prior, p.lower, p.upper) for p, keep in zip(point.parameters(), mask) if keep]
        ).reshape(k, 4).T
        usable = (np.diag(normal) > ABSORBED * each.square) & (np.sqrt(each.square) * plausible > INVISIBLE)
        start, price, free = np.array(point.values, float), 0.0, int(usable.sum())
        if np.isfinite(prior).any():
            gain, values, price = regularised_gain(normal, onto, prior)
            free = 0
        else:
            gain, values = _gain(normal, onto, usable)
        if not np.all((lower <= start[mask] + values) & (start[mask] + values <= upper)):
            # the best point inside the bounds: what leaves them is clipped, the gain is taken there
            values = np.clip(start[mask] + values, lower, upper) - start[mask]
            gain = float(2.0 * values @ onto - values @ normal @ values - np.sum((values / prior) ** 2))
            gain = max(gain, 0.0)
        evidence = log_evidence(square, gain, count, free, tried[point.label] * families) - price
        evidence += point.log_odds
        known = best.get(point.label)
        if known is None or evidence > known.evidence:
            start[mask] += values
            best[point.label] = Candidate(point.with_values(start), gain, int(usable.sum()),
                                          tried[point.label], evidence)


def prior_of(effect: Effect) -> np.ndarray:
    """(k,) standard deviations of the priors of the linear parameters, inf = none."""
    return np.array([p.prior for p, keep in zip(effect.parameters(), free_mask(effect)) if keep])


def regularised_gain(normal: np.ndarray, onto: np.ndarray,
                      prior: np.ndarray) -> tuple[float, np.ndarray, float]:
    """Fall of the penalised square sum, coefficients, and half the log determinant that they cost."""
    scale = np.where(np.isfinite(prior), prior, 1e6)
    system = np.eye(len(onto)) + scale[:, None] * normal * scale
    values = scale * np.linalg.solve(system, scale * onto)
    return float(values @ onto), values, 0.5 * float(np.linalg.slogdet(system)[1])


def _gain(normal: np.ndarray, onto: np.ndarray, usable: np.ndarray) -> tuple[float, np.ndarray]:
    """Fall of the square sum and the coefficients, on the usable columns."""
    values = np.zeros(len(onto))
    if not usable.any():
        return 0.0, values
    scale = np.sqrt(np.diag(normal)[usable])
    scaled = normal[np.ix_(usable, usable)] / np.outer(scale, scale)
    values[usable] = lstsq(scaled, onto[usable] / scale, rcond=1e-8)[0] / scale
    return float(values @ onto), values


def same_cause(one: Effect, other: Effect) -> bool:
    """Whether both are one effect of one axis, or one of them has every term of the other."""
    alike = one.name == other.name and one.joint == other.joint
    return alike or one.includes(other) or other.includes(one)


def probability(candidate: Candidate, ranking: list[Candidate]) -> float:
    """Posterior probability among all other causes and 'nothing', equal prior odds each."""
    rivals = [c.evidence for c in ranking if not same_cause(c.effect, candidate.effect)]
    own = max([candidate.evidence] + [c.evidence for c in ranking if same_cause(c.effect, candidate.effect)])
    evidences = np.array([own, 0.0, *rivals])
    weights = np.exp(evidences - evidences.max())
    return float(weights[0] / weights.sum())
