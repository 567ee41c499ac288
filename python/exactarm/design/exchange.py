"""Exchange: chooses K out of many possible experiments by the information that they bring.

Experiment c has the block B_c (r, m) of the Jacobian; a set S has the information M = sum_{c in S} B_c' B_c.
One step (extended DETMAX: Mitchell 1974; thesis 3.2.2): of randomly drawn candidates those that raise the
criterion `keep` are admitted, the one of them that raises the criterion `add` most is added, and the member
that `keep` misses least is removed. A tabu list (Daney, Papegay and Madeline 2005) bars what was just removed
from coming back and what was just added from leaving, so the search may pass through worse sets; the best is
returned. Information that is there already (earlier measurements) enters as `prior` (m, m).
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from exactarm.design.criterion import (
    Criterion,
    LogDeterminant,
    SmallestOverLargest,
    information_of,
    is_regular,
)
from exactarm.errors import ComputationError


@dataclass(frozen=True)
class ExchangeOptions:
    """candidates drawn a step; tenure: steps on the tabu list, a quarter of the set at most; the search ends
    when `patience` steps together raise `keep` by less than `threshold`, or after `most_steps`."""

    candidates: int = 200
    tenure: int = 5
    patience: int = 20
    threshold: float = 0.05
    most_steps: int = 300
    keep: Criterion = LogDeterminant()
    add: Criterion = SmallestOverLargest()


@dataclass(frozen=True)
class Exchanged:
    """chosen (K,) indices into the pool; value of `keep` for them; history (steps + 1,) of the best value so
    far."""

    chosen: np.ndarray
    value: float
    history: np.ndarray


def exchange(pool: np.ndarray, start: np.ndarray, rng: np.random.Generator,
             options: ExchangeOptions = ExchangeOptions(), prior: np.ndarray | None = None) -> Exchanged:
    """The best set found from the set `start` (K,) of indices into the blocks `pool` (C, r, m).

    Raises ComputationError where the start is singular: it cannot identify all parameters.
    """
    chosen = list(start)
    known = np.zeros((pool.shape[-1],) * 2) if prior is None else prior
    least = options.keep.least_gain(len(chosen), pool.shape[-1]) if prior is None else 0.0
    information = known + information_of(pool[chosen])
    value = options.keep.value(information)
    if not (np.isfinite(value) and is_regular(information)):
        raise ComputationError(f"a set of {len(chosen)} experiments cannot identify {pool.shape[-1]} "
                               "parameters")
    best, history = (value, np.array(chosen)), [value]
    # in a small set the list must leave members to choose from
    tenure = min(options.tenure, len(chosen) // 4)
    barred: deque[int] = deque(maxlen=2 * tenure)
    draw = _Draw(len(pool), options.candidates, rng)
    for step in range(options.most_steps):
        information = known + information_of(pool[chosen])
        added = _addition(pool, information, draw.next(set(chosen) | set(barred)), options, least)
        if added is not None:
            barred.append(added)
            chosen.append(added)
            removed = _removal(pool, chosen, known + information_of(pool[chosen]), barred, options.keep)
            barred.append(chosen.pop(removed))
            value = options.keep.value(known + information_of(pool[chosen]))
            if value > best[0]:
                best = (value, np.array(chosen))
        history.append(best[0])
        if step >= options.patience and best[0] - history[-1 - options.patience] < options.threshold:
            break
    return Exchanged(best[1], best[0], np.array(history))


def _addition(pool, information, candidates: np.ndarray, options: ExchangeOptions,
              least: float) -> int | None:
    """The candidate that raises `add` most among those that raise `keep` by more than `least`."""
    admitted = candidates[options.keep.gains(information, pool[candidates]) > least]
    if admitted.size == 0:
        return None
    return int(admitted[np.argmax(options.add.gains(information, pool[admitted]))])


def _removal(pool, chosen: list[int], information, barred: deque, keep: Criterion) -> int:
    """Position of the member that `keep` misses least; one on the tabu list only when all are."""
    losses = keep.losses(information, pool[chosen])
    protected = np.isin(chosen, list(barred))
    if not protected.all():
        losses = np.where(protected, -np.inf, losses)
    if np.isfinite(losses).any():
        return int(np.argmax(losses))
    return len(chosen) - 1  # every removal but the newcomer's leaves a singular set


class _Draw:
    """Draws the pool through in random order, again and again."""

    def __init__(self, size: int, count: int, rng: np.random.Generator):
        self._size, self._count, self._rng, self._left = size, count, rng, np.zeros(0, int)

    def next(self, without: set[int]) -> np.ndarray:
        """(<= count,) indices, none of them in `without`."""
        if len(self._left) < self._count:
            self._left = np.concatenate([self._left, self._rng.permutation(self._size)])
        drawn, self._left = self._left[: self._count], self._left[self._count :]
        return drawn[~np.isin(drawn, list(without))]
