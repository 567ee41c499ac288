"""Selection: which effects the data asks for, forward with replacement and backward removal.

Every round scans the whole library against the residual of the current joint fit, takes the candidate with
the most evidence, checks it by cross-validation over whole poses or runs (worth.py), and fits everything anew
through the chain. Afterwards each accepted effect is taken out again and has to win its place against the
whole library; the evidences of that contest give its probability and its rivals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from exactarm.chain import Layout
from exactarm.diagnose.admissible import is_possible
from exactarm.diagnose.bagging import bagged_contest
from exactarm.diagnose.cluster_robust import robust_evidence
from exactarm.diagnose.contest import PAIRED, contest, differs
from exactarm.diagnose.cross_validation import CrossValidation, folds_of
from exactarm.diagnose.decisions import CERTAIN, CONFIRMED, LEAST_EVIDENCE, NAMED_AT
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.forms import forms_of, parts_of_one_wave, same_family
from exactarm.diagnose.gear_curves import with_curves
from exactarm.diagnose.joint_fit import candidates_for, count_of, refit
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.scan import Candidate, linear_columns, scan
from exactarm.diagnose.selected import Accepted, Selection
from exactarm.diagnose.something_else import Beside, beside_unknown
from exactarm.diagnose.vocabulary import emptied
from exactarm.diagnose.worth import by_number, is_worth
from exactarm.effects.base import Effect

MOST_EFFECTS = 16
_SHORTLIST = 12
_INDEPENDENT_SHARE = 0.8
_HIDDEN_GAIN = 1.5  # gain of the second beside the first, over what both promised alone
_MOST_ANEW = 2  # searches with more declared parameters than the one before

Progress = Callable[[str], None]


def select_anew(problem: Problem, declared: Layout, progress: Progress) -> tuple[Layout, Selection]:
    """Step by step, then anew with what else of the declared model the noise beside the effects shows, as
    `find_causes` has it: what a strong cause hid of the geometry would pass for further effects."""
    found = select(problem, declared, progress)
    for _ in range(_MOST_ANEW):
        before = found.fits[0].layout
        wider = problem.declared_under(before, found.fits[-1].sigma)
        if wider.size <= before.size or not found.accepted:
            break
        progress(f"searching anew with {wider.size - before.size} more declared parameters")
        again = select(problem, wider, progress)
        if _likelihood_less_price(again) <= _likelihood_less_price(found):
            break
        declared, found = wider, again
    return declared, found


def _likelihood_less_price(found: Selection) -> float:
    """By Schwarz's approximation, of the last fit under its own noise."""
    last = found.fits[-1]
    price = 0.5 * last.layout.size * float(np.log(last.residual.size))
    return -len(last.residual) * float(np.sum(np.log(last.sigma))) - price


