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

from collections import Counter, defaultdict
from dataclasses import dataclass
from itertools import product

import numpy as np

from exactarm.diagnose.decisions import ABSORBED, INVISIBLE
from exactarm.diagnose.fitted import Fitted
from exactarm.effects.base import Effect

_LEAST_TOLD = 1e-8


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
    left = np.maximum(square - gain, 1e-12 * square)
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
    """The best point of every label into `best`; points of as many parameters at once."""
    alike = defaultdict(list)
    for place, (_, mask) in enumerate(linear):
        alike[int(mask.sum())].append(place)
    for k, places in alike.items():
        points = [linear[place][0] for place in places]
        declared = [(p.plausible, p.prior, p.lower, p.upper) for place in places
                    for p, keep in zip(linear[place][0].parameters(), linear[place][1]) if keep]
        declared = np.array(declared, float).reshape(len(places), k, 4)
        plausible, prior, lower, upper = declared.transpose(2, 0, 1)
        start = np.array([np.array(point.values)[linear[place][1]] for point, place in zip(points, places)])
        normal, onto = (np.stack([getattr(products[place], name) for place in places])
                        for name in ("normal", "onto"))
        length = np.stack([products[place].square for place in places])
        left = np.diagonal(normal, axis1=1, axis2=2) > ABSORBED * length
        usable = left & (np.sqrt(length) * plausible > INVISIBLE)
        gain, values, price, free = *_gains(normal, onto, usable), np.zeros(len(places)), usable.sum(axis=1)
        for i in np.flatnonzero(np.isfinite(prior).any(axis=1)):
            gain[i], values[i], price[i] = regularised_gain(normal[i], onto[i], prior[i])
            free[i] = 0
        for i in np.flatnonzero(~np.all((lower <= start + values) & (start + values <= upper), axis=1)):
            # the best point inside the bounds: what leaves them is clipped, the gain is taken there
            values[i] = v = np.clip(start[i] + values[i], lower[i], upper[i]) - start[i]
            gain[i] = max(float(2.0 * v @ onto[i] - v @ normal[i] @ v - np.sum((v / prior[i]) ** 2)), 0.0)
        points_tried = np.array([tried[point.label] for point in points])
        evidence = log_evidence(square, gain, count, free, points_tried * families) - price
        for i, (point, place) in enumerate(zip(points, places)):
            each, known = evidence[i] + point.log_odds, best.get(point.label)
            if known is None or each > known.evidence:
                found = np.array(point.values, float)
                found[linear[place][1]] += values[i]
                best[point.label] = Candidate(point.with_values(found), float(gain[i]), int(usable[i].sum()),
                                              tried[point.label], float(each))


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


def _gains(normal: np.ndarray, onto: np.ndarray, usable: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fall of the square sum (g,) and coefficients (g, k), on the usable columns (g, k), of normal (g, k, k)
    and onto (g, k); what tells less than 1e-8 of the most is held at zero."""
    scale = np.where(usable, np.sqrt(np.where(usable, np.diagonal(normal, axis1=1, axis2=2), 1.0)), np.inf)
    scaled = normal / scale[:, :, None] / scale[:, None, :]
    values, vectors = np.linalg.eigh(scaled)
    told = values > _LEAST_TOLD * values.max(axis=1, initial=0.0, keepdims=True)
    turned = np.einsum("gij,gi->gj", vectors, onto / scale) * told / np.where(told, values, 1.0)
    found = np.einsum("gij,gj->gi", vectors, turned) / scale
    return np.einsum("gi,gi->g", found, onto), found


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
