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

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy import special

from exactarm import _core
from exactarm.diagnose.bagging import HOPELESS, bagged, squares_by_piece
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.scan import grid, regularised_gain
from exactarm.diagnose.search import log_prior_of_count
from exactarm.diagnose.signal import TRACKER, Direction, Quantity, Signal, Structure
from exactarm.diagnose.unknown import AMPLITUDE, Unknown, Wave, functions_of_waves, unknown_functions
from exactarm.diagnose.vocabulary import DESCRIBED, SCALE_WEIGHTS, SCALES, UNKNOWN_MASS
from exactarm.effects.base import Effect

_STEP = 10.0**0.5  # between scales beyond the largest of the vocabulary, which no size may lie above


@dataclass(frozen=True)
class Beside:
    """Share (0 to 1) of the effect beside all unknown functions, and the likeliest of these."""

    share: float
    likeliest: Structure | None


def beside_unknown(problem: Problem, steps: list[tuple[Fitted, Effect]],
                   candidates: Callable[[Fitted], list[Effect]], count: Callable[[Fitted], float]) -> Beside:
    """Effects together, at their values, beside unknown functions of the problem's signals.

    steps: each effect with the fit without it and those after it (`Fitted.without`: a large one leaves what
    its own fit leaves, not what a picture from zero would); candidates: the library beside a fit;
    count: its independent numbers.
    """
    without, pieces = steps[0][0], problem.pieces()
    own, squares = 0.0, None
    for before, effect in steps:
        taken, value, columns = before.taken
        size = np.array([min(p.plausible, p.prior) for p in taken])
        added = _Added.to(before, columns)
        ways = [added.weighed(size * quicker, count(before),
                              float(np.max(np.abs(value) / (size * quicker), initial=0.0)))
                for quicker in effect.quickness(before.view)]
        weight = float(np.logaddexp.reduce([each for each, *_ in ways]) - np.log(len(ways)))
        left = added.left(max(ways, key=lambda way: way[0])[1])
        own += weight + _log_prior(effect, candidates(before)) + effect.log_odds
        squares = squares_by_piece(left, before.data_numbers, pieces)
    own += log_prior_of_count(len(steps)) - log_prior_of_count(1)
    found = weigh_unknown(problem, without, count(without), pieces, rivals_of_effects(problem),
                          [effect for _, effect in steps])
    if not found:
        return Beside(1.0, None)
    best = max(found, key=lambda one: one.weight).unknown
    evidence = np.array([own, *(one.weight for one in found)])
    near = evidence > evidence.max() - HOPELESS
    by_piece, kept = zip(squares, *(one.squares for one in found))
    if not near[0]:
        return Beside(float(np.exp(own - special.logsumexp(evidence))), best.structure)
    shares = bagged(evidence[near], np.array(by_piece)[near], np.array(kept)[near], count(without))
    return Beside(float(shares[0]), best.structure)


@dataclass(frozen=True)
class Weighed:
    """An unknown function with its log weight over a fit without it, summed over lengths and scales, and the
    square sums that it leaves, by piece and beside the pieces."""

    weight: float
    unknown: Unknown
    squares: tuple[np.ndarray, float]


def weigh_unknown(problem: Problem, without: Fitted, count: float, pieces: np.ndarray,
                  asked: Callable[[Signal, Direction], bool],
                  instead: Iterable[Effect] = ()) -> list[Weighed]:
    """Every unknown function of the signals that are asked for along a direction; one direction at a time,
    to save memory."""
    signals, directions = problem.signals(without), problem.movements(without)
    waves = problem.unknown_waves(without, instead)
    device = {along: pattern for along, pattern in directions.items() if along.of_tracker}
    apart = [{name: pattern} for name, pattern in directions.items() if name not in device]
    found, number = [], 0
    for part in (*apart, device):
        for unknown, response, sizes in _functions(problem, signals, part, waves, asked):
            added = _Added.to(without, without.whiten(response))
            weighed = [added.weighed(size, count) for size in sizes]
            left = added.left(max(weighed, key=lambda each: each[0])[1])
            odds = (np.log(DESCRIBED) if unknown.described else 0.0) - np.log(unknown.among)
            found.append((float(np.logaddexp.reduce([weight for weight, *_ in weighed]) + odds), unknown,
                          squares_by_piece(left, without.data_numbers, pieces)))
            number += len(sizes)
    return [Weighed(weight + np.log(UNKNOWN_MASS / number), *rest) for weight, *rest in found]


