"""Gear record: what a gear run's data give once and for all, before any parameter is looked at.

The motor angle enters the prediction of a rate through its derivative, which raises the encoder's
quantisation by about 1 / step; the measured rate itself is never smoothed. So the motor angle alone passes
the acausal Gaussian filter (3.1), at the lowest cutoff that a steady motion needs not more than and the
encoder not less than: the one at which the encoder's part in the predicted rate is a tenth of the gyroscope's
noise. Harmonics are not touched by it: they follow the filtered angle through the gear table. Where the
filter rounds the motion itself by more than a share of the gyroscope's noise, at the corners of a motion
profile, samples are left out. Between encoders on both sides nothing is filtered, nor where the sensor has
not measured yet (a plan, a simulation).

Where the drive train swings, at the corners of a motion profile, no quasi-static model holds: such samples
are left out (chain/swinging.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from exactarm import _core
from exactarm.chain.encoder_counts import smoothest
from exactarm.chain.gear import declared_output_angle, differs_with_direction
from exactarm.chain.gear_passage import in_passage
from exactarm.chain.spring import declared_deflection
from exactarm.chain.swinging import bending_rate, follows_quietly, swings, widened
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import GEAR_RUN
from exactarm.data.kinds.base import STANDS_STILL
from exactarm.numerics.signals import (
    HALF_STENCIL,
    MOTION_HZ,
    at_even_times,
    block_starts,
    derivative,
    even_clock,
    gaussian_filter,
    gaussian_sigma,
    steady_direction,
    step_of_quantisation,
)
from exactarm.numerics.stamps import blocks, typical_step
from exactarm.numerics.white_noise import white_noise
from exactarm.robot.robot import Robot
from exactarm.view import View, motor_angles

_ENCODER_SHARE = 0.1  # of the gyroscope's noise that the encoder may add to the predicted rate
_LOWEST_CUTOFF_HZ, _HIGHEST_SHARE = 15.0, 0.35  # of the sampling rate
_STENCIL_GAIN = 1.18  # noise of the eighth-order central difference per step
# integral of (2 pi f)^2 (2 H - H^2)^2 2 df / f_c^3, H = exp(-ln 2 / 2 f^2 / f_c^2), twice applied
_NOISE_BANDWIDTH = 131.9
_ROUNDED_SHARE = 0.3  # of the gyroscope's noise that the filter may take from the motion's own rate
_ROUNDED_REACH = 3.0  # deviations of the filter
_STANDING = 0.02  # of the highest speed, as at a reversal
# of the encoder's part in the rate, in what a second filter takes; deviations
_ROUNDED_NOISE, _CERTAIN = 0.420, 6.0


@dataclass(frozen=True)
class GearRecord:
    """Signals (N, n) of the motors at `time` (N,), the stamps without their rounding, and the runs' row
    indices.

    theta, theta_dot (rad, rad/s), direction (-1, 0, +1); keep (N,): neither at a reversal nor where inertia
    swings the drive train or the filter rounds the motion; cutoff_hz: of the filter on theta, None where it
    was not needed; encoder_axes: axes (from 0) with an encoder at the output, empty where a gyroscope
    measures; moving (n,): axes that move at all; furthest: of each run, the axis (from 0) that moves
    furthest; noise_autocorrelation(lags): (lags + 1,) of white noise in the rows, None where it is white
    there, too.
    """

    theta: np.ndarray
    theta_dot: np.ndarray
    direction: np.ndarray
    keep: np.ndarray
    runs: tuple[np.ndarray, ...]
    time: np.ndarray
    cutoff_hz: float | None
    encoder_axes: tuple[int, ...]
    moving: np.ndarray
    furthest: tuple[int, ...]
    noise_autocorrelation: Callable[[int], np.ndarray] | None = None

    @cached_property
    def sensor_axis(self) -> np.ndarray:
        """(N,) axis from 0 on whose link a gyroscope sits: the one that moves in the row's run."""
        axis = np.zeros(self.time.size, int)
        for rows, index in zip(self.runs, self.furthest):
            axis[rows] = index
        return axis

    def view(self, robot: Robot, data: Dataset, threads: int = 1) -> View:
        """A view of the data with what is known here already."""
        view = View(robot, data, GEAR_RUN.name, threads)
        view.signals |= {"theta": self.theta.copy(), "theta_dot": self.theta_dot, "direction": self.direction}
        view.signals["keep"] = self.keep.astype(float)
        view.runs, view.moving, view.sensor_axis = self.runs, self.moving, self.sensor_axis
        view.moving_runs = tuple(zip(self.runs, self.furthest))
        return view

    def rate(self, angle: np.ndarray) -> np.ndarray:
        """d/dt of a signal or tangent (N, ...), run by run."""
        out = np.empty_like(angle)
        for number, rows in enumerate(self.runs):
            out[rows] = self.run_rate(number, angle[rows])
        return out

    def run_rate(self, number: int, angle: np.ndarray) -> np.ndarray:
        """d/dt of a signal or tangent (R, ...) of one run."""
        time, starts = self._blocks[number]
        return derivative(angle, time, starts)

    @cached_property
    def _blocks(self) -> list[tuple[np.ndarray, list[int]]]:
        return [(self.time[rows], block_starts(self.time[rows])) for rows in self.runs]