def select(problem: Problem, declared: Layout, progress: Progress = lambda text: None,
           found: Selection | None = None) -> Selection | None:
    """Forward selection from the declared model, then the contest for every place. found: what stands
    already; then curves of all gears come first, and where none is asked for the result is None."""
    fits = [problem.fit(declared)] if found is None else list(found.fits)
    stand = () if found is None else found.accepted
    chosen, rounds = [a.effect for a in stand], [a.round for a in stand]
    settled = {a.effect.label: a for a in stand if not a.effect.any_curve}
    first_ranking, curved = (), False
    while len(chosen) < MOST_EFFECTS:
        progress(f"{len(chosen)} found so far")
        fitted = fits[-1]
        problem = problem.knowing(fitted)
        field = candidates_for(problem, fitted)
        ranking = tuple(scan(fitted, field, count_of(problem, fitted)))
        first_ranking = first_ranking or ranking
        search = curved or found is None
        step = _best_addition(problem, declared, chosen, fitted, ranking) if search else None
        if step is None and not curved:
            # Which load or device acts is asked while the curves are stiff: loose ones hide it.
            templates = [effect for effect in field if effect.any_curve]
            gears = {e.label for e in chosen if any(same_family(e, template) for template in templates)}
            places = [place for place, e in enumerate(chosen)
                      if templates and e.label not in gears and e.label not in settled]
            done, fitted = contest(problem, declared, chosen, rounds, fitted, first_ranking, progress, places)
            chosen, fits[-1] = [*fitted.layout.effects[len(declared.effects):]], fitted
            settled |= {each.effect.label: each for each in done.values()}
            rounds = [done[place].round if place in done else rounds[place] for place in range(len(chosen))]
            curved, step = True, _curves(problem, declared, rounds, fitted, templates, len(fits) - 1)
            if step is None and found is not None:
                return None
            rounds = rounds if step is None else step[2]
        if step is None:
            break
        chosen, trial = step[:2]
        rounds += [len(fits) - 1] * (len(chosen) - len(rounds))
        fits.append(trial)
    places, fitted = _prune(problem, declared, chosen, fits[-1])
    chosen, rounds = [*fitted.layout.effects[len(declared.effects):]], [rounds[place] for place in places]
    places = [place for place, effect in enumerate(chosen) if effect.label not in settled]
    done, fitted = contest(problem, declared, chosen, rounds, fitted, first_ranking, progress, places)
    accepted = [replace(done[place], effect=effect) if place in done
                else replace(settled[effect.label], effect=effect, round=rounds[place])
                for place, effect in enumerate(fitted.layout.effects[len(declared.effects):])]
    if not problem.unknown_rivals:
        accepted = _bagged(problem.knowing(fitted), len(declared.effects), accepted, fitted)
    asked, (accepted, fitted) = tuple(accepted), _admissible(problem, declared, accepted, fitted)
    if (effects := [a.effect for a in accepted]) != (fuller := [e.with_all_terms() for e in effects]):
        fitted = refit(problem.knowing(fitted), declared, fuller, fitted)
        effects = fitted.layout.effects[len(declared.effects):]
        accepted = [replace(a, effect=effect) for a, effect in zip(accepted, effects)]
    if problem.unknown_rivals:
        accepted = with_shares(problem.knowing(fitted), declared, accepted, fitted)
    if len(fits) > 1:
        fits[-1] = fitted
    return Selection(tuple(fits), tuple(accepted), () if accepted else asked)


def _curves(problem, declared, rounds, fitted: Fitted, templates: list[Effect], turn: int):
    """The effects with curves of all gears, the fit, and the round in which each effect came in; else
    None."""
    found, count = fitted.layout.effects[len(declared.effects):], count_of(problem, fitted)
    each = {effect.joint: effect for effect in templates}
    effects = with_curves(problem, fitted, len(declared.effects), [*each.values()], count)
    trial = effects and refit(problem, declared, effects, fitted)
    if not trial or not trial.fit.converged:
        return None
    rounds = [rounds[found.index(effect)] if effect in found else turn for effect in effects]
    return [*trial.layout.effects[len(declared.effects):]], trial, rounds


def _best_addition(problem, declared, chosen, fitted, ranking):
    """The best candidate that cross-validation and the joint fit confirm, with what is independent of it;
    else None."""
    parted = CrossValidation.of(fitted, folds_of(problem.groups(), problem.seed))
    asked = [c for c in ranking[:_SHORTLIST] if c.evidence >= LEAST_EVIDENCE]
    shortlist = [c for c in asked if _evidence(problem, fitted, c) >= LEAST_EVIDENCE]
    for place, candidate in enumerate(shortlist):
        for form in _worthy_forms(problem, fitted, candidate, parted):
            group, excludes = [form.effect], form.effect.excludes_rows()
            if not excludes:
                group = _independent(problem, fitted, [form, *shortlist[place + 1 :]], parted)
            for effects in (group, group[:1]) if len(group) > 1 else (group,):
                trial = refit(problem, declared, chosen + effects, fitted)
                if excludes or _confirmed(problem, declared, fitted, trial, form.gain):
                    return [*trial.layout.effects[len(declared.effects):]], trial
    return _best_pair(problem, declared, chosen, fitted, asked, parted)