def columns_of_unknown(problem: Problem, without: Fitted, unknown: Unknown,
                       count: float) -> tuple[np.ndarray, np.ndarray]:
    """Whitened columns (R, k) of an unknown function, and the sizes (k,) of their coefficients that are
    likeliest."""
    along, place = unknown.direction, Signal(Quantity.PLACE) in unknown.signals
    part = {name: pattern for name, pattern in problem.movements(without).items()
            if name == along or along == TRACKER and name.of_tracker}
    asked = lambda signal, _: signal in unknown.signals or place and signal.quantity == Quantity.POSITION
    made = _functions(problem, problem.signals(without), part, [unknown.wave] if unknown.wave else [], asked)
    response, sizes = next(each for own, *each in made if own == unknown)
    added = _Added.to(without, without.whiten(response))
    weighed = [(*added.weighed(size, count), size) for size in sizes]
    _, _, scale, size = max(weighed, key=lambda each: each[0])
    return added.columns, scale * size


def _functions(problem: Problem, signals: dict, part: dict, waves: Iterable[Wave],
               asked: Callable[[Signal, Direction], bool]) -> Iterator[tuple]:
    """(unknown, response (N, m, k), sizes (k,) for each length) along some directions."""
    unit = problem.unknown_size / AMPLITUDE
    wanted = {signal: values for signal, values in signals.items()
              if all(asked(signal, along) for along in part)}
    free = [wave for wave in waves
            if all(wave.by is None or asked(wave.by, along) for along in part if along.axis == wave.axis)]
    made = chain(unknown_functions(wanted, part, {}, ()), functions_of_waves(signals, part, free))
    for unknown, response, sizes in made:
        yield unknown, response, [unit * size for size in sizes]


def rivals_of_effects(problem: Problem) -> Callable[[Signal, Direction], bool]:
    """Whether effects have an unknown function of a signal along a direction for a rival."""
    return lambda signal, along: (signal.quantity not in problem.followed_by_effects
                                  or signal.axis != along.axis)


def _log_prior(effect: Effect, candidates: list[Effect]) -> float:
    """Of the effect at one point of its grid as the next cause."""
    alike = [other for other in candidates if other.name == effect.name]
    points = sum(len(grid(other)) for other in alike if other.joint == effect.joint)
    axes, names = {other.joint for other in alike}, {other.name for other in candidates}
    return float(np.log((1.0 - UNKNOWN_MASS) / (len(names | {effect.name}) * max(len(axes), 1)
                                                * max(points, 1))))


@dataclass(frozen=True)
class _Added:
    """Whitened columns (R, k) that are to be added to a fit, and their products with it."""

    without: Fitted
    columns: np.ndarray
    absorbed: np.ndarray
    normal: np.ndarray
    onto: np.ndarray

    @staticmethod
    def to(without: Fitted, columns: np.ndarray) -> _Added:
        absorbed = without.basis.T @ columns
        return _Added(without, columns, absorbed, columns.T @ columns - absorbed.T @ absorbed,
                      columns.T @ without.free_residual)

    def weighed(self, size: np.ndarray, count: float,
                largest: float = 0.0) -> tuple[float, np.ndarray, float]:
        """Log marginal likelihood over the fit without them, summed over the scales of their sizes (k,), the
        likeliest values (k,), and their scale; largest: a size that the scales have to reach."""
        square = float(self.without.free_residual @ self.without.free_residual)
        scales, log_weights = np.array(scales_up_to(largest)).T
        gains, prices = _core.gains_by_scale((size[:, None] * self.normal * size)[None],
                                             (size * self.onto)[None], scales**2)
        left = np.maximum(square - gains[:, 0], 1e-12 * square)
        terms = log_weights - prices[:, 0] + 0.5 * count * np.log(square / left)
        best = int(np.argmax(terms))
        values = regularised_gain(self.normal, self.onto, scales[best] * size)[1]
        return float(np.logaddexp.reduce(terms)), values, float(scales[best])

    def left(self, values: np.ndarray) -> np.ndarray:
        """(R,) residual with them at these values."""
        return (self.without.free_residual - self.columns @ values
                + self.without.basis @ (self.absorbed @ values))


def scales_up_to(largest: float) -> list[tuple[float, float]]:
    """(scale, log weight) of the vocabulary, and further ones of the same log-normal law up to `largest`."""
    found = list(zip(SCALES.tolist(), np.log(SCALE_WEIGHTS).tolist()))
    while found[-1][0] < largest:
        scale = found[-1][0] * _STEP
        law = -0.5 * ((np.log(scale) / np.log(3.0)) ** 2 - (np.log(SCALES[-1]) / np.log(3.0)) ** 2)
        found.append((scale, float(np.log(SCALE_WEIGHTS[-1]) + law)))
    return found
