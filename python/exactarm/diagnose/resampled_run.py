"""Gear runs at the sampling rate that their content needs.

The gears of a run show up to twice the motor's rate of turn (or their highest declared order); beyond, a
sensor adds noise only. Reading and motor angle pass the same acausal low-pass (Butterworth, eighth order,
forwards and backwards), flat below, and every k-th sample is taken: a search over hundreds of candidates then
costs 1 / k. The angles of link encoders are treated as the gyroscope's reading is.

Past its ends a run goes on as its own point reflection until the low-pass has died out, so that one which is
cut in motion goes on moving. The reflection turns about a noisy sample: what it reaches is left out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy  # scipy.signal is imported at its first use: it takes half a second

from exactarm.chain import GearRecord
from exactarm.dataset import Dataset
from exactarm.robot import Robot
from exactarm.signals import derivative, typical_step

_MOTOR_ORDERS, _LEAST_HZ = 2.5, 80.0
_ROWS_PER_PERIOD = 2.6  # of the low-pass; 2 would be its Nyquist rate
_ORDER = 8
# the low-pass carries what is not defined so far into its neighbours, over the ends of a run too
_REACH_PERIODS = 1.0
# its slowest pole falls by exp(-2 pi sin(pi / 16)) = 0.29 a period: to 4e-7 of a ramp's slope in these
_FADED_PERIODS = 12.0


def resampled_run(robot: Robot, data: Dataset, record: GearRecord) -> tuple[Dataset, GearRecord]:
    """The resampled rows and their record; both as they are where nothing is to be gained."""
    step = max(typical_step(data.time[rows]) for rows in record.runs)
    cutoff = _highest_frequency(robot, record)
    every = int(1.0 / (_ROWS_PER_PERIOD * cutoff * step))
    if every < 2 or min(rows.size for rows in record.runs) < 40 * every:
        return data, record
    sections = scipy.signal.butter(_ORDER, cutoff, fs=1.0 / step, output="sos")
    pad = int(np.ceil(_FADED_PERIODS / (cutoff * step)))
    low_pass = lambda values: scipy.signal.sosfiltfilt(sections, values, axis=0,
                                                       padlen=min(pad, len(values) - 1))
    reach = int(np.ceil(_REACH_PERIODS / (cutoff * step)))
    axes = list(record.encoder_axes)
    reading = data.joints["q"][:, axes] if axes else data.gyro
    smooth, theta, keep = np.empty_like(reading), record.theta.copy(), np.empty_like(record.keep)
    for rows in record.runs:
        smooth[rows], theta[rows] = low_pass(reading[rows]), low_pass(record.theta[rows])
        undefined = np.pad(~record.keep[rows], reach, constant_values=True)
        keep[rows] = np.convolve(undefined, np.ones(2 * reach + 1), "valid") < 0.5
    chosen = np.concatenate([rows[::every] for rows in record.runs])
    count = np.cumsum([0] + [rows[::every].size for rows in record.runs])
    runs = tuple(np.arange(a, b) for a, b in zip(count[:-1], count[1:]))
    theta, time = theta[chosen], record.time[chosen]
    theta_dot = np.concatenate([derivative(theta[rows], time[rows]) for rows in runs])
    resampled = GearRecord(
        theta, theta_dot, record.direction[chosen], keep[chosen], runs, time, record.cutoff_hz,
        record.encoder_axes,
        record.moving, record.furthest,
    )
    return with_reading(data, axes, smooth).select(chosen), resampled


def with_reading(data: Dataset, axes: list[int], reading: np.ndarray) -> Dataset:
    """The data with another reading of the gyroscope, or of the link encoders of `axes`."""
    if not axes:
        return replace(data, gyro=reading)
    q = data.joints["q"].copy()
    q[:, axes] = reading
    return replace(data, joints={**data.joints, "q": q})


def _highest_frequency(robot: Robot, record: GearRecord) -> float:
    """Hz up to which the gears of these runs can show."""
    fastest = np.max(np.abs(record.theta_dot), axis=0, initial=0.0) / (2.0 * np.pi)
    highest = 0.0
    for joint, rate in zip(robot.joints, fastest):
        tables = [table.order for table in (joint.cw, joint.ccw) if table is not None and table.order.size]
        declared = 1.2 * np.max(np.concatenate(tables)) / abs(joint.ratio) if tables else 0.0
        highest = max(highest, max(_MOTOR_ORDERS, declared) * rate)
    return max(highest, _LEAST_HZ)
