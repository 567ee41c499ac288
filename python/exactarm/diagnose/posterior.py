"""Which causes the data ask for: one posterior over sets of named causes and unknown functions.

1. The declared model is fitted, and every cause linearised there once (vocabulary.py): relinearising at a
   clearance lies, because other columns then pass through its steep flank.
2. Search (search_round.py) under a noise model (noise/), which is estimated anew with the causes found.
3. The best set is confirmed by the joint non-linear fit through the chain; a set whose fit takes less than
   half of the gain that was promised loses its weakest members. Then what is left is searched once more
   beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from exactarm.chain import Layout
from exactarm.diagnose.cross_validation import folds_of
from exactarm.diagnose.decisions import CERTAIN, CONFIRMED, CREDIBLE, DOUBT, NAMED_AT
from exactarm.diagnose.evidence import Members, Picture
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.idle_causes import idle_places, least_told
from exactarm.diagnose.joint_fit import candidates_for, refit
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.scan import Candidate
from exactarm.diagnose.search import Posterior, log_prior_of_count, weight_of
from exactarm.diagnose.search_round import MOST_AT_ONCE, At, Found, score_of, search_round
from exactarm.diagnose.selected import UNKNOWN, Accepted, Selection
from exactarm.diagnose.self_test import SelfTest, self_test
from exactarm.diagnose.signal import Structure
from exactarm.diagnose.vocabulary import UNKNOWN_MASS, Vocabulary, at_values, vocabulary_of
from exactarm.effects.base import Effect
from exactarm.noise.estimate import log_likelihood_under
from exactarm.noise.model import NoiseModel

_ROUNDS = 4  # of search beside what has been found
_MOST_REFUSED = 3  # best sets that only fit their own rows: others are looked for without them

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Place:
    """One cause in the best set: its effect as fitted, its probability, and the labels that could stand in
    its place.

    rivals: (label, effect or None: unknown function, probability), the most probable first; log_odds: of the
    cause, at any size, against none in its place; nothing: share of none in what is against it there.
    """

    label: str
    effect: Effect
    probability: float
    log_odds: float
    rivals: tuple[tuple[str, Effect | None, float], ...]
    round: int
    nothing: float = 1.0

    @property
    def one_of_many(self) -> bool:
        """Whether named causes fill it together, and none by itself."""
        rivals = sum(p for _, effect, p in self.rivals if effect is not None)
        return self.probability < NAMED_AT <= self.probability + rivals


@dataclass(frozen=True)
class Causes:
    """What the posterior says. fits[0]: declared; fits[i]: after i rounds; unknown: the unknown functions
    in the best set; undecided: places of it that named causes fill together, and none by itself."""

    fits: tuple[Fitted, ...]
    places: tuple[Place, ...]
    unknown: tuple[Structure, ...]
    probability_nothing: float
    probability_something_else: float
    noise: NoiseModel
    test: SelfTest
    score: float  # log of likelihood times prior of the best set of the last round
    name_prior: float  # mean log prior of a name of the library as the next cause
    undecided: tuple[Place, ...] = ()


def find_causes(problem: Problem, declared: Layout, progress: Progress = lambda text: None) -> Causes | None:
    """Named causes and unknown functions, from the declared model on; None where too many act at once for one
    linear picture.

    What the declared fit leaves decides which of its parameters can be told. Where the noise beside the
    causes is less, more of them can be, and what they had left is no cause: all begins anew with them, or
    goes on from the causes found where anew too many would act at once. The likelier counts, for a weak
    direction that is free beside a strong cause may lead the fit, and its linear picture, far from where it
    should be."""
    found = _causes(problem, declared, progress)
    if found is None:
        return None
    wider = problem.declared_under(found.fits[0].layout, found.noise.of_a_row)
    if wider.size > declared.size:
        progress(f"searching anew with {wider.size - declared.size} more declared parameters")
        again = _causes(problem, wider, progress) or _causes(problem, wider, progress, found)
        found = found if again is None else max(found, again, key=_likelihood_less_price)
    return found


def _likelihood_less_price(causes: Causes) -> float:
    """By Schwarz's approximation for all that was fitted."""
    return causes.score - 0.5 * causes.fits[-1].layout.size * float(np.log(causes.noise.numbers))


