"""The contest for every place: each accepted effect is taken out again and has to win its place against the
whole library; the evidences give its probability and its rivals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from exactarm.diagnose.admissible import LEAST_EVIDENCE
from exactarm.diagnose.fitted import rows_kept
from exactarm.diagnose.forms import best_form, same_family
from exactarm.diagnose.joint_fit import candidates_for, count_of, refit
from exactarm.diagnose.scan import Candidate, free_mask, probability, same_cause, scan
from exactarm.diagnose.selected import Accepted
from exactarm.diagnose.vocabulary import emptied
from exactarm.diagnose.worth import holds_elsewhere
from exactarm.effects.base import Effect

Progress = Callable[[str], None]


def contest(problem, declared, chosen, rounds, fitted, first_ranking, progress, places):
    """The effects of these places against the whole library, with all others in place; a stronger rival
    takes the place."""
    accepted: list[Accepted] = []
    for place in places:
        progress(f"contest for {chosen[place].label}")
        problem = problem.knowing(fitted)
        without = fitted.without(len(declared.effects) + place)
        if chosen[place].excludes_rows():
            without = replace(without, weight=rows_kept(without.layout, without.view).astype(float))
        count = count_of(problem, without)
        field = _rivals_of(chosen[place], candidates_for(problem, without), first_ranking)
        # A curve has its law already: it is asked only whether less would do.
        forms = [form for form in (*field, *chosen[place].richer())
                 if not (form.any_curve and chosen[place].any_curve) or form == emptied(chosen[place])]
        form = best_form(problem, without, chosen[place], forms, count, LEAST_EVIDENCE)
        if form is not None and differs(form.effect, chosen[place]):
            trial = refit(problem, declared, chosen[:place] + [form.effect] + chosen[place + 1 :], fitted)
            fitted, chosen = trial, [*trial.layout.effects[len(declared.effects):]]
        ranking = scan(without, field, count)
        own = next((c for c in ranking if c.label == chosen[place].label), None)
        winner = next((c for c in ranking if not same_family(c.effect, chosen[place])), ranking[0])
        stronger = own is not None and winner.label != own.label and winner.evidence > own.evidence
        if stronger and holds_elsewhere(problem, without, [winner.effect]):
            trial = refit(problem, declared, chosen[:place] + [winner.effect] + chosen[place + 1 :], fitted)
            price = np.log(count) * (free_mask(winner.effect).sum() - free_mask(chosen[place]).sum())
            lead = 0.5 * (trial.square(fitted) + price - fitted.square(fitted))
            if lead < 0.0:
                fitted, own = trial, winner
                chosen = [*trial.layout.effects[len(declared.effects):]]
            else:  # the joint fits have the last word on which of the two is more likely
                own = replace(own, evidence=max(own.evidence, winner.evidence + lead))
        effect = chosen[place]
        own = own or Candidate(effect, 0.0, 0, 1, LEAST_EVIDENCE)
        # Rows that are wrong by themselves pull at every other candidate: the only rival is to keep them.
        ranking = [] if effect.excludes_rows() else ranking
        rivals = tuple(c for c in ranking if not same_cause(c.effect, effect))
        accepted.append(Accepted(effect, own.evidence, probability(own, ranking), rivals[:8], rounds[place]))
    return accepted, fitted


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
