"""Gear runs that tell two effects apart: which axis, how fast, in which posture.

Every axis to and fro over its measured range at a quarter, a half and the whole of its highest speed, the
other axes where they stood or a right angle further (another load), is predicted with both effects at their
best values. The difference is freed of what the declared parameters could absorb over old and new runs
together; the run with the most left of it is named (T-optimality: Atkinson and Fedorov 1975).
"""

from __future__ import annotations

import numpy as np

from exactarm.chain import GearRecord, predict_gear_run
from exactarm.dataset import Dataset
from exactarm.diagnose.orthonormal import orthonormal
from exactarm.diagnose.problem import Fitted
from exactarm.diagnose.scan import free_mask
from exactarm.effects.base import Effect
from exactarm.kinds import GEAR_RUN
from exactarm.robot import Robot

_SPEED_SHARES = (0.25, 0.5, 1.0)
_TURNS_RAD = (0.0, 0.5 * np.pi)
_ROWS = 1500
_CERTAIN = 4.0  # standard deviations between two explanations


def separating_run(robot: Robot, fitted: Fitted, record: GearRecord, one: Effect, other: Effect) -> str:
    """One sentence with the best run and by how much the two effects differ in it."""
    best, best_apart, best_rows = "", -1.0, 1
    old = _difference_on_record(fitted, one, other)
    for axis in np.flatnonzero(fitted.view.moving):
        for share in _SPEED_SHARES:
            for turn in _TURNS_RAD:
                data, speed = _planned(robot, fitted, record, int(axis), share, turn)
                apart = _apart(robot, fitted, data, one, other, *old)
                if apart > 1.02 * best_apart:
                    posture = " with the other axes turned by 90 degrees" if turn else " in the same posture"
                    best = f"axis {axis + 1} to and fro at {np.rad2deg(speed):.0f} deg/s{posture}"
                    best_apart, best_rows = apart, len(data)
    names = f"{one.title} and {other.title}"
    ratio = best_apart / float(np.mean(fitted.sigma))
    runs = max(1, int(np.ceil((_CERTAIN / max(ratio, 1e-9)) ** 2 / best_rows)))
    if runs > 20:
        return (f"No run of one axis inside the limits parts {names} (at most {ratio:.2g} times the "
                "scatter): repeat the runs with another known payload.")
    return (f"Move {best}, {runs} run{'s' if runs > 1 else ''}: there {names} differ by {ratio:.2g} times "
            "the scatter (RMS).")


def _planned(robot: Robot, fitted: Fitted, record: GearRecord, axis: int, share: float, turn: float):
    """A sine-like run of one axis over its measured range whose highest rate is `share` of what the axis can
    do."""
    view, limit = fitted.view, robot.joints[axis].q_dot_max
    output = view.theta[:, axis] / robot.ratios[axis]
    fastest = limit or float(np.max(np.abs(view.signals["theta_dot"][:, axis]))) / abs(robot.ratios[axis])
    low, high = float(output.min()), float(output.max())
    speed, half = share * fastest, 0.5 * (high - low)
    period = 2.0 * np.pi * half / speed
    time = np.linspace(0.0, period, _ROWS)
    rest = view.theta[view.runs[0][0]] + turn * robot.ratios
    theta = np.tile(rest, (_ROWS, 1))
    theta[:, axis] = (0.5 * (low + high) - half * np.cos(2.0 * np.pi * time / period)) * robot.ratios[axis]
    joints, more = {"theta": theta}, {}
    if record.encoder_axes:
        joints["q"] = np.full_like(theta, np.nan)
        joints["q"][:, list(record.encoder_axes)] = (theta / robot.ratios)[:, list(record.encoder_axes)]
        for name in ("tau_motor", "tau"):
            if name in view.data.joints:
                joints[name] = np.tile(np.nanstd(view.data.joints[name], axis=0), (_ROWS, 1)) * np.cos(
                    4.0 * np.pi * time / period
                )[:, None]
    else:
        more["gyro"] = np.zeros((_ROWS, 3))
    where = {"session": np.full(_ROWS, view.data.session[0]), "run": np.full(_ROWS, view.data.run[0])}
    covariates = {name: np.full(_ROWS, values.mean()) for name, values in view.data.covariates.items()}
    return Dataset.of_arrays(GEAR_RUN.name, joints, time=time, covariates=covariates, **where, **more), speed


def _shared(fitted: Fitted, one: Effect, other: Effect) -> np.ndarray:
    """(P,) the free parameters of neither effect."""
    keep = np.ones(fitted.layout.size, bool)
    for effect, where in zip(fitted.layout.effects, fitted.layout.slices):
        if effect.label in (one.label, other.label):
            keep[where] = False
    return keep


def _difference_on_record(fitted: Fitted, one: Effect, other: Effect):
    """The first effect less the best imitation by the second on the record: (R,), coefficients, the others'
    columns."""
    numbers = fitted.data_numbers
    first = fitted.columns(one)[:numbers, free_mask(one)] @ np.array(one.values)[free_mask(one)]
    second = fitted.columns(other)[:numbers, free_mask(other)]
    keep = _shared(fitted, one, other)
    declared = fitted.standard(fitted.jacobian[:, :, keep])
    basis = orthonormal(declared)
    free = lambda columns: columns - basis @ (basis.T @ columns)
    values = np.linalg.lstsq(free(second), free(first), rcond=1e-9)[0]
    return first - second @ values, values, declared


def _apart(robot: Robot, fitted: Fitted, data: Dataset, one, other, old, values, declared) -> float:
    """RMS over the new run of the difference that nothing can absorb, in the unit of the residual."""
    prediction = predict_gear_run(robot, fitted.layout, data)
    rows = prediction.view.response(one) @ np.where(free_mask(one), one.values, 0.0)
    rows = rows - prediction.view.response(other)[:, :, free_mask(other)] @ values
    keep = _shared(fitted, one, other)
    new = (prediction.jacobian[:, :, keep] / fitted.sigma[:, None]).reshape(rows.size, declared.shape[1])
    basis = orthonormal(np.concatenate([declared, new]))
    difference = np.concatenate([old, (rows / fitted.sigma).ravel()])
    left = (difference - basis @ (basis.T @ difference))[old.size :].reshape(rows.shape) * fitted.sigma
    return float(np.sqrt(np.mean(np.sum(left**2, axis=1))))
