"""Kinematic error of a gear on any of its samples, before and after (E6, thesis (3.4)).

Both sides pass the same acausal filter (3.1): the difference is filtered, stretch by stretch of rows that
count, at a cutoff of a few motor revolutions of each run, so that the harmonics stay and the gyroscope's
noise does not hide them. With encoders on both sides the difference of the angles is taken, less one constant
for each run.
"""

from __future__ import annotations

import numpy as np

from exactarm.identify.gear_declared import SIDES
from exactarm.identify.gear_samples import GearSamples
from exactarm.numerics.harmonics import delivered
from exactarm.numerics.signals import MOTION_HZ, derivative, gaussian_filter
from exactarm.numerics.stamps import typical_step
from exactarm.numerics.white_noise import white_noise
from exactarm.robot.robot import GearTable

CUTOFF_PER_MOTOR_REV = 2.3
_HIGHEST_SHARE = 0.4  # of the sampling rate
_NOISE_SHARE = 1.0645  # equivalent noise bandwidth of the filter over its cutoff


def cutoff_hz(samples: GearSamples, rows: np.ndarray) -> float:
    """-3 dB frequency for the kinematic error of one run; Table A.4 has 2.3, 1.5 and 4.9 motor
    revolutions."""
    motor_hz = abs(samples.ratio) * samples.speed(rows) / (2.0 * np.pi)
    return float(min(CUTOFF_PER_MOTOR_REV * max(motor_hz, 1e-3),
                     _HIGHEST_SHARE / typical_step(samples.time[rows])))


def motor_by_tables(samples: GearSamples, scale: float, tables: dict[str, GearTable]) -> np.ndarray:
    """(N,) what the output would be by the ratio and the tables of each side, rad/s or rad."""
    model = samples.motor / scale
    for side, table in tables.items():
        rows = np.flatnonzero(samples.keep & (samples.direction == SIDES[side]))
        phi = samples.angle[rows] / scale
        x, slope = delivered(phi, table.order, table.a, table.b)
        model[rows] = model[rows] / (1.0 + slope) if samples.rated else model[rows] - (phi - x)
    return model


def kinematic_error(samples: GearSamples, model: np.ndarray, disturbance: np.ndarray,
                    filtered: bool = True) -> np.ndarray:
    """(N,) motor over ratio (by the tables, `motor_by_tables`) minus output; NaN on rows that do not count.

    disturbance (k,): coefficients of the columns that belong to the sensor; none of the others is taken out.
    """
    out = model - samples.output
    if np.any(disturbance):
        out += samples.disturbances @ disturbance
    out[~samples.keep] = np.nan
    for rows in samples.runs:
        if not samples.rated:
            out[rows] -= np.nanmean(out[rows]) if np.any(samples.keep[rows]) else 0.0
        elif filtered:
            _filter_stretches(out, rows, samples, cutoff_hz(samples, rows))
    return out


def _filter_stretches(out: np.ndarray, rows: np.ndarray, samples: GearSamples, cutoff: float) -> None:
    kept = samples.keep[rows]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]]).astype(int)))
    for start, end in zip(edges[::2], edges[1::2]):
        part = rows[start:end]
        if part.size > 2:
            out[part] = gaussian_filter(out[part], samples.time[part], cutoff, noisy=True)


def sensor_part(samples: GearSamples, disturbance: np.ndarray) -> np.ndarray:
    """The coefficients of those disturbances that belong to the sensor (bias), zeros elsewhere."""
    mine = np.array([name == "bias" for name in samples.disturbance_names])
    return np.where(mine, disturbance, 0.0)


def noise_of_error(samples: GearSamples, error: np.ndarray) -> float:
    """White noise in an unfiltered error after the filter, rad/s; between encoders, of the angle itself."""
    squares, counts = [], []
    for rows in samples.runs:
        part = error[rows[samples.keep[rows]]]
        if part.size < 8:
            continue
        share = 1.0
        if samples.rated:
            share = min(1.0, 2.0 * _NOISE_SHARE * cutoff_hz(samples, rows) * typical_step(samples.time[rows]))
        squares.append(share * white_noise(part) ** 2)
        counts.append(part.size)
    return float(np.sqrt(np.average(squares, weights=counts))) if squares else 0.0


def lag_in_error(samples: GearSamples, error: np.ndarray) -> tuple[float, float, float]:
    """By how much (s) the output comes behind the motor as an unfiltered error of rates (N,) has it, its
    standard deviation, and its share of the error's square sum."""
    acceleration = np.zeros(samples.run.size)
    for rows in samples.runs:
        slow = gaussian_filter(samples.rate[rows], samples.time[rows], MOTION_HZ)
        acceleration[rows] = derivative(slow, samples.time[rows])
    used = samples.identification & np.isfinite(error)
    column, left = acceleration[used], error[used]
    normal = float(column @ column)
    if normal == 0.0:
        return 0.0, np.inf, 0.0
    lag = float(column @ left) / normal
    square = float(left @ left)
    share = lag**2 * normal / max(square, np.finfo(float).tiny)
    return lag, float(np.sqrt((1.0 - share) * square / max(left.size - 1, 1) / normal)), share
