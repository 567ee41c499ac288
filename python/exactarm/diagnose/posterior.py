"""Which causes the data ask for: one posterior over sets of named causes and unknown functions.

1. The declared model is fitted, and every cause linearised there once (vocabulary.py): relinearising at a
   clearance lies, because other columns then pass through its steep flank.
2. Search (search.py) under a noise model (noise/), which is estimated anew with the causes found, from up to
   three starts: one normal law, the family that the declared fit's residual asks for, the same with what rows
   share in time. The start whose likelihood, prior and price are better wins.
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
from exactarm.diagnose.evidence import Members, Picture, orthonormal_columns
from exactarm.diagnose.problem import Fitted, Problem
from exactarm.diagnose.scan import Candidate
from exactarm.diagnose.search import CERTAIN, Posterior, prior_of, search, weight_of
from exactarm.diagnose.selection import Accepted, Selection, candidates_for, refit
from exactarm.diagnose.self_test import SelfTest, self_test
from exactarm.diagnose.vocabulary import SCALES, Block, Vocabulary, at_values, vocabulary_of
from exactarm.effects.base import Effect
from exactarm.noise.estimate import estimate_noise, log_likelihood_under, normal_noise
from exactarm.noise.model import NoiseModel

NAMED_AT = 0.5  # probability from which a cause is named: more likely than not
WRONG_ROW_FALSE_ALARM = 0.01  # of a whole data set: what the threshold of the effect is set for
# causes and unknown functions together: of more, on measured arms, the sum fits its own rows only (UR10:
# eleven)
MOST_AT_ONCE = 5
WANDERS_AT = 2.0  # times the noise without it: a device that stands still would halve what is left
# of a row's variance that the next one shares: less, and a row is mostly its own, whatever it is called
COMMON = 0.5
UNKNOWN = "unknown"  # in the place of a name, for a cause that the library lacks
_CREDIBLE = 0.95
_ROUNDS = 4  # of search beside what has been found
_NOISE_PASSES = 3
_COLUMN_COSTS = 0.5  # of a degree of freedom, for a column under a prior
_CONFIRMED = 0.5  # of the promised gain
# relative change of a row's scale that moves no probability much: sizes are known to a factor of three
_SAME_SCALE = 0.3
_LEAST_NATS = 3.0  # in likelihood, below which another family of noise is not worth a start of its own

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Place:
    """One cause in the best set: its effect as fitted, its probability, and the labels that could stand in
    its place.

    rivals: (label, effect or None for an unknown function, probability), the most probable first, without the
    cause itself; log_odds: of the set with it against the set without it.
    """

    label: str
    effect: Effect
    probability: float
    log_odds: float
    rivals: tuple[tuple[str, Effect | None, float], ...]
    round: int


@dataclass(frozen=True)
class Causes:
    """What the posterior says. fits[0]: declared; fits[i]: after i rounds; unknown: titles of unknown
    functions in the best set."""

    fits: tuple[Fitted, ...]
    places: tuple[Place, ...]
    unknown: tuple[str, ...]
    probability_nothing: float
    probability_something_else: float
    noise: NoiseModel
    test: SelfTest

    @property
    def wandering_probability(self) -> float:
        """That neighbouring rows share something, by the likelihood that pays for its two parameters."""
        w = self.noise.wandering
        return 0.0 if w is None else float(special.expit(w.gain - np.log(len(self.noise.order))))

    @property
    def wanders(self) -> tuple[str, ...]:
        """In words: the device wanders, where that is as much as all other noise."""
        if self.noise.wander_over_rest < WANDERS_AT or self.noise.common_to_neighbours < COMMON:
            return ()
        return ("the device wanders or jumps: neighbouring rows share "
                f"{self.noise.wander_over_rest**2 - 1.0:.0f} times the variance "
                f"of one row alone, for about {self.noise.wandering.memory:.0f} rows",)


@dataclass(frozen=True)
class _Found:
    """One round: the picture, the causes that are certain, the posterior over what acts beside them, the
    noise, and the residual (N, m) that the best set leaves in the linear picture."""

    picture: Picture
    certain: Members
    posterior: Posterior
    noise: NoiseModel
    score: float
    left: np.ndarray

    @property
    def members(self) -> Members:
        """The best set."""
        beside = self.posterior.members[self.posterior.best]
        return Members(self.certain.blocks + beside.blocks, self.certain.scales + beside.scales)

    def block(self, index: int) -> Block:
        return self.picture.vocabulary.blocks[index]

    def probability_of_unknown(self) -> float:
        unknown = self.picture.vocabulary.unknown
        if any(self.block(i).label in unknown for i in self.certain.blocks):
            return 1.0
        return self.posterior.probability(lambda labels: not unknown.isdisjoint(labels))

    def probability_of_nothing(self) -> float:
        return 0.0 if self.certain.blocks else self.posterior.probability(lambda labels: not labels)

    def titles(self) -> list[str]:
        """Of the unknown functions in the best set."""
        return [self.block(i).unknown.title for i in self.members.blocks if self.block(i).unknown is not None]


def find_causes(problem: Problem, declared: Layout, progress: Progress = lambda text: None) -> Causes | None:
    """Named causes and unknown functions, from the declared model on; None where too many act at once for one
    linear picture."""
    first = problem.fit(declared)
    fits, chosen, places, unknown = [first], [], [], ()
    visits = problem.groups()
    folds = folds_of(visits, problem.seed)
    whole = vocabulary = _vocabulary(problem, first)
    nothing = something = None
    noise = None
    for turn in range(_ROUNDS):
        progress(f"searching with {len(chosen)} effects in the model")
        found = _round(problem, fits[-1], vocabulary, visits, noise)
        if found is None or len(places) + len(found.members.blocks) > MOST_AT_ONCE:
            return None
        new = [p for p in _places(found, turn) if p.probability >= NAMED_AT]
        new = _holding(found, _one_each(new), folds)
        nothing = found.probability_of_nothing() if nothing is None else nothing
        something, unknown, noise = found.probability_of_unknown(), tuple(found.titles()), found.noise
        kept, fit = _confirmed(problem, declared, chosen, fits[-1], found, new)
        if not kept:
            break
        chosen = [*fit.layout.effects[len(declared.effects) :]]
        places += kept
        fits.append(fit)
        vocabulary = whole.beside(chosen)
    wrong = _wrong_rows(problem, declared, chosen, fits[-1], noise)
    if wrong is not None:
        place, fit = wrong
        chosen = [*fit.layout.effects[len(declared.effects) :]]
        places.append(replace(place, round=len(fits) - 1))
        fits.append(fit)
    places = [replace(place, effect=effect) for place, effect in zip(places, chosen)]
    return Causes(tuple(fits), tuple(places), unknown, nothing, something, noise,
                  _tested(problem, first, whole, found.left, noise, visits))


def _tested(problem: Problem, first: Fitted, vocabulary: Vocabulary, left: np.ndarray, noise: NoiseModel,
            visits: np.ndarray) -> SelfTest:
    picture = Picture.of(vocabulary, first.residual, first.jacobian, noise, problem.correlation_factor(first))
    return self_test(picture, noise.whiten(left[:, :, None])[:, 0], visits, problem.seed)


def _wrong_rows(problem, declared, chosen, fitted: Fitted, noise: NoiseModel):
    """The effect that leaves out rows that are wrong by themselves, where the noise has such rows and they
    are scattered."""
    if not noise.wrong.any():
        return None
    for effect in candidates_for(problem, fitted):
        if type(effect).keep is Effect.keep:
            continue
        trial = refit(problem, declared, [*chosen, effect], fitted,
                      replace(noise, weight=np.ones(len(noise.weight))))
        if trial.weight.all():
            continue
        return Place(effect.label, effect, 1.0 - WRONG_ROW_FALSE_ALARM, np.inf, (), 0), trial
    return None


def selection_of(causes: Causes) -> Selection:
    """The same as the result of a selection."""
    accepted = []
    for place in causes.places:
        rivals = tuple(
            Candidate(effect, 0.0, 0, 1,
                      place.log_odds + float(np.log(max(p, 1e-300) / max(place.probability, 1e-300))))
            for _, effect, p in place.rivals if effect is not None
        )
        accepted.append(Accepted(place.effect, place.log_odds, place.probability, rivals, place.round,
                                 _credible(place)))
    return Selection(causes.fits, tuple(accepted), (), ())


def _credible(place: Place) -> tuple[tuple[str, int | None, float], ...]:
    """(effect, joint, probability): the smallest set of causes in this place that holds 95 %."""
    field = sorted([(place.effect, place.probability), *((e, p) for _, e, p in place.rivals)],
                   key=lambda f: -f[1])
    found, total = [], 0.0
    for effect, probability in field:
        name, joint = (UNKNOWN, None) if effect is None else (effect.name, effect.joint)
        found.append((name, joint, float(probability)))
        total += probability
        if total >= _CREDIBLE:
            break
    return tuple(found)


def _vocabulary(problem: Problem, fitted: Fitted) -> Vocabulary:
    effects = [e for e in candidates_for(problem, fitted) if type(e).keep is Effect.keep]
    return vocabulary_of(fitted, effects, problem.signals(fitted), problem.directions(fitted))


def _round(problem: Problem, fitted: Fitted, vocabulary: Vocabulary, visits: np.ndarray,
           noise: NoiseModel | None) -> _Found | None:
    """The best of the starts: one normal law, the family of the present residual, the same with what
    neighbours share; of one, where the noise is known.

    None where every start asks for too many causes at once."""
    if noise is not None:
        return _settled(problem, fitted, vocabulary, visits, noise)
    asked = estimate_noise(fitted.residual, fitted.jacobian.shape[2], visits, problem.order())
    starts = [normal_noise(fitted.residual)]
    starts += [replace(asked, wandering=None)] if asked.family != "gauss" else []
    starts += [asked] if asked.wandering is not None else []
    found = [f for f in (_settled(problem, fitted, vocabulary, visits, start) for start in starts)
             if f is not None]
    return max(found, key=lambda f: f.score) if found else None


def _settled(problem: Problem, fitted: Fitted, vocabulary: Vocabulary, visits: np.ndarray,
             noise: NoiseModel) -> _Found | None:
    """Search and noise in turn, until neither changes; None where it asks for too many causes at once."""
    share = problem.correlation_factor(fitted)
    for _ in range(_NOISE_PASSES):
        picture = Picture.of(vocabulary, fitted.residual, fitted.jacobian, noise, share)
        found = _Found(picture, *search(picture, MOST_AT_ONCE + 1), noise, 0.0, fitted.residual)
        members = found.members
        if len(members.blocks) > MOST_AT_ONCE:
            return None
        residual = fitted.residual - _prediction(picture, members, fitted, noise)
        lost = fitted.jacobian.shape[2] + sum(found.block(i).columns for i in members.blocks) * _COLUMN_COSTS
        before, noise = noise, estimate_noise(residual, lost, visits, problem.order())
        if _alike(before, noise):
            break
    return replace(found, noise=noise, left=residual, score=_score(found, fitted, residual, noise))


def _score(found: _Found, fitted: Fitted, left: np.ndarray, noise: NoiseModel) -> float:
    """Log of likelihood times priors of the best set and its noise, declared parameters integrated out
    (restricted likelihood): what two starts are compared by. left (N, m): residual with the set and the
    declared parameters at their best values."""
    picture, members = found.picture, found.members
    log_det, _ = picture.quadratic(members)
    standard = [value / (SCALES[scale] * found.block(i).size)
                for i, scale, value in zip(members.blocks, members.scales, picture.coefficients(members))]
    declared = orthonormal_columns(fitted.jacobian.reshape(-1,
                                                           fitted.jacobian.shape[2])).reshape(*left.shape, -1)
    white = noise.whiten(declared)
    score = log_likelihood_under(noise, left) - 0.5 * log_det - 0.5 * sum(float(b @ b) for b in standard)
    score += prior_of(picture, members) - 0.5 * float(np.linalg.slogdet(white.T @ white)[1])
    score -= 0.0 if noise.family == "gauss" else _LEAST_NATS
    # of its two parameters
    return score - (0.0 if noise.wandering is None else _LEAST_NATS + np.log(len(left)))


def _alike(one: NoiseModel, other: NoiseModel) -> bool:
    """Whether two noise models weigh the rows alike, so that a search under either finds the same."""
    apart = np.sqrt(one.weight)[:, None] / one.sigma / (np.sqrt(other.weight)[:, None] / other.sigma + 1e-300)
    kept = one.family == other.family and abs(one.shared - other.shared) < 0.2 and one.wanders_like(other)
    return kept and float(np.max(np.abs(apart - 1.0))) < _SAME_SCALE


def _prediction(picture: Picture, members: Members, fitted: Fitted, noise: NoiseModel) -> np.ndarray:
    """(N, m) what the set and the declared parameters, moved along, take from the residual (linear
    picture)."""
    responses = picture.vocabulary.responses
    taken = np.zeros_like(fitted.residual)
    for index, value in zip(members.blocks, picture.coefficients(members)):
        taken += responses[:, :, picture.vocabulary.blocks[index].where] @ value
    left = fitted.residual - taken
    design, right = noise.whiten(fitted.jacobian), noise.whiten(left[:, :, None])[:, 0]
    norm = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    step = np.linalg.lstsq(design / norm, right, rcond=1e-10)[0] / norm
    return taken + fitted.jacobian @ step


def _places(found: _Found, turn: int) -> list[Place]:
    """The named members of the best set, each with its probability and its rivals."""
    members, inclusion = found.members, found.posterior.inclusion()
    whole = weight_of(found.picture, members)
    places = []
    for k, (index, value) in enumerate(zip(members.blocks, found.picture.coefficients(members))):
        block = found.block(index)
        if block.effect is None:
            continue
        rest = Members(members.blocks[:k] + members.blocks[k + 1 :],
                       members.scales[:k] + members.scales[k + 1 :])
        log_odds = whole - weight_of(found.picture, rest)
        if k < len(found.certain.blocks):
            places.append(Place(block.label, at_values(block, value), 1.0 - np.exp(-CERTAIN), log_odds, (),
                                turn))
            continue
        others = list(found.posterior.best)
        others.remove(block.label)
        field = _slot(found.posterior, tuple(others))
        total = np.logaddexp.reduce([weight for _, weight in field])
        rivals = sorted(((label, weight) for label, weight in field if label not in (None, block.label)),
                        key=lambda e: -e[1])
        named = tuple((label, _effect_at(found, others, label), float(np.exp(weight - total)))
                      for label, weight in rivals[:8])
        places.append(Place(block.label, at_values(block, value), min(inclusion[block.label], 1.0), log_odds,
                            named, turn))
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


def _effect_at(found: _Found, others: list[str], label: str) -> Effect | None:
    """The rival in the best set's place, at its values; None for an unknown function or where it was never
    worked out."""
    members = found.posterior.members.get(tuple(sorted([*others, label])))
    if members is None:
        return None
    members = Members(found.certain.blocks + members.blocks, found.certain.scales + members.scales)
    for index, value in zip(members.blocks, found.picture.coefficients(members)):
        if found.block(index).label == label and found.block(index).effect is not None:
            return at_values(found.block(index), value)
    return None


def _one_each(places: list[Place]) -> list[Place]:
    """The surest of each label: an order between two points of the grid shows at both, until the joint fit
    has moved it."""
    found: dict[str, Place] = {}
    for place in places:
        found.setdefault(place.label, place)
    return list(found.values())


def _holding(found: _Found, places: list[Place], folds: np.ndarray) -> list[Place]:
    """Those that lower the held-out square sum of a cross-validation over whole poses or runs, beside all
    others that do.

    Evidence trusts its noise model; what only fits its own rows does not pass here, whatever the noise is.
    """
    places = list(places)
    while places:
        members = _only(found, tuple(p.label for p in places))
        whole = found.picture.held_out(members, folds).sum()
        without = {}
        for k in range(len(places)):
            rest = tuple(p.label for i, p in enumerate(places) if i != k)
            without[k] = found.picture.held_out(_only(found, rest), folds).sum()
        worst = min(without, key=lambda k: without[k])
        if without[worst] > whole:
            return places
        del places[worst]
    return places


def _confirmed(problem, declared, chosen, fitted, found: _Found, places: list[Place]):
    """The joint non-linear fit with the new effects; the weakest is left out while less than half of the gain
    comes true."""
    while places:
        effects = [*chosen, *(place.effect for place in places)]
        trial = refit(problem, declared, effects, fitted, found.noise)
        before, after = _weighted_square(found.noise,
                                         fitted.residual), _weighted_square(found.noise, trial.residual)
        functions, labels = _only(found, ()), tuple(p.label for p in places)
        promised = found.picture.quadratic(functions)[1] - found.picture.quadratic(_only(found, labels))[1]
        if before - after >= _CONFIRMED * promised:
            return places, trial
        places = places[:-1]
    return [], fitted


def _only(found: _Found, labels: tuple[str, ...]) -> Members:
    """The members of the best set with these labels, and its unknown functions."""
    members, open_labels, blocks = found.members, list(labels), found.picture.vocabulary.blocks
    kept = []
    for i, s in zip(members.blocks, members.scales):
        if blocks[i].unknown is not None:
            kept.append((i, s))
        elif blocks[i].label in open_labels:
            open_labels.remove(blocks[i].label)
            kept.append((i, s))
    return Members(tuple(i for i, _ in kept), tuple(s for _, s in kept))


def _weighted_square(noise: NoiseModel, residual: np.ndarray) -> float:
    white = noise.whiten(residual[:, :, None])
    return float(np.sum(white**2))
