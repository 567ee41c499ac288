"""Self-test: how the search behaves on data like the user's: same design, same noise, causes that are known.

    false alarms  residuals e_i s_v, e_i what the final model leaves, s_v = +-1 at random for each pose (wild
                  signs; Wu 1986): the share of draws in which the posterior odds for one cause or more are
                      above one
    sets          one cause planted at its plausible size, likewise with wild noise: the share of draws in
                  which the set of causes that holds 95 % of the posterior of one cause has the planted one in
                      it, of those in which a cause was named

Everything is linear in the residual, so the sums over each block of rows give all draws.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from exactarm.diagnose.decisions import CLEAR, CREDIBLE, DRAWS, INVISIBLE
from exactarm.diagnose.evidence import Picture
from exactarm.diagnose.search import log_prior_of_count
from exactarm.diagnose.vocabulary import SCALE_WEIGHTS, SCALES

_PLANTED = 200
_CAUSES = 20  # planted in turn: the ones that this design shows best
_STRIP = 512  # columns worked on at once


@dataclass(frozen=True)
class SelfTest:
    """false_alarms of draws; sets: how many draws with a planted cause were named, share_right of their 95 %
    sets that hold it."""

    false_alarms: float
    draws: int
    sets: int
    share_right: float | None


def self_test(picture: Picture, residual: np.ndarray, visits: np.ndarray, seed: int) -> SelfTest:
    """picture: at the declared model; residual (R,) whitened, what the final model leaves; visits (N,):
    poses, or blocks of a time series."""
    rng = np.random.default_rng(seed)
    parts = _Parts.of(picture, residual, visits)
    weights = _weights(picture, *parts.wild(DRAWS, rng))
    odds = special.logsumexp(weights, axis=0) + log_prior_of_count(1) - log_prior_of_count(0)
    sets, right = _planted(picture, parts, rng)
    return SelfTest(float(np.mean(odds > 0.0)), DRAWS, sets, right / sets if sets else None)


@dataclass(frozen=True)
class _Parts:
    """What each block of rows adds: onto (p, B) to C'e, declared (d, B) to Q'e; square of all of e."""

    onto: np.ndarray
    declared: np.ndarray
    square: float

    @staticmethod
    def of(picture: Picture, residual: np.ndarray, visits: np.ndarray) -> _Parts:
        names = np.unique(visits, return_inverse=True)[1]
        block = np.repeat(names, len(residual) // len(visits))
        order = np.argsort(block, kind="stable")
        starts = np.searchsorted(block[order], np.arange(names.max() + 1))
        columns, absorbed = picture.columns, picture.absorbed
        add = lambda matrix: np.add.reduceat(matrix[order] * residual[order, None], starts, axis=0).T
        strips = [add(columns[:, at : at + _STRIP]) for at in range(0, columns.shape[1], _STRIP)]
        declared = add(absorbed.basis[: absorbed.measured])
        onto = np.concatenate(strips) - picture.crossed.T @ declared if strips else np.zeros((0, len(starts)))
        return _Parts(onto, declared, float(residual @ residual))

    def wild(self, draws: int, rng) -> tuple[np.ndarray, np.ndarray]:
        """C'w (p, draws) and w'w (draws,) of residuals w with random signs by block, cleared of what the
        declared parameters absorb."""
        signs = rng.choice([-1.0, 1.0], (self.onto.shape[1], draws))
        return self.onto @ signs, self.square - np.sum((self.declared @ signs) ** 2, axis=0)


def _weights(picture: Picture, onto: np.ndarray, square: np.ndarray) -> np.ndarray:
    """(G, draws) log weight of every block alone beside nothing, for many residuals at once: onto (p, draws)
    and square (draws,)."""
    found = np.full((len(picture.vocabulary.blocks), len(square)), -np.inf)
    for k, indices in picture.by_width.items():
        which, size, gram = picture.stacked[k]
        values, vectors = np.linalg.eigh(gram * size[:, :, None] * size[:, None, :])
        values = np.maximum(values, 0.0)
        turned = np.einsum("gij,gid->gjd", vectors, onto[which] * size[:, :, None], optimize=True) ** 2
        total = np.full((len(indices), len(square)), -np.inf)
        for scale, weight in zip(SCALES, SCALE_WEIGHTS):
            shrink = scale**2 / (1.0 + scale**2 * values)
            gain = np.einsum("gk,gkd->gd", shrink, turned)
            log_bf = -0.5 * np.sum(np.log1p(scale**2 * values), axis=1)[:, None]
            log_bf = log_bf - 0.5 * picture.count * np.log(np.maximum(1.0 - gain / square, 1e-12))
            total = np.logaddexp(total, log_bf + np.log(weight))
        total[values[:, -1] < INVISIBLE**2] = -np.inf
        found[indices] = total + picture.log_prior[indices][:, None]
    return found


def _planted(picture: Picture, parts: _Parts, rng) -> tuple[int, int]:
    """How many draws with a planted cause were named, and how many of their sets hold it."""
    blocks = picture.vocabulary.blocks
    shown = {}
    for index, block in enumerate(blocks):
        if block.effect is not None:
            length = float(np.sqrt(picture.lengths[block.where] ** 2 @ block.size**2))
            if length > shown.get(block.label, (CLEAR, None))[0]:
                shown[block.label] = (length, index)
    chosen = [index for _, index in sorted(shown.values(), key=lambda e: -e[0])][:_CAUSES]
    if not chosen:
        return 0, 0
    onto, square = parts.wild(_PLANTED, rng)
    truth = [chosen[d % len(chosen)] for d in range(_PLANTED)]
    products = {index: picture.between(slice(None), blocks[index].where) for index in chosen}
    for d, index in enumerate(truth):
        block = blocks[index]
        size = rng.standard_normal(block.columns) * block.size
        planted = products[index] @ size
        square[d] += float((2.0 * onto[block.where, d] + planted[block.where]) @ size)
        onto[:, d] += planted
    weights = _weights(picture, onto, square)
    names, label_of = picture.vocabulary.labels
    sets = right = 0
    for d, index in enumerate(truth):
        by_label = np.full(len(names), -np.inf)
        np.logaddexp.at(by_label, label_of, weights[:, d])
        total = special.logsumexp(by_label)
        if total + log_prior_of_count(1) - log_prior_of_count(0) <= 0.0:
            continue
        order = np.argsort(-by_label, kind="stable")
        held = np.cumsum(np.exp(by_label[order] - total))
        members = order[: int(np.searchsorted(held, CREDIBLE)) + 1]
        sets += 1
        right += names.index(blocks[index].label) in members
    return sets, right
