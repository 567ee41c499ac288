"""Rows of a gear run in which a gear still passes from one direction's table to the other's.

No model defines the passage, neither its course s(t) from 1 to 0 nor how long it lasts. In it the output
angle is off by s D, D = the other direction's angle less the own one's at the same motor angle. The residual
r of rows that lie equally long behind (or before) a reversal, pooled over all reversals of an axis, is
regressed on what a passage would leave there (rows at rest lie at the reversal: wind-up lasts until the axis
moves on):

    link encoder:  r = s D + noise,    gyroscope:  r = s dD/dt + (ds/dt) D + noise

The passage ends at the first band of rows that tells nothing of it: whose chi square, on the scale of the
rows farther than MOST_S from every reversal, is one that noise exceeds in a thousandth (FALSE) of all bands.
Rows nearer than that are left out, and as many where a run begins in motion, whose last reversal nobody saw.
"""

import numpy as np
from scipy import special

from exactarm.chain.direction import rests
from exactarm.numerics.factors import lstsq

MOST_S = 0.4  # wind-up of 1e-3 rad is passed in so long at an acceleration of 0.01 rad/s^2
FALSE = 1e-3
_BAND_S, _LEAST_ROWS = 0.01, 8  # of a band, the wider of the two
_IN_MOTION = 0.1  # of the highest speed


def in_passage(error: np.ndarray, beside: np.ndarray, columns: np.ndarray, rate: np.ndarray,
               angle: np.ndarray, time: np.ndarray, runs, usable: np.ndarray) -> np.ndarray:
    """(N,) bool of one axis.

    error (N,): measured less declared; beside (N, b): what each run may have of its own in it, an offset,
    a scale or a delay; columns (N, k): what a passage leaves in it; rate, angle (N,) of the axis (rad/s,
    rad); runs: row indices; usable (N,) bool: rows on which everything else is well.
    """
    behind, before, unseen = np.full((3, time.size), np.inf)
    for rows in runs:
        clock = time[rows]
        for turn, rest, _ in rests(clock, angle[rows])[1]:
            lag = clock - turn
            away = np.maximum(np.abs(lag) - 0.5 * rest, 0.0)
            behind[rows] = np.where(lag >= 0.0, np.minimum(behind[rows], away), behind[rows])
            before[rows] = np.where(lag < 0.0, np.minimum(before[rows], away), before[rows])
        if abs(rate[rows[0]]) > _IN_MOTION * np.max(np.abs(rate[rows])):
            unseen[rows] = clock - clock[0]
    far = usable & np.isfinite(np.minimum(behind, before)) & (np.minimum(behind, before) > MOST_S)
    if far.sum() < _LEAST_ROWS:
        return np.zeros(time.size, bool)
    residual = np.zeros(time.size)
    for rows in runs:
        # From rows that no passage has touched, where the run has such.
        at = rows[far[rows]] if far[rows].sum() >= _LEAST_ROWS else rows[usable[rows]]
        residual[rows] = error[rows] - beside[rows] @ lstsq(beside[at], error[at])[0]
    residual /= np.sqrt(np.mean(residual[far] ** 2))
    plain = [_told(residual[band], columns[band])
             for band in _bands(np.minimum(behind, before), far)]
    freedom = columns.shape[1]
    limit = max(1.0, float(np.mean(plain)) / freedom) * float(special.chdtri(freedom, FALSE))
    lasts = []
    for lag in (behind, before):
        end = -1.0
        for band in _bands(lag, usable & (lag < MOST_S)):
            if _told(residual[band], columns[band]) < limit:
                break
            end = float(lag[band].max())
        lasts.append(end)
    return (np.minimum(behind, unseen) <= lasts[0]) | (before <= lasts[1])


def _bands(lag: np.ndarray, rows: np.ndarray) -> list[np.ndarray]:
    """Row indices of equal lag, nearest first."""
    order = np.flatnonzero(rows)
    order = order[np.argsort(lag[order], kind="stable")]
    bands, start = [], 0
    while start + _LEAST_ROWS <= order.size:
        end = max(start + _LEAST_ROWS, int(np.searchsorted(lag[order], lag[order[start]] + _BAND_S)))
        bands.append(order[start:end])
        start = end
    return bands


def _told(residual: np.ndarray, columns: np.ndarray) -> float:
    """Chi square, in noise levels, that a passage explains."""
    return float(np.sum((columns @ lstsq(columns, residual)[0]) ** 2))
