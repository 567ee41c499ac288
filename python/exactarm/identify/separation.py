"""Separation: the experiments that part two explanations of the same data best.

Two models differ by a signal: the prediction of the one effect at its best values. Whatever the parameters that both
models share, and those of the other effect, can imitate of it over old and new experiments together does not
count. With whitened blocks (unit noise) whose LAST column is that signal and whose other columns are those
parameters, what is left of it is the Schur complement s of the last diagonal entry of M = sum B'B: the two models are
sqrt(s) standard deviations apart (T-optimality, Atkinson and Fedorov 1975, for models that are nested linearly).
The experiments are chosen by the exchange of the design of poses, with log s as its criterion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.identify.criterion import LogDeterminant, information_of
from exactarm.identify.exchange import ExchangeOptions, exchange

_RIDGE = 1e-9  # beside columns of unit length: keeps what no experiment shows from stopping the search


@dataclass(frozen=True)
class Separation:
    """chosen (K,) indices into the pool; standard deviations between the models before and with these experiments."""

    chosen: np.ndarray
    before: float
    after: float


def separating_set(pool: np.ndarray, known: np.ndarray, count: int, rng: np.random.Generator) -> Separation:
    """The `count` experiments of `pool` (C, r, m) that separate best; `known` (m, m): information of the old data."""
    seen = np.diag(known) + np.mean(np.sum(pool**2, axis=1), axis=0)
    scale = 1.0 / np.sqrt(np.where(seen > 0.0, seen, 1.0))
    scale[-1] = 1.0
    pool, known = pool * scale, known * np.outer(scale, scale)
    prior = known + _ridge(len(known))
    apart = _apart(len(known))
    options = ExchangeOptions(candidates=min(200, len(pool)), keep=apart, add=apart, threshold=1e-3)
    alone = np.argsort(-apart.gains(prior, pool), kind="stable")
    found = exchange(pool, alone[:count], rng, options, prior=prior)
    after = prior + information_of(pool[found.chosen])
    return Separation(found.chosen, *(float(np.exp(0.5 * apart.value(each))) for each in (prior, after)))


def separation_of(information: np.ndarray) -> float:
    """Standard deviations between the models at this information (m, m), the signal last."""
    size = np.diag(information)
    scale = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
    scale[-1] = 1.0
    regular = information * np.outer(scale, scale) + _ridge(len(scale))
    return float(np.exp(0.5 * _apart(len(scale)).value(regular)))


def _apart(size: int) -> LogDeterminant:
    return LogDeterminant(nuisance=tuple(range(size - 1)))


def _ridge(size: int) -> np.ndarray:
    return _RIDGE * np.eye(size)
