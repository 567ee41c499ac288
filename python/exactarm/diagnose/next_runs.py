"""Gear runs that tell two effects apart: which axis, how fast, in which posture.

Every axis to and fro over its measured range at a quarter, a half and the whole of its highest speed, the
other axes where they stood or a right angle further (another load), is predicted with both effects at their
best values. The difference is freed of what the declared parameters could absorb over old and new runs
together; the run with the most left of it is named (T-optimality: Atkinson and Fedorov 1975).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.chain import GearRecord, predict_gear_run
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import GEAR_RUN
from exactarm.diagnose.decisions import CLEAR
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.scan import free_mask
from exactarm.effects.base import Effect
from exactarm.numerics.factors import lstsq
from exactarm.numerics.orthonormal import orthonormal
from exactarm.robot.robot import Robot
from exactarm.view import View

_SPEED_SHARES = (0.25, 0.5, 1.0)
_TURNS_RAD = (0.0, 0.5 * np.pi)
_ROWS = 1500


def separating_run(robot: Robot, fitted: Fitted, record: GearRecord, one: Effect, other: Effect) -> str:
    """One sentence with the best run and by how much the two effects differ in it."""
    best, best_apart, best_rows = "", -1.0, 1
    difference = Difference.of(fitted, one, other)
    for axis in np.flatnonzero(fitted.view.moving):
        for share in _SPEED_SHARES:
            for turn in _TURNS_RAD:
                data, speed = _planned(robot, fitted, record, int(axis), share, turn)
                prediction = predict_gear_run(robot, fitted.layout, data)
                left = difference.left(prediction.view, prediction.jacobian) * fitted.sigma
                apart = float(np.sqrt(np.mean(np.sum(left**2, axis=1))))
                if apart > 1.02 * best_apart:
                    posture = " with the other axes turned by 90 degrees" if turn else " in the same posture"
                    best = f"axis {axis + 1} to and fro at {np.rad2deg(speed):.0f} deg/s{posture}"
                    best_apart, best_rows = apart, len(data)
    names = f"{one.title} and {other.title}"
    ratio = best_apart / float(np.mean(fitted.sigma))
    runs = max(1, int(np.ceil((CLEAR / max(ratio, 1e-9)) ** 2 / best_rows)))
    if runs > 20:
        return (f"No run of one axis inside the limits parts {names} (at most {ratio:.2g} times the "
                f"scatter): {_instead(one, other)}.")
    return (f"Move {best}, {runs} run{'s' if runs > 1 else ''}: there {names} differ by {ratio:.2g} times "
            "the scatter (RMS).")


def _instead(one: Effect, other: Effect) -> str:
    """What else may part them: loads, where one of them follows these; else other axes, where one of them
    belongs to the sensor; else what is known of the gear."""
    if one.by_load or other.by_load:
        return "repeat the runs with another known payload"
    if (one.joint is None) != (other.joint is None):
        return "measure another axis with the same sensor, whose own error is the same there"
    return "a count of the teeth, or an encoder behind the gear, would"


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
                    4.0 * np.pi * time / period)[:, None]
    else:
        more["gyro"] = np.zeros((_ROWS, 3))
    where = {"session": np.full(_ROWS, view.data.session[0]), "run": np.full(_ROWS, view.data.run[0])}
    covariates = {name: np.full(_ROWS, values.mean()) for name, values in view.data.covariates.items()}
    return Dataset.of_arrays(GEAR_RUN.name, joints, time=time, covariates=covariates, **where, **more), speed


@dataclass(frozen=True)
class Difference:
    """What two effects at their best values differ by on the record, the second as like the first as it can
    be: old (R,) in units of the noise sigma (m,); declared (R, p): whitened columns of the parameters that
    are free beside both, kept (P,) of all."""

    one: Effect
    other: Effect
    sigma: np.ndarray
    kept: np.ndarray
    declared: np.ndarray
    imitation: np.ndarray
    old: np.ndarray

    @staticmethod
    def of(fitted: Fitted, one: Effect, other: Effect) -> Difference:
        numbers = fitted.data_numbers
        first = fitted.columns(one)[:numbers, free_mask(one)] @ np.array(one.values)[free_mask(one)]
        second = fitted.columns(other)[:numbers, free_mask(other)]
        kept = np.ones(fitted.layout.size, bool)
        for effect, where in zip(fitted.layout.effects, fitted.layout.slices):
            kept[where] &= effect.label not in (one.label, other.label)
        declared = fitted.standard(fitted.jacobian[:, :, kept])
        basis = orthonormal(declared)
        free = lambda columns: columns - basis @ (basis.T @ columns)
        imitation = lstsq(free(second), free(first), rcond=1e-9)[0]
        return Difference(one, other, fitted.sigma, kept, declared, imitation, first - second @ imitation)

    def left(self, view: View, jacobian: np.ndarray, used=...) -> np.ndarray:
        """(K, m), in units of the noise, what nothing that is free can absorb on old and new rows together of
        the difference on the `used` numbers of new rows."""
        rows = view.response(self.one)[used] @ np.where(free_mask(self.one), self.one.values, 0.0)
        rows = rows - view.response(self.other)[used][..., free_mask(self.other)] @ self.imitation
        new = (jacobian[used][..., self.kept] / self.sigma[:, None]).reshape(rows.size, -1)
        basis = orthonormal(np.concatenate([self.declared, new]))
        difference = np.concatenate([self.old, (rows / self.sigma).ravel()])
        return (difference - basis @ (basis.T @ difference))[self.old.size :].reshape(rows.shape)
