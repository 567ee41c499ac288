"""Something else: whether an unknown function explains what an effect explains, and better.

In the linear picture of a fit without the effect, all others in it, the columns C~ of the effect and of every
unknown function (unknown.py) have the priors of vocabulary.py, N(0, s^2 P^2), s by a log-normal law:

    log p = log prior + log sum_s w_s exp(n/2 log(S / (S - gain_s)) - 1/2 log det(I + s^2 P C~'C~ P))
    share = p_effect / (p_effect + sum of p over the unknown functions)

n: independent numbers, S: square sum of the residual. An effect that imitates the shape of another cause is
beaten by a function that takes it exactly; one that is far larger than plausible pays for it. The share is
that of the two alone: other effects of the library compete in the contest (selection.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from exactarm.diagnose.problem import Fitted, Problem
from exactarm.diagnose.scan import free_mask, grid, regularised_gain
from exactarm.diagnose.unknown import Unknown, unknown_functions
from exactarm.diagnose.vocabulary import DESCRIBED, SCALE_WEIGHTS, SCALES, UNKNOWN_MASS, emptied
from exactarm.effects.base import Effect

_STEP = 10.0**0.5  # between scales beyond the largest of the vocabulary, which no size may lie above


@dataclass(frozen=True)
class Beside:
    """Share (0 to 1) of the effect beside all unknown functions; title of the likeliest of these."""

    share: float
    title: str


def beside_unknown(problem: Problem, without: Fitted, effect: Effect, candidates: list[Effect],
                   count: float) -> Beside:
    """The effect, at its values, beside unknown functions of the problem's signals. without: the fit without
    it; candidates: the library; count: independent numbers."""
    free = free_mask(effect)
    plausible = [min(p.plausible, p.prior) for p, keep in zip(effect.parameters(), free) if keep]
    size = np.array(plausible)
    largest = float(np.max(np.abs(np.array(effect.values)[free]) / size, initial=0.0))
    own = _log_weight(without, without.columns(emptied(effect))[:, free], size, count, largest)
    own += _log_prior(effect, candidates) + effect.log_odds
    found = _unknown_weights(problem, without, count)
    best = max(found, key=lambda one: one[0])[1]
    total = float(special.logsumexp([weight for weight, _ in found]))
    return Beside(float(special.expit(own - total)), best.title)


def _unknown_weights(problem: Problem, without: Fitted, count: float) -> list[tuple[float, Unknown]]:
    """Log weight of every unknown function, summed over lengths; one direction at a time, to save memory."""
    signals, directions = problem.signals(without), problem.directions(without)
    device = {name: pattern for name, pattern in directions.items() if name.startswith("the device")}
    apart = [{name: pattern} for name, pattern in directions.items() if name not in device]
    found, number = [], 0
    for part in (*apart, device):
        for unknown, response, sizes in unknown_functions(without, signals, part):
            columns = without.whiten(response)
            weights = [_log_weight(without, columns, size, count) for size in sizes]
            odds = np.log(DESCRIBED) if unknown.described else 0.0
            found.append((float(special.logsumexp(weights) + odds), unknown))
            number += len(sizes)
    return [(weight + np.log(UNKNOWN_MASS / number), unknown) for weight, unknown in found]


def _log_prior(effect: Effect, candidates: list[Effect]) -> float:
    """Of the effect at one point of its grid as the next cause."""
    alike = [other for other in candidates if other.name == effect.name]
    points = sum(len(grid(other)) for other in alike if other.joint == effect.joint)
    axes, names = {other.joint for other in alike}, {other.name for other in candidates}
    return float(np.log((1.0 - UNKNOWN_MASS) / (len(names | {effect.name}) * max(len(axes), 1)
                                                * max(points, 1))))


def _log_weight(without: Fitted, columns: np.ndarray, size: np.ndarray, count: float,
                largest: float = 0.0) -> float:
    """Log marginal likelihood of columns (R, k) over a model without them, summed over the scales of their
    sizes (k,); largest: a size that the scales have to reach."""
    absorbed, residual = without.basis.T @ columns, without.free_residual
    normal, onto = columns.T @ columns - absorbed.T @ absorbed, columns.T @ residual
    square, terms = float(residual @ residual), []
    for scale, log_weight in scales_up_to(largest):
        gain, _, price = regularised_gain(normal, onto, scale * size)
        left = max(square - gain, 1e-12 * square)
        terms.append(log_weight - price + 0.5 * count * np.log(square / left))
    return float(special.logsumexp(terms))


def scales_up_to(largest: float) -> list[tuple[float, float]]:
    """(scale, log weight) of the vocabulary, and further ones of the same log-normal law up to `largest`."""
    found = list(zip(SCALES.tolist(), np.log(SCALE_WEIGHTS).tolist()))
    while found[-1][0] < largest:
        scale = found[-1][0] * _STEP
        law = -0.5 * ((np.log(scale) / np.log(3.0)) ** 2 - (np.log(SCALES[-1]) / np.log(3.0)) ** 2)
        found.append((scale, float(np.log(SCALE_WEIGHTS[-1]) + law)))
    return found
