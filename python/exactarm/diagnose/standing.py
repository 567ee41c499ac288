"""Which of the effects found stay once unknown functions and held-out rows have spoken.

An effect that is then less likely than not, and against which held-out rows speak, leaves the model:
something else looked like it, and a program corrected by it would go wrong elsewhere. So does one that an
unknown function outdoes, where no other effect stands. Beside one that does it stays, as what comes nearest
in the library, with its probability: what it takes away, the others would be judged by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout
from exactarm.diagnose.decisions import NAMED_AT
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.held_out_evidence import allowed, carried_over, held_out_gains, with_held_out
from exactarm.diagnose.joint_fit import known_beside, refit
from exactarm.diagnose.own_share import Own, own_shares
from exactarm.diagnose.posterior import Causes
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.selected import Accepted, Selection
from exactarm.diagnose.selection import with_shares
from exactarm.diagnose.signal import Structure
from exactarm.effects.base import Effect


@dataclass(frozen=True)
class Dropped:
    """An effect that the fitted rows ask for and that is not in the model; likelier: the unknown function
    that explains better what it explains, None: there is none; contradicted: by held-out rows, not by that
    function alone."""

    effect: Effect
    probability: float
    likelier: Structure | None
    contradicted: bool = True

    def to_json(self) -> dict[str, object]:
        reasons = ["held-out rows contradict it"] if self.contradicted else []
        reason = "; ".join([*reasons, *([f"likelier: {self.likelier}"] if self.likelier else [])])
        return {"effect": self.effect.name, "joint": self.effect.joint, "probability": self.probability,
                "reason": reason}


@dataclass(frozen=True)
class Judged:
    """A selection by all rows: errors of every fit by set of rows, own shares, gains of the rounds in nats,
    and of every effect its gain, as far as its round or the last model tells it, and its probability."""

    selection: Selection
    errors: list[dict[str, np.ndarray]]
    own: list[Own]
    gains: list[float]
    of_each: list[float]
    sure: list[float]

    @staticmethod
    def of(problem: Problem, declared: Layout, selection: Selection, causes: Causes | None) -> Judged:
        last, errors = selection.fits[-1], [errors_of(problem, fitted) for fitted in selection.fits]
        own = own_shares(problem, last, len(declared.effects))
        gains = held_out_gains(errors, problem.numbers_of_error, problem.correlation_factor(last))
        each = [own[k].gain if own else _gain_of(problem, declared, selection, errors[-1], k, gains)
                for k in range(len(selection.accepted))]
        sure = [with_held_out(accepted.probability, causes.places[k].nothing, each[k]) if causes
                else _by_held_out(accepted, gains[accepted.round], own[k]) if own
                else _by_held_out(accepted, each[k], None)
                for k, accepted in enumerate(selection.accepted)]
        return Judged(selection, errors, own, gains, each, sure)

    def _contradicted(self, place: int) -> bool:
        """Whether held-out rows have left an effect less likely than not, or speak against it: alone, or
        against all together."""
        accepted = self.selection.accepted[place]
        by_fitted = accepted.probability * accepted.share
        return by_fitted >= NAMED_AT or self.of_each[place] < 0.0 or sum(self.gains) < 0.0

    def _unlikely(self) -> list[int]:
        """Places of effects that may not stay."""
        alone = not any(sure >= NAMED_AT for sure in self.sure)
        return [k for k, accepted in enumerate(self.selection.accepted) if self.sure[k] < NAMED_AT
                and (self._contradicted(k) or alone and accepted.share < NAMED_AT)]

    def standing(self, problem: Problem, declared: Layout, causes: Causes | None = None
                 ) -> tuple[Judged, Causes | None, tuple[Dropped, ...]]:
        """Without the effects that may not stay, the least likely first, the others fitted and judged anew
        until all do; the causes that are left; and the effects that are not."""
        at, dropped = self, ()
        rows = problem.search_rows() if causes else None
        noise = causes.noise if causes and rows is None else None
        while unlikely := at._unlikely():
            out = min(unlikely, key=lambda k: at.sure[k])
            gone, fits = at.selection.accepted[out], at.selection.fits
            dropped += (Dropped(gone.effect, at.sure[out], gone.likelier, at._contradicted(out)),)
            kept, found = [replace(a, round=0) for a in _without(at.selection.accepted, out)], fits[:1]
            causes = causes and replace(causes, places=_without(causes.places, out))
            if kept:
                last = refit(problem, declared, [a.effect for a in kept], fits[-1], noise)
                last = problem.settled(known_beside(problem, last, causes.noise, rows) if causes else last)
                effects = last.layout.effects[len(declared.effects):]
                kept = [replace(a, effect=effect) for a, effect in zip(kept, effects)]
                if problem.unknown_rivals and not causes:
                    kept = with_shares(problem.knowing(last), declared, kept, last)
                found += (last,)
            selection = replace(at.selection, fits=found, accepted=tuple(kept))
            at = Judged.of(problem, declared, selection, causes)
        return at, causes, dropped


def _without(each: tuple, out: int) -> tuple:
    return each[:out] + each[out + 1 :]


def _gain_of(problem: Problem, declared: Layout, selection: Selection, errors: dict[str, np.ndarray],
             place: int, gains: Sequence[float]) -> float:
    """Of one effect with the held-out rows: its round's, unless that is a loss and others came later, which
    may have hidden behind what it mended; then that of the last model beside one without it."""
    own, last = gains[selection.accepted[place].round], selection.fits[-1]
    if own >= 0.0 or selection.accepted[place].round == len(gains) - 1:
        return own
    others = [a.effect for a in _without(selection.accepted, place)]
    without = errors_of(problem, problem.settled(refit(problem, declared, others, last)))
    factor = problem.correlation_factor(last)
    return max(own, *held_out_gains((without, errors), problem.numbers_of_error, factor))


def errors_of(problem: Problem, fitted: Fitted) -> dict[str, np.ndarray]:
    """Errors of both sets; NaN where an effect of the record leaves a row out."""
    held = problem.held_out
    return {"identification": problem.errors(fitted, problem.data),
            "validation": problem.errors(fitted, held) if len(held) else np.zeros(0)}


def _by_held_out(accepted: Accepted, gain: float, own: Own | None) -> float:
    """Probability of an effect found step by step; gain: of its round, own: of itself where that is known."""
    probability = allowed(accepted.probability * accepted.share, gain)
    if own is None:
        return probability
    return carried_over(allowed(probability, own.gain), own.shown, own.variance)