def _causes(problem: Problem, declared: Layout, progress: Progress,
            begun: Causes | None = None) -> Causes | None:
    """begun: causes to begin with, found beside fewer declared parameters."""
    first = problem.fit(declared)
    fits, chosen, places, unknown = [first], [], [], ()
    whole = vocabulary = _vocabulary(problem, first)
    carried = {b.label for b in whole.blocks if b.effect is not None and b.effect.carried}
    # without springs a payload moves nothing: springs that are found show it, so they come first, and alone
    # where the fit has them so
    springs_first = first.view.has_masses and not carried
    nothing = something = noise = None
    refused, undecided = 0, ()

    def beside_chosen(fit: Fitted) -> Vocabulary:
        more = [e for e in candidates_for(problem, fit) if e.carried and e.label not in carried]
        return whole.beside(chosen).joined(vocabulary_of(fit, _companions(chosen) + more, []))

    if begun is not None and begun.places:
        fits.append(refit(problem, declared, [place.effect for place in begun.places], first, begun.noise))
        chosen = [*fits[-1].layout.effects[len(declared.effects) :]]
        places = [replace(place, round=0) for place in begun.places]
        nothing, noise, vocabulary = begun.probability_nothing, begun.noise, beside_chosen(fits[-1])
    for _ in range(_ROUNDS + _MOST_REFUSED):
        progress(f"{len(chosen)} found so far")
        found = search_round(problem, At.of(problem, fits[-1], vocabulary, len(chosen)), noise)
        if found is None or len(places) + len(found.members.blocks) > MOST_AT_ONCE:
            return None
        asked_for = _places(found, len(fits) - 1)
        likely = [p for p in asked_for if p.probability >= NAMED_AT]
        new = _one_each(likely)
        springs = [p for p in new if p.effect.gives_way and springs_first]
        if any(effect.gives_way for effect in chosen) or len(springs) == len(new):
            springs = []
        nothing = found.probability_of_nothing() if nothing is None else nothing
        something, unknown, noise = found.probability_of_unknown(), tuple(found.structures()), found.noise
        for asked in (springs, new) if springs else (new,):
            held = _holding(found, asked, problem.seed)
            kept, fit = _confirmed(problem, declared, chosen, fits[-1], found, held)
            if kept:
                break
        if not kept and any(place.effect.any_curve for place in held):  # what stood beside it
            held = _holding(found, _one_each([p for p in likely if not p.effect.any_curve]), problem.seed)
            kept, fit = _confirmed(problem, declared, chosen, fits[-1], found, held)
        if kept:
            chosen = [*fit.layout.effects[len(declared.effects) :]]
            places += kept
            fits.append(fit)
            vocabulary = beside_chosen(fit)
        elif new and not held and refused < _MOST_REFUSED:
            refused, whole = refused + 1, whole.without(found.named_blocks())
            vocabulary = whole.beside(chosen)
            noise, nothing = None, nothing if chosen else None
        else:
            undecided = tuple(p for p in asked_for if not new and p.one_of_many)
            break
    # what the causes of later rounds have taken over
    while idle := idle_places(fits[-1], declared) or least_told(fits[-1], declared):
        chosen, places = ([one for k, one in enumerate(each) if k not in idle] for each in (chosen, places))
        fits[-1] = refit(problem, declared, chosen, fits[-1], noise) if chosen else first
    if chosen != (fuller := [effect.with_all_terms() for effect in chosen]):
        fits[-1] = refit(problem, declared, fuller, fits[-1], noise)
        chosen = [*fits[-1].layout.effects[len(declared.effects) :]]
    wrong = _wrong_rows(problem, declared, chosen, fits[-1], noise)
    if wrong is not None:
        place, fit = wrong
        chosen = [*fit.layout.effects[len(declared.effects) :]]
        places.append(replace(place, round=len(fits) - 1))
        fits.append(fit)
    places = [replace(place, effect=effect) for place, effect in zip(places, chosen)]
    named = {block.label for block in whole.blocks if block.effect is not None}
    return Causes(tuple(fits), tuple(places), unknown, nothing, something, noise,
                  _tested(problem, first, whole, found), score_of(found),
                  float(np.log((1.0 - UNKNOWN_MASS) / max(len(named), 1))), undecided)


def _companions(chosen: list[Effect]) -> list[Effect]:
    """What often acts beside the effects found, unless a form of it is among them."""
    found = [companion for effect in chosen for companion in effect.companions()]
    return [c for c in found if not any(effect.includes(c) for effect in chosen)]


def steps_win(causes: Causes, steps: Selection) -> bool:
    """Whether effects that were found step by step are likelier than the unknown functions, or the curves,
    that the posterior knows only, under the same noise: their likelihood by Schwarz's approximation

        log p(r given steps) = log p(residual) - k/2 log n,     k: columns of the effects"""
    def weighed(last: Fitted, count: int) -> float:
        price = 0.5 * (last.layout.size - steps.fits[0].layout.size) * np.log(causes.noise.numbers)
        prior = log_prior_of_count(count) + count * causes.name_prior
        return log_likelihood_under(causes.noise, last.residual) - price + prior
    own = weighed(causes.fits[-1], len(causes.places)) if causes.places else causes.score
    return weighed(steps.fits[-1], len(steps.accepted)) > own