def gear_record(robot: Robot, data: Dataset, *, accelerating: bool = False) -> GearRecord:
    """Prepares all runs of `data`; `accelerating`: keeps what might swing on axes of which the data say that
    they do not."""
    theta = motor_angles(robot, data)
    view = View(robot, data, GEAR_RUN.name)
    view.signals["theta"] = theta
    runs, moving = view.runs, np.flatnonzero(view.moving)
    encoder_axes = () if data.gyro is not None else _encoder_axes(data)
    noise = None if encoder_axes else _gyro_noise(view)
    measured = not encoder_axes and bool(np.any(data.gyro))
    cutoff, blur = _cutoff(view, robot, noise) if measured else (None, 0.0)
    theta_dot, direction = np.zeros((2, *theta.shape))
    keep, swinging = np.ones(len(data), bool), np.zeros(len(data), bool)
    bending = np.zeros(len(data))
    clock = data.time.copy()
    for rows, main in view.moving_runs:
        stamps = data.time[rows]
        clock[rows] = time = even_clock(stamps)
        at = np.ix_(rows, moving)
        if time is not stamps:
            theta[at] = at_even_times(theta[at], stamps, time, int(np.searchsorted(moving, main)))
        angle = theta[at] if cutoff is None else smoothest(theta[at], time, cutoff)
        theta[at] = angle
        theta_dot[at] = rate = derivative(angle, time)
        # Filtered with sqrt(2) of the width at once, as if twice.
        slow = gaussian_filter(rate, time, MOTION_HZ / np.sqrt(2.0))
        span = np.ptp(angle, axis=0) / np.abs(robot.ratios[moving])
        for column, axis in enumerate(moving):
            if span[column] <= STANDS_STILL * span.max():
                continue  # its rate is rounding and has no direction
            direction[rows, axis], reversal = steady_direction(slow[:, column], time)
            if axis in encoder_axes and differs_with_direction(robot.joints[axis]):
                keep[rows] &= ~reversal
            if axis == main and not encoder_axes:
                acceleration = derivative(slow[:, column], time)
                keep[rows] &= ~reversal
                if measured:
                    keep[rows] &= ~_cut_in_motion(slow[:, column], time)
                bending[rows] = bending_rate(robot, theta[rows], acceleration, time, axis)
                swinging[rows] = swings(bending[rows], time, noise)
                if cutoff is not None:
                    output = angle[:, column] / robot.ratios[axis]
                    keep[rows] &= ~_rounded(output, time, cutoff, max(_ROUNDED_SHARE * noise, blur))
    record = GearRecord(theta, theta_dot, direction, keep, runs, clock, cutoff, encoder_axes, view.moving,
                        tuple(axis for _, axis in view.moving_runs))
    record = replace(record, keep=keep & ~_passing(robot, data, record))
    asked = accelerating and measured and swinging.any()
    quiet = _quiet_axes(robot, data, record, bending, swinging) if asked else []
    return replace(record, keep=record.keep & ~(swinging & ~np.isin(record.sensor_axis, quiet)))


def _cut_in_motion(rate: np.ndarray, time: np.ndarray) -> np.ndarray:
    """(R,) bool: rows so near to an end of a run, or to lost samples, that the derivative is of a lower
    order, where the axis (rate (R,)) moves: it does not follow the faster waves of a gear. Of a row alone
    there is none."""
    cut, alone = np.zeros((2, time.size), bool)
    for rows in blocks(time):
        cut[rows[:HALF_STENCIL]] = cut[rows[-HALF_STENCIL:]] = True
        alone[rows] = rows.size == 1
    return alone | (cut & (np.abs(rate) > _STANDING * np.max(np.abs(rate))))


def _quiet_axes(robot: Robot, data: Dataset, record: GearRecord, bending: np.ndarray,
                swinging: np.ndarray) -> list[int]:
    """Axes (from 0) that turn out not to swing where they might."""
    q, quiet = _declared_angle(record.view(robot, data)), []
    for axis in sorted(set(record.furthest)):
        numbers = [k for k, main in enumerate(record.furthest) if main == axis]
        runs = [record.runs[k] for k in numbers]
        predicted = np.zeros(len(data))
        for k in numbers:
            predicted[record.runs[k]] = record.run_rate(k, q[record.runs[k], axis])
        if follows_quietly(data.gyro, predicted, bending, record.time, runs, swinging, record.keep):
            quiet.append(axis)
    return quiet


