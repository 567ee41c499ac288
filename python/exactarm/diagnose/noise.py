"""Noise floor: what no model can explain, in the measure of the errors (Euclidean for poses).

From repeated visits where there are enough, with the rounding of the angles that repeats hide (readings
without a move between them are one visit: they show the device, not how well the arm comes back); else from
close neighbours in joint space (the residual of poses that nearly coincide can differ by noise only: half the
mean square of the differences, Rice 1984); else from the final fit, which is then an upper bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # scipy.spatial is imported at its first use

from exactarm.data.kinds import kind_of
from exactarm.diagnose.decisions import FEW, ROUNDING, SURE
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.identify.wild_rows import single_wild

_CLOSE_RAD = 0.02
_LEAST_PAIRS = 20
_ROUNDING_SHARE = 0.1  # of the floor from repeats: less changes it by half a per cent


@dataclass(frozen=True)
class NoiseFloor:
    """value in the unit of the errors; `measured` False: an upper bound from the fit itself."""

    value: float
    source: str
    measured: bool


def noise_floor(problem: Problem, final: Fitted) -> NoiseFloor:
    """The best estimate that the data allow."""
    unit = problem.error_of_unit_noise(final)
    repeats = problem.repeat_noise(final)
    if repeats is not None and repeats < ROUNDING:  # one measurement, written twice: it shows no scatter
        unit *= float(np.sqrt(1.0 + getattr(final.noise, "shared", 0.0)))
    elif repeats is not None:
        # A model of many terms may follow the repeats a little closer than their own scatter.
        value, known = min(repeats, 1.0) * unit, problem.rounding()
        rounding = 0.0 if known is None else float(np.sqrt(np.sum(known[:, :3] ** 2) / len(known)))
        also = " and the rounding of the reported angles" if rounding > _ROUNDING_SHARE * value else ""
        return NoiseFloor(float(np.hypot(value, rounding)), problem.repeat_source + also, True)
    close = neighbour_noise(problem, final)
    if close is not None and close < 1.0:
        return NoiseFloor(close * unit, "differences between neighbouring poses", True)
    readings = problem.reading_noise(final) if kind_of(problem.kind).target_at_rest else None
    beside = (f"; readings without a move between them scatter by {1e6 * readings * unit:.3g} µm"
              if readings is not None else "")
    error = np.linalg.norm(final.residual[final.weight > 0.0, :3], axis=1)
    if kind_of(problem.kind).target_at_rest and (wild := single_wild(error)).any():
        unit *= float(np.sqrt(np.mean(error[~wild] ** 2) / np.mean(error**2)))
        beside = f"; without {wild.sum()} row{'s' * int(wild.sum() > 1)} far beside the others{beside}"
    return NoiseFloor(unit, f"scatter that the final model leaves (an upper bound){beside}", False)


def neighbour_noise(problem: Problem, fitted: Fitted) -> float | None:
    """Standard deviation of a whitened residual from pairs of rows closer than 0.02 rad in all joints."""
    if not kind_of(problem.kind).target_at_rest:
        return None
    keys = np.column_stack([fitted.view.q, 10.0 * problem.data.session])
    distance, index = scipy.spatial.cKDTree(keys).query(keys, k=2)
    close = (distance[:, 1] > 1e-9) & (distance[:, 1] < _CLOSE_RAD)
    if close.sum() < _LEAST_PAIRS:
        return None
    rows = fitted.residual / fitted.sigma
    difference = rows[close] - rows[index[close, 1]]
    return float(np.sqrt(0.5 * np.mean(difference**2)))


def repeat_scatter(white: np.ndarray, group: np.ndarray) -> float:
    """Standard deviation within groups of rows (N, 3) that repeat each other, of which at least one has two.

    Groups with a gross error in them are left out: a broken beam in one of two visits is no noise of the
    device, and counted as such it would hide itself and every cause beneath.
    """
    _, group, counts = np.unique(group, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(group, white[:, k]) / counts for k in range(3)], axis=1)
    inside = (white - means[group]) * np.sqrt(counts / np.maximum(counts - 1, 1))[group, None]
    repeated = counts > 1
    spread = 1.4826 * np.median(np.abs(inside[repeated[group]]))
    worst = np.zeros(len(counts))
    np.maximum.at(worst, group, np.max(np.abs(inside), axis=1))
    gross = repeated & (worst > SURE * spread)
    # where more of them scatter so, it is noise
    chosen = repeated & ~gross if gross.sum() <= FEW * repeated.sum() else repeated
    squares = np.sum((white - means[group])[chosen[group]] ** 2)
    return float(np.sqrt(squares / (3.0 * (counts[chosen] - 1).sum())))
