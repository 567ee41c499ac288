"""Polish: moves the experiments of a set a little, each on its own, as long as the criterion rises.

The exchange picks from a finite pool; the optimum lies between its members. In every round each of the K
settings (joint angles of a pose) gets several neighbours within a spread that shrinks from round to round; a
swap is tried in the order of its predicted gain, and kept when it raises the criterion of the current set and
leaves a second criterion, the guard, no lower than it was at the start.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from exactarm.design.criterion import Criterion, information_of, squared


@dataclass(frozen=True)
class PolishOptions:
    """Rounds, neighbours of each setting in a round, spread of first and last round (part of the range)."""

    rounds: int = 16
    neighbours: int = 10
    first_spread: float = 0.3
    last_spread: float = 0.02


def polish(settings: np.ndarray, lower: np.ndarray, upper: np.ndarray,
           blocks_at: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], criterion: Criterion,
           guard: Criterion, rng: np.random.Generator,
           options: PolishOptions = PolishOptions()) -> np.ndarray:
    """The moved settings (K, n). `blocks_at(settings)` returns blocks (N, r, m) and which settings are
    allowed (N,)."""
    settings, count = settings.copy(), len(settings)
    blocks = blocks_at(settings)[0].copy()
    information = information_of(blocks)
    value, least = criterion.value(information), guard.value(information)
    for spread in np.geomspace(options.first_spread, options.last_spread,
                               max(options.rounds, 1))[: options.rounds]:
        owner = np.repeat(np.arange(count), options.neighbours)
        moved = settings[owner] + spread * (upper - lower) * _directions(rng, len(owner), settings.shape[1])
        moved = np.clip(moved, lower, upper)
        new, allowed = blocks_at(moved)
        promise = np.where(allowed, criterion.swaps(information, blocks[owner], new), -np.inf)
        best = promise.reshape(count, -1).argmax(axis=1) + np.arange(count) * options.neighbours
        for place in best[np.argsort(-promise[best], kind="stable")]:
            if promise[place] <= 0.0:
                break
            k = owner[place]
            swapped = information + squared(new[place]) - squared(blocks[k])
            raised = criterion.value(swapped)
            if raised > value and guard.value(swapped) >= least:
                settings[k], blocks[k] = moved[place], new[place]
                information, value = swapped, raised
    return settings


def _directions(rng: np.random.Generator, count: int, axes: int) -> np.ndarray:
    """(count, axes) normal steps, every second one along a few axes only: optima like to sit at limits."""
    steps = rng.normal(size=(count, axes))
    sparse = rng.random((count, axes)) < 0.4
    sparse[::2] = True
    return steps * sparse
