"""Usual mistakes in one of several runs under a gyroscope: its unit, its axes, the unit or ratio of a motor.

    reading (N, 3) = rate of the moving motor over its ratio, times share_k d_k, plus a bias       run k

The share (1 where all is right) and the direction d_k (3,) are fitted to every run. Runs of one axis in one
set-up have the same of both: a run is named where its share is `GYRO_TOLERANCE` off that of most of them, or
its direction `_TURNED_RAD`. It only tells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from exactarm.chain.lost_samples import between_gaps
from exactarm.data.dataset import Dataset
from exactarm.data.kinds.base import STANDS_STILL, runs_in_time
from exactarm.first_aid.suspicion import Suspicion, run_words
from exactarm.numerics.signals import at_even_times, even_clock
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.robot import Robot
from exactarm.view import motor_angles

# the noise of a run's direction is a thousandth; a sensor is mounted again within some hundredths
_TURNED_RAD = 0.1
_LEAST_ROWS = 30
_LEAST_SPREAD = 0.2  # of the rate's size: at one rate a bias and a scale are the same
_BIAS_RAD_S = 0.01  # of a small gyroscope
_NAMES = "xyz"


@dataclass(frozen=True)
class GyroRun:
    """What one run of one axis (from 0) shows: share_k and d_k; unsure: what a bias may add to the share."""

    rows: np.ndarray
    axis: int
    share: float
    direction: np.ndarray
    unsure: float

    @staticmethod
    def of(rows: np.ndarray, axis: int, rate: np.ndarray, reading: np.ndarray) -> GyroRun:
        """rate (N,) of the motor over its ratio, reading (N, 3)."""
        spread = rate - rate.mean()
        known = float(np.linalg.norm(spread)) > _LEAST_SPREAD * float(np.linalg.norm(rate))
        by = spread if known else rate
        slope = reading.T @ by / max(float(by @ by), 1e-300)
        share = float(np.linalg.norm(slope))
        rms = float(np.sqrt(np.mean(rate**2)))
        unsure = 0.0 if known else _BIAS_RAD_S / max(rms, 1e-300)
        return GyroRun(rows, axis, share, slope / max(share, 1e-300), unsure)


def gyro_runs(robot: Robot, data: Dataset, smooth: Callable[[np.ndarray], np.ndarray]) -> list[GyroRun]:
    """Of the runs in which one axis moves."""
    theta, found = motor_angles(robot, data), []
    for rows in runs_in_time(data):
        span = np.ptp(theta[rows], axis=0) / np.abs(robot.ratios)
        if rows.size < _LEAST_ROWS or span.max() == 0.0 or np.sum(span > STANDS_STILL * span.max()) != 1:
            continue
        axis = int(np.argmax(span))
        time, angle, gyro = between_gaps(data.time[rows], theta[rows, axis] / robot.ratios[axis],
                                         data.gyro[rows])
        rate = rate_on_even_clock(time, angle, smooth)[1]
        reading = np.stack([smooth(values) for values in gyro.T], axis=1)
        found.append(GyroRun.of(rows, axis, rate, reading))
    return found


def rate_on_even_clock(time: np.ndarray, angle: np.ndarray,
                       smooth: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Time without the jitter of a logger, and rate of an angle, (N,) each: two stamps that come close to
    each other would make any rate."""
    clock = even_clock(time)
    if clock is not time:
        angle = at_even_times(angle[:, None], time, clock, 0)[:, 0]
    return clock, np.gradient(smooth(angle), clock)


def runs_of_several_axes(robot: Robot, data: Dataset) -> list[Suspicion]:
    """Of the first run in which more than one axis moves: which of them the sensor feels, nobody knows."""
    theta, found, runs = motor_angles(robot, data), [], runs_in_time(data)
    for rows in runs:
        span = np.ptp(theta[rows], axis=0) / np.abs(robot.ratios)
        moving = np.flatnonzero(span > STANDS_STILL * span.max())
        if rows.size >= _LEAST_ROWS and moving.size > 1:
            found.append((rows, moving))
    if not found:
        return []
    (rows, moving), others = found[0], len(found) - 1
    beside = f" (and so in {others} more of {len(runs)} runs)" if others else ""
    return [Suspicion(
        f"{run_words(data, rows)}: {axes_in_words(moving)} move at once{beside}; a gyroscope shows the gear "
        "of one axis while the others stand still: what is said of gears from such runs is not to be "
        "trusted")]


def odd_gear_runs(data: Dataset, runs: list[GyroRun], tolerance: float,
                  meant: Callable[[float], str]) -> list[Suspicion]:
    """The first run that is unlike the others; tolerance: of shares; meant: what a share hints at."""
    for key in dict.fromkeys((data.session[run.rows[0]], run.axis) for run in runs):
        alike = [run for run in runs if (data.session[run.rows[0]], run.axis) == key]
        for run in alike if len(alike) > 1 else ():
            others = [each for each in alike if each is not run]
            if words := _share_words(run, others, tolerance, meant) or _direction_words(run, others):
                return [Suspicion(f"{run_words(data, run.rows)}: {words}")]
    return []


def _share_words(run: GyroRun, others: list[GyroRun], tolerance: float, meant: Callable[[float], str]) -> str:
    near = lambda one: abs(np.log(max(one.share, 1e-300)))
    sure = lambda one, other: tolerance + one.unsure + other.unsure
    if any(abs(run.share / max(each.share, 1e-300) - 1.0) < sure(run, each) for each in others):
        return ""
    usual = min(others, key=near)
    if near(run) < near(usual):
        return ""  # of two runs the other is the odd one
    share = run.share / max(usual.share, 1e-300)
    return (f"the gyroscope reads {share:.4g} times as much of motor {run.axis + 1}'s rate as in the other "
            f"runs: {meant(share)}")


def _direction_words(run: GyroRun, others: list[GyroRun]) -> str:
    apart = lambda one, other: float(np.arccos(np.clip(one @ other, -1.0, 1.0)))
    if any(apart(run.direction, each.direction) < _TURNED_RAD for each in others):
        return ""
    most = max(others, key=lambda each: sum(apart(each.direction, other.direction) < _TURNED_RAD
                                            for other in others))
    if len(others) == 1 and run.rows[0] < most.rows[0]:
        return ""  # of two runs the later one is named
    angle = apart(run.direction, most.direction)
    words = next((words for words, order, signs in _relabelled()
                  if apart(run.direction[order] * signs, most.direction) < _TURNED_RAD), "")
    guess = (f"{words}, or is it another set-up (session)?" if words
             else "was the sensor mounted anew (then it is another session)?")
    return (f"the gyroscope stands {np.degrees(angle):.0f} degrees off where it stands in the other runs: "
            f"{guess}")


def _relabelled():
    """Words, order and signs of readings; the simplest first."""
    for k in range(3):
        signs = np.where(np.arange(3) == k, -1.0, 1.0)
        yield (f"has its axis {_NAMES[k]}, or the motor's angle, the opposite sign", [0, 1, 2], signs)
    for order in sorted(permutations(range(3)), key=lambda each: sum(k != i for i, k in enumerate(each))):
        moved = [_NAMES[i] for i, k in enumerate(order) if k != i]
        for signs in product((1.0, -1.0), repeat=3):
            turned = " and their signs" if min(signs) < 0.0 else ""
            words = f"are its axes {', '.join(moved) or 'x, y, z'} exchanged{turned}"
            yield words, list(order), np.array(signs)