def _tested(problem: Problem, first: Fitted, vocabulary: Vocabulary, found: Found) -> SelfTest:
    noise = found.noise
    picture = Picture.of(vocabulary, first.residual, first.jacobian, noise)
    return self_test(picture, noise.whiten(found.left[:, :, None])[:, 0], problem.groups(), problem.seed)


def _wrong_rows(problem, declared, chosen, fitted: Fitted, noise: NoiseModel):
    """The effect that leaves out rows that are wrong by themselves, where the noise has such rows, they are
    scattered, and not all of them are what a chosen effect could as well have done there."""
    if not noise.wrong.any():
        return None
    for effect in candidates_for(problem, fitted):
        if not effect.excludes_rows():
            continue
        trial = refit(problem, declared, [*chosen, effect.leaving_out(fitted.view, noise.wrong)], fitted)
        if trial.weight.all() or _could_be_right(trial, len(declared.effects), noise):
            continue
        sure = min(noise.wrong_probability, 1.0 - DOUBT)
        return Place(effect.label, effect, sure, np.inf, (), 0), trial
    return None


def _could_be_right(trial: Fitted, first: int, noise: NoiseModel) -> bool:
    """Whether an effect behind the first ones, whose change is not known in every row, could explain each
    wrong row: within the bounds of the change, its error is one that a good row may have."""
    view, out, sigma = trial.view, noise.wrong, noise.sigma[:3]
    largest = 2.0 * special.gammainccinv(1.5, DOUBT / view.rows)  # of chi-squared
    error = trial.residual[:, :3]
    for effect in trial.layout.effects[first:]:
        bounds = effect.could_change(view)
        if bounds is None:
            continue
        change = effect.change(view)
        moved = view.transfers[effect.station_in(view)](change.columns, np.ones((view.rows, 1, 1)))[:, :3, 0]
        nearest = np.sum(moved * error / sigma**2, axis=1) / np.sum((moved / sigma) ** 2 + 1e-300, axis=1)
        more = np.clip(change.value[:, 0] + nearest, *bounds) - change.value[:, 0]
        out = out & (np.sum(((error - more[:, None] * moved) / sigma) ** 2, axis=1) > largest)
    return not out.any()


def selection_of(causes: Causes) -> Selection:
    """The same as the result of a selection."""
    return Selection(causes.fits, *(tuple(map(_accepted, p)) for p in (causes.places, causes.undecided)))


def _accepted(place: Place) -> Accepted:
    odds = lambda p: place.log_odds + float(np.log(max(p, 1e-300) / max(place.probability, 1e-300)))
    rivals = tuple(Candidate(effect, 0.0, 0, 1, odds(p))
                   for _, effect, p in place.rivals if effect is not None)
    return Accepted(place.effect, place.log_odds, place.probability, rivals, place.round, _credible(place))


def _credible(place: Place) -> tuple[tuple[str, int | None, float], ...]:
    """(effect, joint, probability): the smallest set of causes that holds 95 % of the place."""
    field = sorted([(place.effect, place.probability), *((e, p) for _, e, p in place.rivals)],
                   key=lambda f: -f[1])
    found, total = [], 0.0
    for effect, probability in field:
        name, joint = (UNKNOWN, None) if effect is None else (effect.name, effect.joint)
        found.append((name, joint, float(probability)))
        total += probability
        if total >= CREDIBLE:
            break
    return tuple(found)


def _vocabulary(problem: Problem, fitted: Fitted) -> Vocabulary:
    effects = [e for e in candidates_for(problem, fitted) if not e.excludes_rows()]
    return vocabulary_of(fitted, effects, problem.unknown_functions(fitted))


