"""Selection: which effects the data asks for, forward with replacement and backward removal.

Every round scans the whole library against the residual of the current joint fit, takes the candidate with the
most evidence, checks it by cross-validation over whole poses or runs, and fits everything anew through the
chain. Afterwards each accepted effect is taken out again and has to win its place against the whole library;
the evidences of that contest give its probability and its rivals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable

import numpy as np

from exactarm.chain import Layout
from exactarm.diagnose.cross_validation import folds_of, held_out_squares
from exactarm.diagnose.problem import Fitted, Problem
from exactarm.diagnose.scan import Candidate, free_mask, log_evidence, prior_of, scan
from exactarm.effects import library
from exactarm.effects.base import Effect

LEAST_EVIDENCE = 5.0  # log Bayes factor; all candidates tried are already paid for
LEAST_SHARE = 0.01  # an effect must take this share of the cross-validated square sum away
MOST_EFFECTS = 16
_SHORTLIST = 12
_KEPT_GAIN = 0.5  # share of the predicted gain that the joint fit must confirm

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Accepted:
    """An effect in the model: its candidate when it won, probability among all rivals, and the rivals by evidence."""

    effect: Effect
    evidence: float
    probability: float
    rivals: tuple[Candidate, ...]


@dataclass(frozen=True)
class Selection:
    """fits[0] is the declared model, fits[i] the one with the first i effects; ranking: last scan of what is left."""

    fits: tuple[Fitted, ...]
    accepted: tuple[Accepted, ...]
    ranking: tuple[Candidate, ...]
    first_ranking: tuple[Candidate, ...]


def candidates_for(problem: Problem, fitted: Fitted) -> list[Effect]:
    """Every effect of the library that this kind of data can show and that is not in the layout already."""
    taken = {effect.label for effect in fitted.layout.effects}
    found: list[Effect] = []
    for cls in library().values():
        if problem.kind in cls.kinds and not cls.declared:
            found += [e for e in cls.candidates(problem.robot, fitted.view) if e.repeatable or e.label not in taken]
    return found


def select(problem: Problem, declared: Layout, progress: Progress = lambda text: None) -> Selection:
    """Forward selection from the declared model, then the contest for every place."""
    base = problem.fit(declared)
    chosen: list[Effect] = []
    fitted, first_ranking, ranking = base, (), ()
    while len(chosen) < MOST_EFFECTS:
        progress(f"searching with {len(chosen)} effects in the model")
        ranking = tuple(scan(fitted, candidates_for(problem, fitted), _count(problem, fitted)))
        first_ranking = first_ranking or ranking
        step = _best_addition(problem, declared, chosen, fitted, ranking)
        if step is None:
            break
        chosen, fitted = step
    chosen, fitted = _prune(problem, declared, chosen, fitted)
    chosen, accepted = _contest(problem, declared, chosen, fitted, progress)
    fits = [base]
    for count in range(1, len(chosen) + 1):
        fits.append(_fit(problem, declared, chosen[:count]))
    return Selection(tuple(fits), tuple(accepted), ranking, first_ranking)


def _count(problem: Problem, fitted: Fitted) -> float:
    return problem.correlation_factor(fitted) * float(np.count_nonzero(fitted.whitened)) or 1.0


def _fit(problem: Problem, declared: Layout, effects: list[Effect]) -> Fitted:
    weight = np.ones(len(problem.data))
    for effect in effects:
        keep = effect.keep(problem.data)
        if keep is not None:
            weight = weight * keep
    return problem.fit(declared.joined(Layout.of(tuple(effects))), weight)


def _best_addition(problem, declared, chosen, fitted, ranking):
    """The first of the shortlist that cross-validation and the joint fit confirm; None when none does."""
    folds = folds_of(problem.groups(), problem.seed)
    without = held_out_squares(fitted, np.zeros((fitted.whitened.size, 0)), folds)
    for candidate in ranking[:_SHORTLIST]:
        if candidate.evidence < LEAST_EVIDENCE:
            return None
        if not _worth(fitted, candidate.effect, folds, without):
            continue
        trial = _fit(problem, declared, chosen + [candidate.effect])
        fall = fitted.square(fitted.sigma) - trial.square(fitted.sigma)
        if fall >= _KEPT_GAIN * candidate.gain or _excludes(candidate.effect):
            return [*trial.layout.effects[len(declared.effects):]], trial
    return None


def _excludes(effect: Effect) -> bool:
    return type(effect).keep is not Effect.keep


def _worth(fitted: Fitted, effect: Effect, folds: np.ndarray, without: np.ndarray) -> bool:
    """Cross-validated: does the effect take enough of the square sum away, in most of the folds?"""
    if _excludes(effect):
        return True
    columns = fitted.columns(effect)[:, free_mask(effect)]
    fall = without - held_out_squares(fitted, columns, folds, prior_of(effect))
    return fall.sum() > LEAST_SHARE * without.sum() and np.mean(fall > 0) >= 0.7


def _prune(problem, declared, chosen, fitted):
    """Backward: takes out every effect whose evidence, with all others in, has gone."""
    removed = True
    while removed and len(chosen) > 1:
        removed = False
        for effect in list(chosen):
            if _excludes(effect):
                continue
            rest = [e for e in chosen if e is not effect]
            trial = _fit(problem, declared, rest)
            square = trial.square(trial.sigma)
            gain = square - fitted.square(trial.sigma)
            evidence = log_evidence(square, gain, _count(problem, trial), int(free_mask(effect).sum()), 1.0)
            if evidence < LEAST_EVIDENCE or gain < LEAST_SHARE * square:
                chosen = [*trial.layout.effects[len(declared.effects):]]
                fitted, removed = trial, True
                break
    return chosen, fitted


def _contest(problem, declared, chosen, fitted, progress):
    """Every effect against the whole library, with the others in place; a stronger rival takes the place."""
    accepted: list[Accepted] = []
    for place in range(len(chosen)):
        progress(f"contest for {chosen[place].label}")
        rest = chosen[:place] + chosen[place + 1 :]
        without = _fit(problem, declared, rest)
        rest = [*without.layout.effects[len(declared.effects):]]
        ranking = scan(without, candidates_for(problem, without), _count(problem, without))
        winner = ranking[0]
        own = next((c for c in ranking if c.label == chosen[place].label), winner)
        effect = chosen[place]
        if winner.label != effect.label and winner.evidence > own.evidence + 1.0:
            trial = _fit(problem, declared, rest[:place] + [winner.effect] + rest[place:])
            if trial.square(fitted.sigma) < fitted.square(fitted.sigma):
                fitted, own = trial, winner
                chosen = [*trial.layout.effects[len(declared.effects):]]
                effect = chosen[place]
        rivals = tuple(c for c in ranking if c.label != effect.label)
        accepted.append(Accepted(effect, own.evidence, probability(own, ranking), rivals[:8]))
    return chosen, accepted


def probability(candidate: Candidate, ranking: list[Candidate]) -> float:
    """Posterior probability among all candidates and 'nothing', equal prior odds each."""
    evidences = np.array([0.0] + [c.evidence for c in ranking if c.label != candidate.label] + [candidate.evidence])
    weights = np.exp(evidences - evidences.max())
    return float(weights[-1] / weights.sum())
