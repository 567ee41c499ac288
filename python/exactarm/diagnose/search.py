"""Search: posterior probabilities of sets of causes, best first with add, drop and swap (Hans, Dobra and West
2007).

A state is a set of causes with the best grid point and scale of each. Expanding it scores the set with every
further block, and without each of its members. Weights of label sets are summed over grid points and scales
of the cause that came last:

    log w(M) = log p(r | M) + log p(K) + log K! + sum of the blocks' log priors,

p(K) a geometric law whose first step has odds of its own: p(1) = FIRST p(0), p(K + 1) = FURTHER p(K).
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

import numpy as np
from scipy import special

from exactarm.diagnose.decisions import CERTAIN
from exactarm.diagnose.evidence import Members, Picture
from exactarm.diagnose.vocabulary import SCALE_WEIGHTS

# Odds of one cause against none, and of one more beside what has been found. With 0.6 for both, of 15
# statements between 0.5 and 0.98 on blind poses (bench/blind, 91400 to 91552) four were right, 0.78 stated;
# of the eleven others nine stood beside a right one.
FIRST, FURTHER = 0.6, 0.2
_KEPT_NATS = 9.0  # below the best set: 1 in 8,000
# sets looked around, and sets scored with every further cause: more changed no marks
_EXPANSIONS, _SCORED = 24, 60
_CHILDREN = 6


@dataclass
class Posterior:
    """Log weights of the sets of labels that were scored; `best`: the members of the heaviest one."""

    weights: dict[tuple[str, ...], float] = field(default_factory=dict)
    members: dict[tuple[str, ...], Members] = field(default_factory=dict)

    def record(self, labels: tuple[str, ...], weight: float, members: Members | None) -> None:
        if weight > self.weights.get(labels, -np.inf):
            self.weights[labels] = weight
            if members is not None:
                self.members[labels] = members

    @property
    def best(self) -> tuple[str, ...]:
        return max(self.members, key=lambda labels: self.weights[labels])

    def total(self) -> float:
        return float(special.logsumexp(list(self.weights.values())))

    def inclusion(self) -> dict[str, float]:
        """Label -> posterior probability that it is one of the causes."""
        total, found = self.total(), {}
        for labels, weight in self.weights.items():
            for label in set(labels):
                found[label] = found.get(label, 0.0) + np.exp(weight - total)
        return found

    def probability(self, holds) -> float:
        """Sum over all label sets for which `holds(labels)`."""
        total = self.total()
        found = sum(np.exp(weight - total) for labels, weight in self.weights.items() if holds(labels))
        return min(float(found), 1.0)  # rounding


def log_prior_of_count(count: int, known: int = 0) -> float:
    """log p(K) + log K! of causes beside `known` ones."""
    first = min(count, 1) * np.log(FIRST / FURTHER) - np.log1p(FIRST / (1.0 - FURTHER))
    law = np.log1p(-FURTHER) if known else first
    return float(law + count * np.log(FURTHER) + special.gammaln(count + 1))


def search(picture: Picture, most: int) -> tuple[Members, Posterior]:
    """Causes that are certain, one after another, and the posterior over all that could act beside them.

    A cause is certain where every other one that explains the same (its weight falls by half beside it) is
    `CERTAIN` nats less likely: it then becomes part of the noise, and the sets stay small.
    """
    certain, at = Members((), ()), picture
    scored = _scored(at)
    while scored and scored[0][0] > CERTAIN and len(certain.blocks) < most:
        value, label, index, scale = scored[0]
        beyond = at.beside(Members((index,), (scale,)))
        after = _scored(beyond)
        left = {name: weight for weight, name, *_ in after}
        rivals = [weight for weight, name, *_ in scored[1:]
                  if weight > 0.0 and left.get(name, 0.0) < 0.5 * weight]
        if max(rivals, default=-np.inf) > value - CERTAIN:
            break
        certain = Members((*certain.blocks, index), (*certain.scales, scale))
        richer = _richer(picture, certain)
        if richer is not None:  # the others are worked out anew beside it
            certain = richer
            beyond = picture.beside(certain)
            after = _scored(beyond)
        at, scored = beyond, after
    start, tried = Members((), ()), set()
    while True:
        posterior = _Search(at, max(most - len(certain.blocks), 0)).run(start)
        found = posterior.members[posterior.best]
        richer = _richer(picture, Members(certain.blocks + found.blocks, certain.scales + found.scales))
        if richer is None or richer in tried:
            return certain, posterior
        tried.add(richer)
        kept = [k for k, block in enumerate(richer.blocks) if block in certain.blocks]
        certain, start = _parted(richer, kept)
        at = picture.beside(certain) if kept else picture


def _parted(members: Members, kept: list[int]) -> tuple[Members, Members]:
    """The members at some places, and the others."""
    others = [k for k in range(len(members.blocks)) if k not in kept]
    take = lambda places: Members(tuple(members.blocks[k] for k in places),
                                  tuple(members.scales[k] for k in places))
    return take(kept), take(others)


def _richer(picture: Picture, members: Members) -> Members | None:
    """The set with one form that includes members of it, or does what they do together, in their place, where
    it is heavier so; None where it is not."""
    vocabulary, found, heaviest = picture.vocabulary, None, weight_of(picture, members)
    richer = {form for i in members.blocks for of in (vocabulary.richer_than, vocabulary.wholes_of)
              for form in of(i)}
    for form in sorted(richer - picture.closed):
        kept = vocabulary.not_in(form, members.blocks)
        for scale in range(len(SCALE_WEIGHTS)):
            trial = Members((*(members.blocks[k] for k in kept), form),
                            (*(members.scales[k] for k in kept), scale))
            weight = weight_of(picture, trial)
            if weight > heaviest:
                found, heaviest = trial, weight
    return found


def _scored(picture: Picture) -> list[tuple[float, str, int, int]]:
    """(log weight beside nothing more, label, block, scale), the heaviest first."""
    return _Search(picture, 1).children(Members((), ()))


def weight_of(picture: Picture, members: Members) -> float:
    """log w of one set at its grid points and scales."""
    return picture.log_likelihood(members) + prior_of(picture, members)


def prior_of(picture: Picture, members: Members) -> float:
    """log prior of one set at its grid points and scales."""
    prior = sum(picture.log_prior[i] + np.log(SCALE_WEIGHTS[s])
                for i, s in zip(members.blocks, members.scales))
    return float(prior) + log_prior_of_count(len(members.blocks), picture.known)


def labels_of(picture: Picture, members: Members) -> tuple[str, ...]:
    return tuple(sorted(picture.vocabulary.blocks[i].label for i in members.blocks))


class _Search:
    """One search: its queue, and what every set that was looked at would be with one cause more."""

    def __init__(self, picture: Picture, most: int):
        self.picture, self.most = picture, most
        self.posterior = Posterior()
        self.queue: list = []
        self.pushed = 0
        self.looked_at: dict[Members, tuple] = {}

    def run(self, start: Members) -> Posterior:
        for members in dict.fromkeys((Members((), ()), start)):
            labels = labels_of(self.picture, members)
            self._offer(labels, weight_of(self.picture, members), members)
        expanded: set = set()
        while self.queue and len(expanded) < _EXPANSIONS and len(self.looked_at) < _SCORED:
            negative, _, labels = heapq.heappop(self.queue)
            if labels in expanded or -negative < self.posterior.weights[self.posterior.best] - _KEPT_NATS:
                continue
            expanded.add(labels)
            self._expand(labels)
        if self.posterior.best not in expanded:
            self._expand(self.posterior.best)
        return self.posterior

    def _offer(self, labels: tuple[str, ...], weight: float, members: Members | None) -> None:
        better = weight > self.posterior.weights.get(labels, -np.inf) + 1e-9
        self.posterior.record(labels, weight, members)
        if better and members is not None:
            self.pushed += 1
            heapq.heappush(self.queue, (-weight, self.pushed, labels))

    def _expand(self, labels: tuple[str, ...]) -> None:
        """All sets with one cause more, one less, or one exchanged."""
        members, base = self.posterior.members[labels], self.posterior.weights[labels]
        if len(members.blocks) < self.most:
            self._grow(members, base)
        for place in range(len(members.blocks)):
            fewer = Members(members.blocks[:place] + members.blocks[place + 1 :],
                            members.scales[:place] + members.scales[place + 1 :])
            weight = weight_of(self.picture, fewer)
            self._offer(labels_of(self.picture, fewer), weight, fewer)
            self._grow(fewer, weight)
        for fewer in self._without_families(members):
            self._grow(fewer, weight_of(self.picture, fewer))

    def _without_families(self, members: Members) -> list[Members]:
        """The set without all of its members of one family on one axis, or without all parts of one whole, so
        that one form may take their place."""
        vocabulary = self.picture.vocabulary
        blocks = vocabulary.blocks
        effects = [blocks[i].effect for i in members.blocks]
        families = [(e.family, e.joint) if e is not None and e.family else None for e in effects]
        kept = [[k for k, own in enumerate(families) if own != family]
                for family in {f for f in families if f is not None and families.count(f) > 1}]
        wholes = sorted({form for i in members.blocks for form in vocabulary.wholes_of(i)})
        kept += [others for others in (vocabulary.not_in(form, members.blocks) for form in wholes)
                 if len(others) < len(members.blocks) - 1]
        return [Members(tuple(members.blocks[k] for k in each), tuple(members.scales[k] for k in each))
                for each in kept]

    def _grow(self, members: Members, base: float) -> None:
        """The set with every further cause: weights summed over the blocks of a label; members for the best
        few labels."""
        first = members not in self.looked_at
        if first:
            self.looked_at[members] = (labels_of(self.picture, members), self.children(members), -np.inf)
        if not first and base <= self.looked_at[members][2]:
            return
        own, children, _ = self.looked_at[members]
        self.looked_at[members] = (own, children, base)
        count, known = len(own), self.picture.known
        base = base + log_prior_of_count(count + 1, known) - log_prior_of_count(count, known)
        least = self.posterior.weights[self.posterior.best] - CERTAIN  # lighter ones count for nothing
        for rank, (value, label, index, scale) in enumerate(children):
            if base + value < least and rank >= _CHILDREN:
                break
            grown = Members((*members.blocks, index), (*members.scales, scale)) if rank < _CHILDREN else None
            self._offer(tuple(sorted((*own, label))), base + value, grown)

    def children(self, members: Members) -> list[tuple[float, str, int, int]]:
        """(log weight over that of the set, label, best block, its scale) of every further cause, the
        heaviest first."""
        additions = self.picture.additions(members)
        blocks = self.picture.vocabulary.blocks
        weight = additions.log_weight.copy()
        taken = {blocks[i].label for i in members.blocks}
        for index in members.blocks:
            weight[list(self.picture.vocabulary.forms_of(index))] = -np.inf
        names, label_of = self.picture.vocabulary.labels
        for label in taken - self.picture.vocabulary.repeatable:
            weight[label_of == names.index(label)] = -np.inf
        top = np.full(len(names), -np.inf)
        np.maximum.at(top, label_of, weight)
        finite = np.isfinite(top)
        total = np.zeros(len(names))
        np.add.at(total, label_of,
                  np.exp(np.where(np.isfinite(weight),
                                  weight - np.where(finite, top, 0.0)[label_of], -np.inf)))
        with np.errstate(divide="ignore"):
            value = np.where(finite, top + np.log(total), -np.inf)
        by_weight = np.argsort(-weight, kind="stable")
        best = by_weight[np.unique(label_of[by_weight], return_index=True)[1]]  # the first of each label
        order = [k for k in np.argsort(-value, kind="stable") if finite[k]]
        return [(float(value[k]), names[k], int(best[k]), int(additions.scale[best[k]])) for k in order]