def _places(found: Found, turn: int) -> list[Place]:
    """The named members of the best set, each with its probability and its rivals."""
    members, inclusion = found.members, found.posterior.inclusion()
    whole = weight_of(found.picture, members)
    places = []
    values = found.picture.coefficients(members)
    for k, (index, scale, value) in enumerate(zip(members.blocks, members.scales, values)):
        block = found.block(index)
        if block.effect is None:
            continue
        if k < len(found.certain.blocks):
            rest = Members(members.blocks[:k] + members.blocks[k + 1 :],
                           members.scales[:k] + members.scales[k + 1 :])
            log_odds = whole - weight_of(found.picture, rest)
            places.append(Place(block.label, at_values(block, scale, value), 1.0 - np.exp(-CERTAIN), log_odds,
                                (), turn))
            continue
        others = list(found.posterior.best)
        others.remove(block.label)
        field = _slot(found.posterior, tuple(others))
        total = np.logaddexp.reduce([weight for _, weight in field])
        against = [(label, weight) for label, weight in field if label != block.label]
        empty, held = dict(against)[None], [weight for label, weight in field if label == block.label]
        nothing = np.exp(empty - np.logaddexp.reduce([weight for _, weight in against]))
        rivals = sorted(((label, weight) for label, weight in against if label is not None),
                        key=lambda e: -e[1])
        named = tuple((label, _effect_at(found, others, label), float(np.exp(weight - total)))
                      for label, weight in rivals[:8])
        places.append(Place(block.label, at_values(block, scale, value), min(inclusion[block.label], 1.0),
                            float(np.logaddexp.reduce(held) - empty), named, turn, float(nothing)))
    return sorted(places, key=lambda p: -p.log_odds)


def _slot(posterior: Posterior, others: tuple[str, ...]) -> list[tuple[str | None, float]]:
    """(label, log weight) of all sets that are `others` and one more, or none more (label None)."""
    found = []
    for labels, weight in posterior.weights.items():
        if len(labels) == len(others) + 1:
            rest = list(labels)
            missing = [label for label in others if label not in rest or rest.remove(label)]
            if not missing and len(rest) == 1:
                found.append((rest[0], weight))
        elif tuple(sorted(labels)) == tuple(sorted(others)):
            found.append((None, weight))
    return found


def _effect_at(found: Found, others: list[str], label: str) -> Effect | None:
    """The rival in the best set's place, at its values; None: unknown function, or never worked out."""
    members = found.posterior.members.get(tuple(sorted([*others, label])))
    if members is None:
        return None
    members = Members(found.certain.blocks + members.blocks, found.certain.scales + members.scales)
    values = found.picture.coefficients(members)
    for index, scale, value in zip(members.blocks, members.scales, values):
        if found.block(index).label == label and found.block(index).effect is not None:
            return at_values(found.block(index), scale, value)
    return None


def _one_each(places: list[Place]) -> list[Place]:
    """The surest of each label: an order between two points of the grid shows at both, until it is fitted."""
    found: dict[str, Place] = {}
    for place in places:
        found.setdefault(place.label, place)
    return list(found.values())


def _holding(found: Found, places: list[Place], seed: int) -> list[Place]:
    """Those that lower the held-out square sum of a cross-validation over whole poses or runs by the share
    `least`, beside all others that do.

    Evidence trusts its noise model; what only fits its own rows does not pass here, whatever the noise is.
    """
    if not places:
        return []
    places, parted = list(places), found.picture.absorbed.parted(folds_of(found.at.groups, seed))
    held_out = lambda kept: found.picture.held_out(_only(found, kept), parted)
    while places:
        whole = held_out(places)
        without = {k: held_out(places[:k] + places[k + 1 :]) for k in range(len(places))}
        worst = min(without, key=lambda k: without[k])
        if without[worst] > whole:
            return places
        del places[worst]
    return places


def _confirmed(problem, declared, chosen, fitted, found: Found, places: list[Place]):
    """The joint non-linear fit with the new effects; those that come out as nothing are left out, and the
    weakest while less than half of the gain comes true."""
    while places:
        effects = [*chosen, *(place.effect for place in places)]
        trial = refit(problem, declared, effects, fitted, found.noise)
        before, after = (float(np.sum(found.noise.whiten(at.residual[:, :, None]) ** 2))
                         for at in (fitted, trial))
        left = lambda kept: found.picture.quadratic(_only(found, kept))[1]
        promised = left([]) - left(places)
        idle = [k - len(chosen) for k in idle_places(trial, declared) if k >= len(chosen)]
        if before - after >= CONFIRMED * promised and not idle:
            return places, trial
        places = [place for k, place in enumerate(places) if k not in (idle or [len(places) - 1])]
    return [], fitted


def _only(found: Found, places: list[Place]) -> Members:
    """The members of the best set that are these, and its unknown functions."""
    members, wanted, kept = found.members, [(p.label, p.effect.any_curve) for p in places], []
    for i, s in zip(members.blocks, members.scales):
        block = found.block(i)
        if block.effect is None:
            kept.append((i, s))
        elif (one := (block.label, block.effect.any_curve)) in wanted:
            wanted.remove(one)
            kept.append((i, s))
    return Members(tuple(i for i, _ in kept), tuple(s for _, s in kept))
