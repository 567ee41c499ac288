"""Measured rates beside the angles whose rates they are: a unit, a sign, an axis or the time is wrong where

    integral of theta_dot_i over a window = s (theta_i at its end - theta_i at its begin)

has another s than 1, all windows of all runs by least squares. What the fit of a motion takes as the rate
would be s times too fast, without a word: the torques' model takes a good part of it up.
"""

from collections.abc import Iterator

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.kinds import kind_of
from exactarm.data.kinds.base import runs_in_time
from exactarm.first_aid.suspicion import Suspicion
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.robot import Robot

WINDOWS = 200  # of a run: long beside the delay of a filter and the noise of an encoder
LEAST_ROWS = 30  # of a run
LEAST_RAD = 0.05  # of an axis (m of a sliding one): one that moves less tells no rate
NEARLY = 0.1  # of s; a filter of half a window takes a hundredth
FOLLOWS, APART = 0.9, 0.5  # correlation of the two sides of the equation
_DEGREE = np.pi / 180.0


def rate_mistakes(robot: Robot, data: Dataset) -> Iterator[Suspicion]:
    """One line where the rates of an axis, or of all, are not those of its angles."""
    if data.time is None or kind_of(data.kind).at_rest:
        return
    for name, scale in (("theta", np.abs(robot.ratios)), ("q", np.ones(robot.axes))):
        angle, rate = data.joints.get(name), data.joints.get(f"{name}_dot")
        if angle is None or rate is None:
            continue
        pairs = [_windows(data.time[rows], angle[rows], rate[rows]) for rows in runs_in_time(data)
                 if rows.size >= LEAST_ROWS]
        if not pairs:
            continue
        turned, integral = (np.nan_to_num(np.concatenate(side)) for side in zip(*pairs))
        moving = np.ptp(np.nan_to_num(angle), axis=0) > LEAST_RAD * scale
        moving &= ~np.isnan(angle).all(axis=0) & ~np.isnan(rate).all(axis=0)
        said = list(_said(name, np.flatnonzero(moving), turned, integral))
        yield from said[:1]


def _windows(time: np.ndarray, angle: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(W, n) what the axes turn in every window, and the integral of their rates (trapezoids)."""
    ends = np.unique(np.linspace(0, len(time) - 1, WINDOWS + 1).astype(int))
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time)[:, None]
    sums = np.concatenate([np.zeros((1, rate.shape[1])), np.cumsum(steps, axis=0)])
    return np.diff(angle[ends], axis=0), np.diff(sums[ends], axis=0)


def _said(name: str, axes: np.ndarray, turned: np.ndarray, integral: np.ndarray) -> Iterator[Suspicion]:
    norms = [np.maximum(np.linalg.norm(side, axis=0), 1e-300) for side in (turned, integral)]
    product = turned.T @ integral  # of the angle (row) of an axis and the rate (column) of an axis
    alike = product / np.outer(*norms)
    slope = np.diag(product) / norms[0] ** 2
    wrong = [i for i in axes if abs(alike[i, i]) >= APART and abs(slope[i] - 1.0) > NEARLY]
    if len(wrong) == len(axes) > 1 and np.ptp(slope[wrong]) < NEARLY * abs(slope[wrong]).max():
        yield Suspicion(f"{name}_dot of all axes is {np.median(slope[wrong]):.3g} times the rate of {name}: "
                        f"{_meant(float(np.median(slope[wrong])), True)}")
        return
    for i in axes:
        other = max(axes, key=lambda j: alike[j, i])
        if other != i and alike[other, i] > FOLLOWS > alike[i, i]:
            yield Suspicion(f"{name}_dot_{i + 1} is the rate of {name}_{other + 1}, not of {name}_{i + 1}: "
                            f"are the rates of {axes_in_words((int(i), int(other)))} exchanged?")
        elif abs(alike[i, i]) < APART:
            yield Suspicion(f"{name}_dot_{i + 1} is not the rate of {name}_{i + 1}: is it of another axis, "
                            "another time or another motion?")
        elif i in wrong:
            yield Suspicion(f"{name}_dot_{i + 1} is {slope[i]:.3g} times the rate of {name}_{i + 1}: "
                            f"{_meant(float(slope[i]), False)}")


def _meant(slope: float, of_all: bool) -> str:
    near = lambda goal: abs(slope / goal - 1.0) < NEARLY
    if near(-1.0):
        return "is it of the opposite sign?"
    if near(1.0 / _DEGREE):
        return "is it in degrees a second, labelled as radians a second?"
    if near(_DEGREE):
        return "is it in radians a second, labelled as degrees a second?"
    if of_all and slope > 0.0:
        return f"are all times {max(slope, 1.0 / slope):.3g} times too {'long' if slope > 1.0 else 'short'}?"
    return "is it in another unit, or of the other side of the gear?"