def _evidence(problem: Problem, fitted: Fitted, candidate: Candidate) -> float:
    """The candidate's evidence; where groups of rows are independent, not more than their scatter allows."""
    effect = candidate.effect
    if not problem.groups_independent or effect.excludes_rows():
        return candidate.evidence
    columns = linear_columns(fitted, effect)
    return robust_evidence(fitted, candidate, columns, problem.groups(), count_of(problem, fitted))


def _worthy_forms(problem, fitted, candidate: Candidate, parted) -> Iterator[Candidate]:
    """The candidate and then the other forms of the same cause that cross-validation supports: a curve that
    wraps around single poses hides the one order that is there, a crank that nothing stops from being far
    too strong the spring that only stiffens. The next is tried where the joint fit does not confirm one."""
    if is_worth(problem, fitted, [candidate.effect], parted):
        yield candidate
    if not candidate.effect.family:
        return
    field, count = candidates_for(problem, fitted), count_of(problem, fitted)
    forms = forms_of(fitted, candidate.effect, field, count, LEAST_EVIDENCE)
    for form in sorted(forms.values(), key=lambda form: -form.evidence):
        if (differs(form.effect, candidate.effect) and _evidence(problem, fitted, form) >= LEAST_EVIDENCE
                and is_worth(problem, fitted, [form.effect], parted)):
            yield form


def _best_pair(problem, declared, chosen, fitted, shortlist: list[Candidate], parted):
    """Two candidates that hide each other, or are parts of one wave: neither is supported alone, both
    together are; else None."""
    count, pairs = count_of(problem, fitted), []
    linear = [c for c in shortlist if not c.effect.excludes_rows()][:PAIRED]
    for place, first in enumerate(linear):
        beside = fitted.beside(linear_columns(fitted, first.effect))
        for alone in linear[place + 1 :]:
            # Another search beside the first may end at another order and label: it is the same candidate.
            for second in scan(beside, [emptied(alone.effect)], count):
                hidden = second.gain > _HIDDEN_GAIN * (first.gain + alone.gain)
                if hidden or parts_of_one_wave(first, second, LEAST_EVIDENCE):
                    pairs.append((first.gain + second.gain, first.effect, second.effect))
    for gain, *effects in sorted(pairs, key=lambda pair: -pair[0]):
        if is_worth(problem, fitted, effects, parted):
            trial = refit(problem, declared, chosen + effects, fitted)
            if _confirmed(problem, declared, fitted, trial, gain):
                return [*trial.layout.effects[len(declared.effects):]], trial
    return None


def _confirmed(problem: Problem, declared: Layout, fitted: Fitted, trial: Fitted, gain: float) -> bool:
    """Whether the joint fit takes enough of the gain that the linear picture promised, with possible
    values."""
    if fitted.square(fitted) - trial.square(fitted) < CONFIRMED * gain:
        return False
    added = range(len(declared.effects), len(trial.layout.effects))
    return all(is_possible(problem.robot, trial, index) for index in added)


def _admissible(problem: Problem, declared: Layout, accepted: list[Accepted], fitted: Fitted):
    """Without the effects, the least probable first, that are impossible or less probable than not."""
    first = len(declared.effects)
    while accepted:
        worst = [place for place, a in enumerate(accepted) if a.probability < NAMED_AT
                 or not is_possible(problem.robot, fitted, first + place)]
        if not worst:
            break
        out = min(worst, key=lambda place: accepted[place].probability)
        accepted = accepted[:out] + accepted[out + 1 :]
        fitted = refit(problem, declared, [a.effect for a in accepted], fitted)
        effects = fitted.layout.effects[first:]
        accepted = [replace(a, effect=effect) for a, effect in zip(accepted, effects)]
    return accepted, fitted


