"""Self-test: how the search behaves on data like the user's: same design, same noise, causes that are known.

    false alarms  residuals e_i s_v, e_i what the final model leaves, s_v = +-1 at random for each pose (wild
                  signs; Wu 1986): the share of draws in which the posterior odds for one cause or more are
                      above one
    sets          one cause planted at its plausible size, likewise with wild noise: the share of draws in
                  which the set of causes that holds 95 % of the posterior of one cause has the planted one in
                      it, of those in which a cause was named

Everything is linear in the residual, so one product gives all draws.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from exactarm.diagnose.evidence import Picture
from exactarm.diagnose.search import log_prior_of_count
from exactarm.diagnose.vocabulary import SCALE_WEIGHTS, SCALES

DRAWS = 400
_PLANTED = 200
_CAUSES = 20  # planted in turn: the ones that this design shows best
# standard deviations by which a planted cause moves all rows together: less, and nobody names it
_LEAST_SHOWN = 4.0
_CREDIBLE = 0.95


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
    poses."""
    rng = np.random.default_rng(seed)
    wild = _wild(picture, residual, visits, DRAWS, rng)
    weights = _weights(picture, wild)
    odds = special.logsumexp(weights, axis=0) + log_prior_of_count(1) - log_prior_of_count(0)
    sets, right = _planted(picture, residual, visits, rng)
    return SelfTest(float(np.mean(odds > 0.0)), DRAWS, sets, right / sets if sets else None)


def _wild(picture: Picture, residual: np.ndarray, visits: np.ndarray, draws: int, rng) -> np.ndarray:
    """(R, draws) residuals with random signs by pose, cleared of what the declared parameters absorb."""
    numbers = len(residual) // len(visits)
    names = np.unique(visits, return_inverse=True)[1]
    signs = rng.choice([-1.0, 1.0], (names.max() + 1, draws))
    wild = residual[:, None] * np.repeat(signs[names], numbers, axis=0)
    return wild - picture.declared @ (picture.declared.T @ wild)


def _weights(picture: Picture, residuals: np.ndarray) -> np.ndarray:
    """(G, draws) log weight of every block alone beside nothing, for many residuals (R, draws) at once."""
    square = np.sum(residuals**2, axis=0)
    onto = picture.columns.T @ residuals
    found = np.full((len(picture.vocabulary.blocks), residuals.shape[1]), -np.inf)
    for k, indices in picture.by_width.items():
        which, size, gram = picture.stacked[k]
        values, vectors = np.linalg.eigh(gram * size[:, :, None] * size[:, None, :])
        values = np.maximum(values, 0.0)
        turned = np.einsum("gij,gid->gjd", vectors, onto[which] * size[:, :, None], optimize=True) ** 2
        total = np.full((len(indices), residuals.shape[1]), -np.inf)
        for scale, weight in zip(SCALES, SCALE_WEIGHTS):
            shrink = scale**2 / (1.0 + scale**2 * values)
            gain = np.einsum("gk,gkd->gd", shrink, turned)
            log_bf = -0.5 * np.sum(np.log1p(scale**2 * values), axis=1)[:, None]
            log_bf = log_bf - 0.5 * picture.count * np.log(np.maximum(1.0 - gain / square, 1e-12))
            total = np.logaddexp(total, log_bf + np.log(weight))
        total[values[:, -1] < 1e-6] = -np.inf
        found[indices] = total + picture.log_prior[indices][:, None]
    return found


def _planted(picture: Picture, residual: np.ndarray, visits: np.ndarray, rng) -> tuple[int, int]:
    """How many draws with a planted cause were named, and how many of their sets hold it."""
    blocks = picture.vocabulary.blocks
    shown = {}
    for index, block in enumerate(blocks):
        if block.effect is not None:
            length = float(np.linalg.norm(picture.columns[:, block.where] * block.size))
            if length > shown.get(block.label, (_LEAST_SHOWN, None))[0]:
                shown[block.label] = (length, index)
    chosen = [index for _, index in sorted(shown.values(), key=lambda e: -e[0])][:_CAUSES]
    if not chosen:
        return 0, 0
    wild = _wild(picture, residual, visits, _PLANTED, rng)
    truth = [chosen[d % len(chosen)] for d in range(_PLANTED)]
    for d, index in enumerate(truth):
        block = blocks[index]
        column = picture.columns[:, block.where] @ (rng.standard_normal(block.columns) * block.size)
        wild[:, d] += column
    weights = _weights(picture, wild)
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
        members = order[: int(np.searchsorted(held, _CREDIBLE)) + 1]
        sets += 1
        right += names.index(blocks[index].label) in members
    return sets, right
