"""The contest for every place: each accepted effect is taken out again and has to win its place against the
whole library, and against two causes of it; the evidences give its probability and its rivals.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm.diagnose.admissible import is_possible
from exactarm.diagnose.decisions import LEAST_EVIDENCE
from exactarm.diagnose.fitted import Fitted, rows_kept
from exactarm.diagnose.forms import best_form, same_family
from exactarm.diagnose.joint_fit import candidates_for, count_of, refit
from exactarm.diagnose.scan import Candidate, free_mask, linear_columns, probability, same_cause, scan
from exactarm.diagnose.selected import Accepted
from exactarm.diagnose.vocabulary import emptied
from exactarm.diagnose.worth import holds_elsewhere
from exactarm.effects.base import Effect

PAIRED = 6  # of the shortlist, tried two by two


def contest(problem, declared, chosen, rounds, fitted, first_ranking, progress,
            places) -> tuple[dict[int, Accepted], Fitted]:
    """The effects of these places against the whole library, with all others in place; a stronger rival
    takes the place, or two of them take it and one behind the last. By place what is accepted; the fit."""
    accepted: dict[int, Accepted] = {}
    waiting, rounds, first = list(places), dict(enumerate(rounds)), len(declared.effects)
    while waiting:
        place = waiting.pop(0)
        progress(f"contest for {chosen[place].label}")
        problem = problem.knowing(fitted)
        without = fitted.without(first + place)
        if chosen[place].excludes_rows():
            without = replace(without, weight=rows_kept(without.layout, without.view).astype(float))
        count = count_of(problem, without)
        field = _rivals_of(chosen[place], candidates_for(problem, without), first_ranking)
        # A curve has its law already: it is asked only whether less would do.
        forms = [form for form in (*field, *chosen[place].richer())
                 if not (form.any_curve and chosen[place].any_curve) or form == emptied(chosen[place])]
        form = best_form(problem, without, chosen[place], forms, count, LEAST_EVIDENCE)
        if form is not None and differs(form.effect, chosen[place]):
            fitted = refit(problem, declared, chosen[:place] + [form.effect] + chosen[place + 1 :], fitted)
            chosen = [*fitted.layout.effects[first:]]
        ranking = scan(without, field, count)
        own = next((c for c in ranking if c.label == chosen[place].label), None)
        winner = next((c for c in ranking if not same_family(c.effect, chosen[place])), ranking[0])
        stronger = own is not None and winner.label != own.label and winner.evidence > own.evidence
        if stronger and holds_elsewhere(problem, without, [winner.effect]):
            trial = refit(problem, declared, chosen[:place] + [winner.effect] + chosen[place + 1 :], fitted)
            lead = _lead(fitted, trial, count)
            if lead < 0.0:
                fitted, own = trial, winner
                chosen = [*trial.layout.effects[first:]]
            else:  # the joint fits have the last word on which of the two is more likely
                own = replace(own, evidence=max(own.evidence, winner.evidence + lead))
        effect = chosen[place]
        own = own or Candidate(effect, 0.0, 0, 1, LEAST_EVIDENCE)
        # Rows that are wrong by themselves pull at every other candidate: the only rival is to keep them.
        ranking = [] if effect.excludes_rows() else ranking
        # A posterior over sets has weighed pairs by itself, with priors: with a pair of compliances in place
        # of one, what was found on UR10 C predicted series B by 0.525, not 0.433 mm.
        pair = [] if problem.by_posterior else _two_in_place(without, own, ranking, count)
        if pair and holds_elsewhere(problem, without, pair):
            both = chosen[:place] + pair[:1] + chosen[place + 1 :] + pair[1:]
            trial = refit(problem, declared, both, fitted)
            possible = all(is_possible(problem.robot, trial, first + k) for k in (place, len(chosen)))
            if possible and _lead(fitted, trial, count) < -LEAST_EVIDENCE:
                rounds[len(chosen)] = rounds[place]
                waiting = [place, *waiting, len(chosen)]
                fitted, chosen = trial, [*trial.layout.effects[first:]]
                continue
        rivals = tuple(c for c in ranking if not same_cause(c.effect, effect))
        accepted[place] = Accepted(effect, own.evidence, probability(own, ranking), rivals[:8], rounds[place])
    return accepted, fitted


def _lead(fitted: Fitted, trial: Fitted, count: float) -> float:
    """Log odds of the fit against the trial, by Schwarz's approximation."""
    numbers = [sum(free_mask(effect).sum() for effect in each.layout.effects) for each in (trial, fitted)]
    return 0.5 * (trial.square(fitted) - fitted.square(fitted) + np.log(count) * (numbers[0] - numbers[1]))


def _two_in_place(without: Fitted, own: Candidate, ranking: list[Candidate], count: float) -> list[Effect]:
    """Two causes that are together likelier than the one that stands by what one more cause has to bring:
    alone, each leaves what the other one does, and the one came before both. None where there are none.

    Waves of a gear are none of the two: one of many orders lies near whatever the other one leaves."""
    field = [c for c in ranking if c.evidence >= LEAST_EVIDENCE and not c.effect.excludes_rows()
             and not c.effect.family and not same_cause(c.effect, own.effect)][:PAIRED]
    best, found = own.evidence + LEAST_EVIDENCE, []
    for place, one in enumerate(field):
        others = [emptied(c.effect) for c in field[place + 1 :] if not same_cause(c.effect, one.effect)]
        for other in scan(without.beside(linear_columns(without, one.effect)), others, count)[:1]:
            if other.evidence >= LEAST_EVIDENCE and one.evidence + other.evidence > best:
                best, found = one.evidence + other.evidence, [one.effect, other.effect]
    return found


def _rivals_of(effect: Effect, library_field: list[Effect], first_ranking) -> list[Effect]:
    """The whole library against `effect`; on other axes, searched families only at the best point of the
    first search."""
    best = {c.label: c.effect for c in first_ranking}
    field = [] if effect.excludes_rows() else [emptied(effect)]
    for other in library_field:
        searched = any(p.search for p in other.parameters())
        if searched and other.joint != effect.joint:
            if other.label in best:
                field.append(emptied(best.pop(other.label)))
        else:
            field.append(_tried_at(effect, other))
    return field


def _tried_at(effect: Effect, other: Effect) -> Effect:
    """The other, tried where the search for `effect` ended too: no finer place decides between them."""
    found = {p.name: value for p, value in zip(effect.parameters(), effect.values) if p.search}
    return other.with_values(found.get(p.name, value) if p.search else value
                             for p, value in zip(other.parameters(), other.values))


def differs(one: Effect, other: Effect) -> bool:
    """In kind or in the number of parameters."""
    return one.name != other.name or len(one.values) != len(other.values)
