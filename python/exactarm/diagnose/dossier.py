"""Dossier of a residual: which signals it follows beyond chance, whatever the library holds.

Every signal (angles, loads, directions, time, covariates ...) is cut into bins of equal count, or taken by
its few values; the whitened residual is regressed on the bins along every direction in which something could
move (joint axes, measured components), with the declared parameters projected out. F-tests; the same on the
columns of surfaces in several signals; and whether rows that lie close together in a space err alike
(smoothness.py). The smallest p-value is multiplied by the number of tests (Bonferroni).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from exactarm.diagnose.decisions import ABSORBED, LEVELS, REMOTE
from exactarm.diagnose.fitted import Fitted, Products
from exactarm.diagnose.joint_fit import count_of
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.signal import Direction, Signal
from exactarm.diagnose.smoothness import closeness, follows_space
from exactarm.numerics.orthonormal import orthonormal

_NUMBERS_IN_SPACE = 750  # more would take long, and not make a structure plainer
_NEAR = 1.0  # spreads of the points: closer rows might err alike
# Against causes that have names; chosen, not derived: between 1.9e-4, where nothing lacks
# (test_payload_step.py, springs alone, seed 10: 1e-3 was too large), and 1e-11, where something does
# (test_backlash.py, seed 2).
_AGAINST_NAMES = 1e-6


@dataclass(frozen=True)
class Follows:
    """The residual along `direction` follows `signal`: share of the square sum, corrected p-value."""

    signal: Signal
    direction: Direction
    share: float
    p_value: float

    @property
    def significant(self) -> bool:
        return self.p_value < REMOTE


@dataclass(frozen=True)
class Dossier:
    """All signals, the one that is followed best first; lag-1 autocorrelation in the order of the rows."""

    follows: tuple[Follows, ...]
    autocorrelation: float

    @property
    def structure(self) -> bool:
        return bool(self.follows) and self.follows[0].significant

    @property
    def of_posture(self) -> bool:
        """Whether it follows where the arm stands, far beyond chance; noise shared in time does not."""
        return any(each.p_value < _AGAINST_NAMES and each.signal.of_posture for each in self.follows)

    @property
    def strongest(self) -> Follows | None:
        return self.follows[0] if self.follows else None


def dossier(problem: Problem, fitted: Fitted) -> Dossier:
    """Tests every signal of the problem along every direction of it; keeps the best direction of each
    signal."""
    residual = fitted.whitened
    numbers, freedom = fitted.data_numbers, count_of(problem, fitted)
    square = float(residual[:numbers] @ residual[:numbers])
    signals, directions = problem.signals(fitted), problem.directions(fitted)
    columns = {signal: indicator(values) for signal, values in signals.items()} | problem.surfaces(fitted)
    tests = len(columns) * len(directions) + 1
    found, along = _over_space(problem, fitted, tests), [fitted.along(each) for each in directions.values()]
    for signal, bins in columns.items():
        if bins.shape[1] < 2:
            continue
        entries = [_test(products_of(bins), square, freedom, problem.memory_along(fitted, bins, direction))
                   for products_of, direction in zip(along, directions.values())]
        (p, share), name = min(zip(entries, directions), key=lambda each: (each[0][0], -each[0][1]))
        found.append(Follows(signal, name, share, min(1.0, p * tests)))
    order = sorted(found, key=lambda f: (f.p_value, -f.share))
    return Dossier(tuple(order), _lag_one(fitted))


def indicator(values: np.ndarray) -> np.ndarray:
    """(N, b) membership of bins of equal count; few distinct values have a bin each."""
    distinct = np.unique(values)
    if len(distinct) <= LEVELS:
        return (values[:, None] == distinct).astype(float)
    edges = np.quantile(values, np.linspace(0.0, 1.0, LEVELS + 1)[1:-1])
    return (np.searchsorted(edges, values)[:, None] == np.arange(LEVELS)).astype(float)


def _test(products: Products, square: float, freedom: float, memory: float) -> tuple[float, float]:
    """p-value and share of the square sum of the residual that these columns explain; memory: how many times
    more of it than of white noise falls on them by chance."""
    values, vectors = np.linalg.eigh(products.normal)
    keep = values > ABSORBED * max(float(np.max(products.square, initial=0.0)), 1e-300)
    rank = int(keep.sum())
    if rank == 0 or freedom <= rank + 1:
        return 1.0, 0.0
    explained = float(np.sum((vectors[:, keep].T @ products.onto) ** 2 / values[keep]))
    # Correlated samples count as fewer: the same shares with the effective number of them.
    f = (explained / rank) / max((square - explained) / (freedom - rank), 1e-300) / memory
    return float(special.fdtrc(rank, freedom - rank, f)), explained / square


def _over_space(problem: Problem, fitted: Fitted, tests: int) -> list[Follows]:
    """Whether the position error varies smoothly over the problem's space; empty where it has none."""
    space = problem.space(fitted)
    if space is None:
        return []
    name, points = space
    used = problem.independent_rows(fitted)
    rows = used[:: max(1, -(-3 * used.size // _NUMBERS_IN_SPACE))]
    pick = lambda values: values[: fitted.data_numbers].reshape(*fitted.residual.shape, -1)[rows, :3]
    basis = orthonormal(pick(fitted.determined).reshape(3 * rows.size, -1))
    residual = pick(fitted.whitened).reshape(-1)
    residual = (residual - basis @ (basis.T @ residual)).reshape(-1, 3)
    axes = [np.tile(np.eye(3)[k], (rows.size, 1)) * fitted.scale[rows, :3] for k in range(3)]
    kernel = closeness(points[rows], _NEAR) * problem.apart(rows)
    p_value, share = follows_space(residual, basis, axes, kernel)
    return [Follows(name, Direction("the device's axes", of_tracker=True), share, min(1.0, p_value * tests))]


def _lag_one(fitted: Fitted) -> float:
    rows = fitted.residual / fitted.sigma
    return float(
        np.mean(np.sum(rows[1:] * rows[:-1], axis=1)) / max(np.mean(np.sum(rows**2, axis=1)), 1e-300))