def _declared_angle(view: View) -> np.ndarray:
    """(N, n) behind gears, and behind springs where there are masses to load them."""
    q = declared_output_angle(view)[0] + view.robot.offsets
    if not view.has_masses:
        return q
    return q + declared_deflection(view.robot, _core.gravity_torque(view.robot.core, q))[0]


def _passing(robot: Robot, data: Dataset, record: GearRecord) -> np.ndarray:
    """(N,) bool: rows in which a gear passes from one table to the other."""
    passing = np.zeros(len(data), bool)
    differing = [axis for axis, joint in enumerate(robot.joints)
                 if record.moving[axis] and differs_with_direction(joint)]
    if not differing or not (record.encoder_axes or np.any(data.gyro)):
        return passing
    view = record.view(robot, data)
    own = _declared_angle(view)
    view.signals["direction"] = -record.direction
    other = _declared_angle(view)
    for axis in differing:
        if record.encoder_axes and axis not in record.encoder_axes:
            continue
        runs = [rows for rows, main in zip(record.runs, record.furthest)
                if record.encoder_axes or main == axis]
        error, beside = np.zeros(len(data)), np.ones((len(data), 2 if record.encoder_axes else 3))
        columns = (other - own)[:, [axis] * (beside.shape[1] - 1)]
        for rows in runs:
            if record.encoder_axes:
                error[rows] = data.joints["q"][rows, axis] - own[rows, axis]
                beside[rows, 1] = derivative(own[rows, axis], record.time[rows])
                continue
            clock, kept = record.time[rows], rows[record.keep[rows]]
            beside[rows, 1] = rate = derivative(own[rows, axis], clock)
            beside[rows, 2] = gaussian_filter(derivative(rate, clock), clock, MOTION_HZ)
            columns[rows, 1] = derivative(columns[rows, 0], clock)
            toward = data.gyro[kept].T @ beside[kept, 1]
            error[rows] = data.gyro[rows] @ (toward / max(np.linalg.norm(toward), 1e-300)) - rate
        passing |= in_passage(error, beside, columns, record.theta_dot[:, axis] / robot.ratios[axis],
                              record.theta[:, axis] / robot.ratios[axis], record.time, runs, record.keep)
    return passing


def _encoder_axes(data: Dataset) -> tuple[int, ...]:
    both = ~np.isnan(data.joints["theta"][0]) & ~np.isnan(data.joints["q"][0])
    return tuple(int(axis) for axis in np.flatnonzero(both))


def _gyro_noise(view: View) -> float:
    """Standard deviation of the gyroscope's white noise, rad/s, the median over the runs."""
    noises = [np.mean([white_noise(view.data.gyro[rows, k]) ** 2 for k in range(3)]) for rows in view.runs]
    return float(np.sqrt(np.median(noises)))


def _cutoff(view: View, robot: Robot, gyro_noise: float) -> tuple[float | None, float]:
    """Cutoff of the filter on the motor angle in Hz, None where the encoder is fine enough without; and the
    rate in rad/s below which a rounding by the filter cannot be told from the encoder's own part."""
    noises, steps = [], []
    for rows, axis in view.moving_runs:
        angle = view.theta[rows, axis] / robot.ratios[axis]
        noises.append(max(white_noise(angle), step_of_quantisation(angle) / np.sqrt(12.0)))
        steps.append(typical_step(view.data.time[rows]))
    encoder, step = float(np.median(noises)), float(np.median(steps))
    allowed = _ENCODER_SHARE * gyro_noise
    if _STENCIL_GAIN * encoder / step <= allowed:
        return None, 0.0
    cutoff = (allowed**2 / (_NOISE_BANDWIDTH * encoder**2 * step)) ** (1.0 / 3.0)
    cutoff = float(np.clip(cutoff, _LOWEST_CUTOFF_HZ, _HIGHEST_SHARE / step))
    left = encoder * np.sqrt(_NOISE_BANDWIDTH * step * cutoff**3)
    return cutoff, _CERTAIN * _ROUNDED_NOISE * left


def _rounded(angle: np.ndarray, time: np.ndarray, cutoff: float, limit: float) -> np.ndarray:
    """(R,) where filtering the filtered angle (R,) once more, and putting back what that rounds, changes its
    rate by more than `limit` rad/s, and around."""
    beside = angle - gaussian_filter(angle, time, cutoff)
    taken = np.abs(derivative(beside - gaussian_filter(beside, time, cutoff), time)) > limit
    return widened(taken, time, _ROUNDED_REACH * gaussian_sigma(cutoff))