def with_shares(problem: Problem, declared: Layout, accepted: Sequence[Accepted],
                fitted: Fitted) -> list[Accepted]:
    """The effects of the last fit, each with its bagged probability beside its rivals, and its share beside
    unknown functions in its place, or in the place of all effects that stand."""
    first = len(declared.effects)
    places = [place for place, own in enumerate(accepted) if not own.effect.excludes_rows()]
    accepted = _bagged(problem, first, accepted, fitted)
    field = lambda without: candidates_for(problem, without)
    numbers = lambda without: count_of(problem, without)

    def beside(group: list[int]) -> Beside:
        steps, without = [], fitted
        for place in reversed(group):
            effect, without = without.layout.effects[first + place], without.without(first + place)
            steps.insert(0, (without, effect))
        return beside_unknown(problem, steps, field, numbers)

    alone = {place: beside([place]) for place in places}
    stand = [place for place in places if alone[place].share >= NAMED_AT]
    groups = [stand] if len(stand) > 1 else []
    groups += [[p for p in stand if p != out] for out in stand] if len(stand) > 2 else []
    together = [(group, beside(group)) for group in groups]
    found = list(accepted)
    for place in places:
        asked = [alone[place], *(other for group, other in together if place in group)]
        odds = sum((1.0 - other.share) / max(other.share, np.finfo(float).tiny) for other in asked)
        share, worst = 1.0 / (1.0 + odds), min(asked, key=lambda other: other.share)
        found[place] = replace(accepted[place], share=share,
                               likelier=worst.likeliest if share < NAMED_AT else None)
    return found


def _bagged(problem: Problem, first: int, accepted: Sequence[Accepted], fitted: Fitted) -> list[Accepted]:
    """The effects behind the first ones of a fit, none with more than its bagged probability beside its
    rivals."""
    found, pieces = list(accepted), problem.pieces()
    for place, own in enumerate(accepted):
        if own.effect.excludes_rows():
            continue
        without, rivals = fitted.without(first + place), [(c.effect, c.evidence) for c in own.rivals]
        sure = bagged_contest(without, (own.effect, own.evidence), rivals, count_of(problem, without), pieces)
        found[place] = replace(own, probability=min(own.probability, sure))
    return found


def _independent(problem, fitted, shortlist: list[Candidate], parted) -> list[Effect]:
    """The first of the shortlist and those others whose gain stays the same beside it: independent causes.

    Saves a search over the whole library for each of many independent causes (a curve on every axis).
    """
    group = [shortlist[0].effect]
    beside, count = fitted.beside(linear_columns(fitted, shortlist[0].effect)), count_of(problem, fitted)
    for candidate in shortlist[1:]:
        if candidate.evidence < CERTAIN or candidate.effect.excludes_rows():
            continue
        found = scan(beside, [emptied(candidate.effect)], count)[0]
        independent = found.gain >= _INDEPENDENT_SHARE * candidate.gain
        if independent and is_worth(problem, fitted, [candidate.effect], parted):
            group.append(found.effect)
            beside = beside.beside(linear_columns(fitted, candidate.effect))
    return group


def _prune(problem, declared, chosen, fitted):
    """Backward: takes out every effect whose evidence, with all others in, has gone. Returns the places that
    stay."""
    places, place = list(range(len(chosen))), 0
    while place < len(chosen):
        problem = problem.knowing(fitted)
        without = fitted.without(len(declared.effects) + place)
        if not chosen[place].excludes_rows() and _lost(problem, without, chosen[place]):
            del places[place]
            fitted = refit(problem, declared, chosen[:place] + chosen[place + 1 :], fitted)
            chosen = [*fitted.layout.effects[len(declared.effects):]]
            place = 0
        else:
            place += 1
    return places, fitted


def _lost(problem: Problem, without: Fitted, effect: Effect) -> bool:
    """Whether an effect that is taken out of the fit would no longer be asked for."""
    own = scan(without, [emptied(effect)], count_of(problem, without))[0]
    shows = problem.numbers_to_explain(by_number(linear_columns(without, effect), without))
    square = float(np.sum(without.free_residual[: without.data_numbers][shows.ravel()] ** 2))
    small = (own.gain < problem.least_share * square
             or problem.judged_share(without, own.effect) < Problem.least_share)
    return own.evidence < LEAST_EVIDENCE or small


