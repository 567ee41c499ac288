"""Something else: whether an unknown function explains what effects explain, and better.

In the linear picture of a fit without one effect, or several, all others in it, the columns C~ of an effect
and of every unknown function (unknown.py) have the priors of vocabulary.py, N(0, s^2 P^2), s by a log-normal
law:

    log p = log prior + log sum_s w_s exp(n/2 log(S / (S - gain_s)) - 1/2 log det(I + s^2 P C~'C~ P))
    share = p_effects / (p_effects + sum of p over the unknown functions),   bagged over pieces (bagging.py)

n: independent numbers, S: square sum of the residual. An effect that imitates the shape of another cause is
beaten by a function that takes it exactly, several effects that imitate it together by one function in the
place of all; one that is far larger than plausible pays for it. The share is that of these alone: other
effects of the library compete in the contest (selection.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import special

from exactarm.diagnose.bagging import bagged, squares_by_piece
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.scan import free_mask, grid, regularised_gain
from exactarm.diagnose.search import log_prior_of_count
from exactarm.diagnose.signal import Structure
from exactarm.diagnose.time_groups import time_groups
from exactarm.diagnose.unknown import AMPLITUDE, Unknown, unknown_functions
from exactarm.diagnose.vocabulary import DESCRIBED, SCALE_WEIGHTS, SCALES, UNKNOWN_MASS, emptied
from exactarm.effects.base import Effect

_HOPELESS = 40.0  # nats behind the likeliest, which no draw of pieces makes up for
_STEP = 10.0**0.5  # between scales beyond the largest of the vocabulary, which no size may lie above


@dataclass(frozen=True)
class Beside:
    """Share (0 to 1) of the effect beside all unknown functions, and the likeliest of these."""

    share: float
    likeliest: Structure


def beside_unknown(problem: Problem, steps: list[tuple[Fitted, Effect]],
                   candidates: Callable[[Fitted], list[Effect]], count: Callable[[Fitted], float]) -> Beside:
    """Effects together, at their values, beside unknown functions of the problem's signals.

    steps: each effect with the fit without it and those after it; candidates: the library beside a fit;
    count: its independent numbers.
    """
    without, pieces = steps[0][0], pieces_of(problem)
    own, squares = 0.0, None
    for before, effect in steps:
        free = free_mask(effect)
        size = np.array([min(p.plausible, p.prior) for p, keep in zip(effect.parameters(), free) if keep])
        columns, value = before.columns(emptied(effect))[:, free], np.abs(np.array(effect.values)[free])
        ways = [_weighed(before, columns, size * quicker, count(before),
                         float(np.max(value / (size * quicker), initial=0.0)))
                for quicker in effect.quickness(before.view)]
        weight = float(special.logsumexp([each for each, _ in ways]) - np.log(len(ways)))
        left = max(ways, key=lambda way: way[0])[1]
        own += weight + _log_prior(effect, candidates(before)) + effect.log_odds
        squares = squares_by_piece(left, before.data_numbers, pieces)
    own += log_prior_of_count(len(steps)) - log_prior_of_count(1)
    found = _unknown_weights(problem, without, count(without), pieces)
    best = max(found, key=lambda one: one[0])[1]
    evidence = np.array([own, *(weight for weight, _, _ in found)])
    near = evidence > evidence.max() - _HOPELESS
    by_piece, kept = zip(squares, *(one[2] for one in found))
    if not near[0]:
        return Beside(float(np.exp(own - special.logsumexp(evidence))), best.structure)
    shares = bagged(evidence[near], np.array(by_piece)[near], np.array(kept)[near], count(without))
    return Beside(float(shares[0]), best.structure)


def pieces_of(problem: Problem) -> np.ndarray:
    """(N,) from 0: pieces of the rows of the search, of one run each."""
    run = problem.record.data.run
    return np.unique(np.stack([run, time_groups(run)]), axis=1, return_inverse=True)[1].ravel()


def _unknown_weights(problem: Problem, without: Fitted, count: float,
                     pieces: np.ndarray) -> list[tuple[float, Unknown, tuple[np.ndarray, float]]]:
    """Log weight of every unknown function, summed over lengths, and the square sums that it leaves; one
    direction at a time, to save memory."""
    signals, directions = problem.signals(without), problem.directions(without)
    device = {along: pattern for along, pattern in directions.items() if along.of_tracker}
    apart = [{name: pattern} for name, pattern in directions.items() if name not in device]
    found, number = [], 0
    for part in (*apart, device):
        axes = {along.axis for along in part}
        asked = {signal: values for signal, values in signals.items()
                 if signal.quantity not in problem.followed_by_effects or signal.axis not in axes}
        for unknown, response, sizes in unknown_functions(asked, part, {}, {}):
            columns, unit = without.whiten(response), problem.unknown_size / AMPLITUDE
            weighed = [_weighed(without, columns, unit * size, count) for size in sizes]
            weights = [weight for weight, _ in weighed]
            left = weighed[int(np.argmax(weights))][1]
            odds = np.log(DESCRIBED) if unknown.described else 0.0
            found.append((float(special.logsumexp(weights) + odds), unknown,
                          squares_by_piece(left, without.data_numbers, pieces)))
            number += len(sizes)
    return [(weight + np.log(UNKNOWN_MASS / number), *rest) for weight, *rest in found]


def _log_prior(effect: Effect, candidates: list[Effect]) -> float:
    """Of the effect at one point of its grid as the next cause."""
    alike = [other for other in candidates if other.name == effect.name]
    points = sum(len(grid(other)) for other in alike if other.joint == effect.joint)
    axes, names = {other.joint for other in alike}, {other.name for other in candidates}
    return float(np.log((1.0 - UNKNOWN_MASS) / (len(names | {effect.name}) * max(len(axes), 1)
                                                * max(points, 1))))


def _weighed(without: Fitted, columns: np.ndarray, size: np.ndarray, count: float,
             largest: float = 0.0) -> tuple[float, np.ndarray]:
    """Log marginal likelihood of columns (R, k) over a model without them, summed over the scales of their
    sizes (k,), and the residual (R,) that the likeliest scale leaves; largest: a size that the scales have to
    reach."""
    absorbed, residual = without.basis.T @ columns, without.free_residual
    normal, onto = columns.T @ columns - absorbed.T @ absorbed, columns.T @ residual
    square, terms, found = float(residual @ residual), [], []
    for scale, log_weight in scales_up_to(largest):
        gain, values, price = regularised_gain(normal, onto, scale * size)
        left = max(square - gain, 1e-12 * square)
        terms.append(log_weight - price + 0.5 * count * np.log(square / left))
        found.append(values)
    values = found[int(np.argmax(terms))]
    return float(special.logsumexp(terms)), residual - columns @ values + without.basis @ (absorbed @ values)


def scales_up_to(largest: float) -> list[tuple[float, float]]:
    """(scale, log weight) of the vocabulary, and further ones of the same log-normal law up to `largest`."""
    found = list(zip(SCALES.tolist(), np.log(SCALE_WEIGHTS).tolist()))
    while found[-1][0] < largest:
        scale = found[-1][0] * _STEP
        law = -0.5 * ((np.log(scale) / np.log(3.0)) ** 2 - (np.log(SCALES[-1]) / np.log(3.0)) ** 2)
        found.append((scale, float(np.log(SCALE_WEIGHTS[-1]) + law)))
    return found
