"""Motions that tell two effects apart: the measured motion played slower, faster, or its axes one at a time.

Each variant is predicted with both effects at their best values; the difference is freed of what all other
free parameters could absorb over the old and the new motion together, and the variant with the most left of
it is named (T-optimality: Atkinson and Fedorov 1975).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from exactarm.chain import MotionRecord, predict_motion
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.next_runs import Difference
from exactarm.effects.base import Effect
from exactarm.robot.robot import Robot

_TEMPOS = (0.5, 1.0, 1.5)


def separating_motion(robot: Robot, fitted: Fitted, record: MotionRecord, one: Effect, other: Effect, *,
                      predict: Callable = predict_motion, columns: np.ndarray | None = None,
                      measured: str = "the torque (RMS over all axes)") -> str:
    """One sentence with the best motion and by how much the two effects differ in it.

    predict: (robot, layout, record) -> prediction; columns: those of its jacobian that are measured (default:
    all torques).
    """
    axes, difference = record.measured_axes if columns is None else columns, Difference.of(fitted, one, other)
    best, best_apart = "", -1.0
    for name, planned in _variants(record):
        prediction = predict(robot, fitted.layout, planned)
        used = np.ix_(np.flatnonzero(planned.keep), axes)
        left = difference.left(prediction.view, prediction.jacobian, used)
        apart = float(np.sqrt(np.mean(left**2)))
        if apart > 1.02 * best_apart:
            best, best_apart = name, apart
    names = f"{one.title} and {other.title}"
    return f"Play {best}: there {names} differ by {best_apart:.2g} times the scatter of {measured}."


def _variants(record: MotionRecord):
    """Named records: time stretched, all axes together or one alone."""
    moving = np.flatnonzero(np.ptp(record.theta, axis=0) > 0.0)
    for tempo in _TEMPOS:
        speed = "as it is" if tempo == 1.0 else f"at {tempo:g} times the speed"
        if tempo != 1.0:
            yield f"the same motion {speed}", _played(record, tempo, None)
        for axis in moving:
            yield f"the motion of axis {axis + 1} alone, {speed}", _played(record, tempo, int(axis))


def _played(record: MotionRecord, tempo: float, axis: int | None) -> MotionRecord:
    theta, rate, acceleration = (np.array(v) for v in (record.theta, record.theta_dot, record.theta_ddot))
    if axis is not None:
        others = np.arange(theta.shape[1]) != axis
        theta[:, others], rate[:, others], acceleration[:, others] = theta[0, others], 0.0, 0.0
    data = replace(record.data, time=record.data.time / tempo)
    return replace(record, data=data, theta=theta, theta_dot=tempo * rate, theta_ddot=tempo**2 * acceleration,
                   step=record.step / tempo)
