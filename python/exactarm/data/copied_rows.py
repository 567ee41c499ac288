"""Copied rows: measured positions that stand in the data twice, to the last digit.

Two measurements of one pose with noise sigma give the same coordinate, written in steps s, with a chance of
s / (2 sqrt(pi) sigma) or less: the density of their difference at zero. Of K pairs of rows (s / (2 sqrt(pi)
sigma))^3 K are the same by chance at most. Where more are (Poisson), they were copied. A copy is no reading
of its own: counted as one, it makes the noise look smaller than it is, and neighbours look alike.
"""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy import special

from exactarm.data.kinds import kind_of
from exactarm.data.rows import Rows
from exactarm.data.split import pose_groups

Data = TypeVar("Data", bound=Rows)

BY_CHANCE = 1e-6  # of a data set, or of a day's check: one false word in thousands of years
_LEAST_SIGMA_M = 5e-6  # no arm under a tracker repeats better
_DIGITS = 9  # behind the point, in m: finer than any device writes


def without_copies(data: Data) -> Data:
    """The rows of poses at rest, of those that are copies the first alone; a note counts the others."""
    if data.position is None or not kind_of(data.kind).at_rest:
        return data
    read = [data.session[:, None], *data.joints.values(), data.position]
    read += [] if data.rotation is None else [data.rotation.reshape(len(data), 9)]
    read += [data.contacts[name][:, None] for name in data.contacts]
    keys, first, which = np.unique(np.nan_to_num(np.hstack(read)), axis=0, return_index=True,
                                   return_inverse=True)
    which, known = which.ravel(), np.isfinite(data.position).all(axis=1)
    copy = (first[which] != np.arange(len(data))) & known
    if not copy.any():
        return data
    poses = np.stack([pose_groups(data), data.session], axis=1)
    poses = np.unique(poses, axis=0, return_inverse=True)[1].ravel()
    counts, own = np.bincount(poses[known]), known & ~copy
    pairs, sigma = 0.5 * float(counts @ (counts - 1.0)), _scatter(data.position[own], poses[own])
    if chance_of_copies(int(copy.sum()), pairs, step_of(data.position), sigma) >= BY_CHANCE:
        return data
    note = (f"{copy.sum():,} of {len(data):,} rows are copies of others, angles and readings alike to the "
            "last digit: they are left out")
    kept = replace(data.select(~copy), notes=(*data.notes, note))
    return kept if data.way is None else kept.with_way()


def chance_of_copies(count: int, pairs: float, step: float, sigma: float) -> float:
    """That `count` or more of `pairs` of rows, written in steps (m), are the same; sigma: their noise, m."""
    same = min(1.0, step / (2.0 * np.sqrt(np.pi) * sigma)) ** 3 if sigma > 0.0 else 1.0
    return float(special.pdtrc(count - 1, same * pairs))


def step_of(position: np.ndarray) -> float:
    """m: the coarsest power of ten in which all coordinates (N, 3) are written."""
    values = position[np.isfinite(position)]
    for digits in range(_DIGITS):
        scaled = values * 10.0**digits
        if np.all(np.abs(scaled - np.round(scaled)) < 1e-6 * np.maximum(1.0, np.abs(scaled) * 1e-6)):
            return 10.0**-digits
    return 10.0**-_DIGITS


def _scatter(position: np.ndarray, poses: np.ndarray) -> float:
    """m: of one coordinate among the readings (N, 3) of a pose."""
    names, inverse, counts = np.unique(poses, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(inverse, weights=column) for column in position.T], axis=1) / counts[:, None]
    freedom = 3 * (len(poses) - len(names))
    square = float(np.sum((position - mean[inverse]) ** 2)) / freedom if freedom else 0.0
    return max(float(np.sqrt(square)), _LEAST_SIGMA_M)
