"""Rivals of what was found: each fitted in the place of the effect that won it on the fitted rows.

Rows that were not fitted may object: were the chosen model right, the density with any of K rivals would
reach 20 K times its own on them with a probability of at most 1 / 20 (Markov's inequality, as in
held_out_evidence.py). From there on these rows speak for the rival; they choose nothing, so it does not take
the place, and nothing is explained. But the odds of the effect found against that rival fall by as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from exactarm.chain import Layout
from exactarm.diagnose.decisions import DOUBT, MANY_PARAMETERS, REMOTE
from exactarm.diagnose.held_out_evidence import AGAINST, MOST_NATS, held_out_gains
from exactarm.diagnose.joint_fit import refit
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.selected import Selection
from exactarm.diagnose.standing import errors_of
from exactarm.diagnose.verdict import judged_of, rms_of
from exactarm.effects.base import Effect

# the strongest is fitted, however improbable; of many parameters, it alone
_RIVALS_EACH, _RIVALS = 2, 5


@dataclass(frozen=True)
class Alternative:
    """A rival of a finding: what it would leave on the validation rows, whether this data can tell them
    apart, and by how many nats the validation rows are likelier with it."""

    effect: Effect
    instead_of: str
    rms_after: float
    probability: float
    collides: bool
    gain: float = 0.0


def alternatives_of(problem: Problem, declared: Layout, selection: Selection,
                    errors: dict[str, np.ndarray]) -> tuple[Alternative, ...]:
    """The strongest rivals of the findings; errors: of the last fit, by set."""
    chosen = [a.effect for a in selection.accepted]
    last = selection.fits[-1]
    rivals = [(rival.evidence - a.evidence, a.probability, place, rival.effect)
              for place, a in enumerate(selection.accepted) for rival in a.rivals[:_RIVALS_EACH]
              if rival.evidence > 0.0]
    found = []
    for nats, sure, place, effect in sorted(rivals, key=lambda rival: -rival[0])[:_RIVALS]:
        probability = float(np.exp(min(nats, 0.0)) * sure)
        if found and (probability < REMOTE or last.layout.size > MANY_PARAMETERS):
            continue
        effects = chosen[:place] + [effect] + chosen[place + 1 :]
        fitted = problem.settled(refit(problem.rough, declared, effects, last))
        mine = errors_of(problem, fitted)
        gain, = held_out_gains([errors, mine], problem.numbers_of_error, problem.correlation_factor(fitted))
        found.append(Alternative(fitted.layout.effects[len(declared.effects) + place], chosen[place].label,
                                 rms_of(judged_of(mine)), probability, probability > DOUBT, gain))
    return tuple(sorted(found, key=lambda a: -a.probability))


def preferred_elsewhere(alternatives: Sequence[Alternative]) -> Alternative | None:
    """The rival for which rows that were not fitted speak most, if they speak for one. Another form of the
    same cause is none."""
    enough = np.log(max(len(alternatives), 1)) - AGAINST
    others = [a for a in alternatives if a.gain > enough and a.effect.label != a.instead_of]
    return max(others, key=lambda a: a.gain, default=None)


def in_words(preferred: Alternative | None, found: Sequence[Effect]) -> str:
    """A sentence on it; empty where there is none."""
    if preferred is None:
        return ""
    place = next(effect.title for effect in found if effect.label == preferred.instead_of)
    return (f" Rows that were not fitted speak for {preferred.effect.title} in the place of {place}: "
            "other data have to say which of them acts.")


def left_by(preferred: Alternative | None, label: str, probability: float) -> float:
    """What the rival leaves of the probability of a finding, by all rows."""
    if preferred is None or preferred.instead_of != label:
        return probability
    return float(probability / (1.0 + preferred.probability * np.expm1(min(preferred.gain, MOST_NATS))))
