"""Gear runs at the sampling rate that their content needs.

The gears of a run show up to four times the motor's rate of turn (the overtone of a wave generator) or
their highest declared order; beyond, a sensor adds noise only. Reading and motor angle pass the same acausal
low-pass (Butterworth, eighth order, forwards and backwards), flat below, and every k-th sample is taken: a
search over hundreds of candidates then costs 1 / k. The angles of link encoders are treated as the
gyroscope's reading is.

Past its ends a run goes on as its own point reflection until the low-pass has died out, so that one which is
cut in motion goes on moving. The reflection turns about a noisy sample: what it reaches is left out. So it is
at long gaps within a run.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from exactarm.chain import GearRecord
from exactarm.chain.lost_samples import FILLED_PERIODS, Filled, without_gaps
from exactarm.data.dataset import Dataset
from exactarm.numerics.butterworth import butterworth, white_noise_behind
from exactarm.numerics.signals import derivative
from exactarm.numerics.stamps import typical_step
from exactarm.robot.robot import Robot

# the low-pass takes 1 % of what lies at 0.75 of its cutoff: of four per motor revolution
_MOTOR_ORDERS, _LEAST_HZ = 5.3, 80.0
_ROWS_PER_PERIOD = 2.6  # of the low-pass; 2 would be its Nyquist rate
_ORDER = 8
# the low-pass carries what is not defined so far into its neighbours, over the ends of a run too
_REACH_PERIODS = 1.0
_SEEN_AS_GAP = 1.5  # of the resampled rows: a shorter gap is none among them, and is filled
_LEAST_KEPT = 0.5  # of the rows: among many gaps the run stays as it is


def resampled_run(robot: Robot, data: Dataset, record: GearRecord) -> tuple[Dataset, GearRecord]:
    """The resampled rows and their record; both as they are where nothing is to be gained."""
    step = max(typical_step(data.time[rows]) for rows in record.runs)
    cutoff = _highest_frequency(robot, record)
    every = int(1.0 / (_ROWS_PER_PERIOD * cutoff * step))
    if every < 2 or min(rows.size for rows in record.runs) < 40 * every:
        return data, record
    low_pass = lambda values: butterworth(values, _ORDER, cutoff, step)
    reach = int(np.ceil(_REACH_PERIODS / (cutoff * step)))
    axes = list(record.encoder_axes)
    reading = data.joints["q"][:, axes] if axes else data.gyro
    longest = max(FILLED_PERIODS / cutoff, _SEEN_AS_GAP * every * step)
    picked, sizes = [], []
    for rows in record.runs:
        stretches = without_gaps(record.time[rows], (reading[rows], record.theta[rows]), longest)
        parts = [_picked(record, rows, stretch, low_pass, reach, every) for stretch in stretches
                 if stretch.time.size > 2 * reach]
        picked += parts
        sizes.append(sum(part[0].size for part in parts))
    if not picked or sum(part[5].sum() for part in picked) * every < _LEAST_KEPT * record.keep.sum():
        return data, record
    chosen, time, smooth, theta, direction, keep = (np.concatenate(each) for each in zip(*picked))
    count = np.cumsum([0, *sizes])
    runs = tuple(np.arange(a, b) for a, b in zip(count[:-1], count[1:]))
    theta_dot = np.concatenate([derivative(theta[rows], time[rows]) for rows in runs])
    resampled = GearRecord(
        theta, theta_dot, direction, keep, runs, time, record.cutoff_hz, record.encoder_axes, record.moving,
        record.furthest, partial(white_noise_behind, _ORDER, cutoff, step, every))
    return with_reading(replace(data.select(chosen), time=time), axes, smooth), resampled


def _picked(record: GearRecord, rows: np.ndarray, stretch: Filled, low_pass, reach: int,
            every: int) -> tuple[np.ndarray, ...]:
    """Rows, time, reading, theta, direction and keep of every k-th sample of a stretch of the run `rows`."""
    own = rows[stretch.row]
    undefined = np.pad(~record.keep[own], reach, constant_values=True)
    keep = np.convolve(undefined, np.ones(2 * reach + 1), "valid") < 0.5
    smooth, theta = (low_pass(signal) for signal in stretch.signals)
    every_one = (own, stretch.time, smooth, theta, record.direction[own], keep)
    return tuple(values[::every] for values in every_one)


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
        declared = 1.2 * joint.highest_order / abs(joint.ratio) if joint.has_harmonics else 0.0
        highest = max(highest, max(_MOTOR_ORDERS, declared) * rate)
    return max(highest, _LEAST_HZ)
