"""Which axes something else turns, and what it follows: where a draft is to begin.

Poses: unknown functions (unknown.py) are searched once more beside the final model, with the noise that they
leave. Runs: each function alone beside the final model, its noise as the fit knows it,

    p(axis) = sum over functions that turn the axis of w / (1 + sum over all of w),
    w = prior x marginal likelihood over the model without it        (something_else.py)
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy import special

from exactarm.diagnose.cross_validation import CrossValidation, folds_of
from exactarm.diagnose.decisions import DRAFTS, LEAST_EVIDENCE, LEAST_NATS, NAMED_AT
from exactarm.diagnose.evidence import Members, Picture
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.joint_fit import count_of
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.search import log_prior_of_count, search
from exactarm.diagnose.search_round import alike, basis_of
from exactarm.diagnose.signal import Signal, Structure
from exactarm.diagnose.something_else import Weighed, columns_of_unknown, weigh_unknown
from exactarm.diagnose.vocabulary import vocabulary_of
from exactarm.diagnose.worth import takes_enough
from exactarm.noise.estimate import estimate_noise
from exactarm.noise.model import NoiseModel

_MOST_FUNCTIONS = 2 * DRAFTS  # searched for at once
_NOISE_PASSES = 2


@dataclass(frozen=True)
class KnownNoise:
    """What a fit knows of the noise of its rows, in the terms of evidence.py; numbers: independent ones."""

    fitted: Fitted
    numbers: float
    held_share = 1.0

    def whiten(self, values: np.ndarray) -> np.ndarray:
        return self.fitted.standard(values)


@dataclass(frozen=True)
class UnknownAxes:
    """likely: axis -> probability that something else turns it, and the signals that it may follow, the
    likeliest first; noise: of the rows beside it, in the terms of evidence.py; others: axis, or None of a
    device, and what probably moves it, in words; something: probability that one of them acts, of runs where
    each is weighed alone; faint: none of them takes as much away as an effect must."""

    noise: NoiseModel | KnownNoise
    likely: dict[int, tuple[float, list[Signal]]]
    others: tuple[tuple[int | None, Structure], ...] = ()
    something: float = 0.0
    faint: bool = False


def unknown_axes(problem: Problem, fitted: Fitted) -> UnknownAxes:
    """Beside the model of a fit."""
    if problem.by_posterior:
        return _at_rest(problem, fitted)
    count = count_of(problem, fitted)
    return _in_time(fitted, count, _weighed(problem, fitted, count))


def supported_axes(problem: Problem, fitted: Fitted) -> UnknownAxes:
    """Of a series, beside the model of a fit to which nothing else objects: the likeliest functions count
    only where cross-validation supports one of them, as it has to support effects. Evidence trusts its
    noise: of noise with a memory, or of torques in twelve steps, functions had 0.99."""
    count = count_of(problem, fitted)
    parted = CrossValidation.of(fitted, folds_of(problem.groups(), problem.seed))
    found = sorted(_weighed(problem, fitted, count), key=lambda one: -one.weight)
    while found and found[0].weight > -LEAST_NATS:
        columns = columns_of_unknown(problem, fitted, found[0].unknown, count)
        takes = partial(takes_enough, problem, fitted, *columns, parted)
        if takes(problem.least_doubt):
            return replace(_in_time(fitted, count, found), faint=not takes(problem.least_share))
        del found[0]
    return _in_time(fitted, count, found)


def _weighed(problem: Problem, fitted: Fitted, count: float) -> list[Weighed]:
    return weigh_unknown(problem, fitted, count, problem.pieces(), lambda signal, along: True)


def _in_time(fitted: Fitted, count: float, found: list[Weighed]) -> UnknownAxes:
    noise = KnownNoise(fitted, count + fitted.spent)
    first = log_prior_of_count(1) - log_prior_of_count(0)
    total = np.logaddexp(0.0, special.logsumexp([one.weight for one in found]) + first) if found else 0.0
    by_direction = defaultdict(list)
    for one in sorted(found, key=lambda one: -one.weight):
        # when something happened in one run says nothing of another one
        if not any(signal.of_time for signal in one.unknown.signals):
            by_direction[one.unknown.direction].append(one)
    likely, others, something = {}, [], 0.0
    for direction, ours in by_direction.items():
        probability = float(np.exp(special.logsumexp([one.weight for one in ours]) + first - total))
        something += probability
        near = (one.unknown.signals for one in ours if one.weight >= ours[0].weight - LEAST_EVIDENCE)
        if direction.axis is not None:
            likely[direction.axis] = probability, list(dict.fromkeys(s for signals in near for s in signals))
        if probability >= NAMED_AT:
            others.append((direction.axis, ours[0].unknown.structure))
    return UnknownAxes(noise, likely, tuple(others), min(something, 1.0))


def _at_rest(problem: Problem, fitted: Fitted) -> UnknownAxes:
    visits, lost, rounding = problem.groups(), fitted.spent, problem.rounding()
    declared = basis_of(fitted.jacobian)
    vocabulary = vocabulary_of(fitted, [], problem.unknown_functions(fitted))
    noise = estimate_noise(fitted.residual, lost, visits, rounding=rounding, declared=declared)
    if not vocabulary.blocks:
        return UnknownAxes(noise, {}, something=0.0)
    for _ in range(_NOISE_PASSES):
        picture = Picture.of(vocabulary, fitted.residual, fitted.jacobian, noise, fitted.prior)
        certain, posterior = search(picture, _MOST_FUNCTIONS)
        beside = posterior.members[posterior.best]
        members = Members(certain.blocks + beside.blocks, certain.scales + beside.scales)
        before, noise = noise, estimate_noise(fitted.residual - picture.response(members), lost, visits,
                                               rounding=rounding, declared=declared)
        if alike(before, noise):
            break
    signals, by_label = defaultdict(list), {}
    for block in vocabulary.blocks:
        if block.unknown.direction.turns:
            by_label[block.label] = block.unknown.direction.axis
    for index in members.blocks:
        block = vocabulary.blocks[index]
        if block.label in by_label:
            signals[by_label[block.label]] += [
                s for s in block.unknown.signals if s not in signals[by_label[block.label]]]
    something = 1.0 if certain.blocks else posterior.probability(bool)
    sure = {by_label.get(vocabulary.blocks[i].label) for i in certain.blocks}
    found = {}
    for axis, names in signals.items():
        mine = {label for label, turned in by_label.items() if turned == axis}
        probability = 1.0 if axis in sure else posterior.probability(partial(_any_of, mine))
        found[axis] = (probability, names)
    return UnknownAxes(noise, found, something=something)


def _any_of(mine: set[str], labels: tuple[str, ...]) -> bool:
    return not mine.isdisjoint(labels)
