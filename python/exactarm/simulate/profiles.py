"""Motions that a measurement asks for: constant-speed runs for gears, Fourier series for the dynamics.

Angles are joint angles q of the nominal robot in rad; every motion stays within the declared limits of its
axes.
"""

from __future__ import annotations

import numpy as np

from exactarm.robot.robot import Robot

_NO_LIMIT = {"q_min": -2.0, "q_max": 2.0, "q_dot_max": 2.0, "q_ddot_max": 6.0}
_MARGIN = 0.05  # of the range, left at either end
_HARMONICS = 5  # Swevers et al. 1997
_SHARE = 0.6  # of the largest rate and acceleration
LEAST_OF_A_RUN = 8  # samples: rates are differences of eighth order


def limit(robot: Robot, name: str) -> np.ndarray:
    """(n,) a declared limit, or a modest one where none is declared."""
    return np.array([_NO_LIMIT[name] if (value := getattr(joint, name)) is None else value
                     for joint in robot.joints])


def trapezoid(distance: float, speed: float, acceleration: float, rate_hz: float, rest_s: float = 0.1):
    """time (N,), way (N,) of a motion from rest to rest with constant speed in the middle."""
    ramp = min(speed / acceleration, np.sqrt(distance / acceleration))
    top = acceleration * ramp
    cruise = distance / top - ramp
    time = np.arange(int(np.ceil((2.0 * rest_s + 2.0 * ramp + cruise) * rate_hz))) / rate_hz
    t = np.clip(time - rest_s, 0.0, 2.0 * ramp + cruise)
    up, flat, down = np.minimum(t, ramp), np.clip(t - ramp, 0.0,
                                                  cruise), np.clip(t - ramp - cruise, 0.0, ramp)
    return time, 0.5 * acceleration * up**2 + top * (flat + down) - 0.5 * acceleration * down**2


def gear_run(robot: Robot, axis: int, speed: float, upwards: bool, rate_hz: float):
    """time (N,), q (N, n): one axis (from 0) passes through its range at constant speed, the others at
    mid-range."""
    low, high = limit(robot, "q_min"), limit(robot, "q_max")
    start, end = low[axis] + _MARGIN * (high - low)[axis], high[axis] - _MARGIN * (high - low)[axis]
    time, way = trapezoid(end - start, speed, float(limit(robot, "q_ddot_max")[axis]), rate_hz)
    q = np.tile(0.5 * (low + high), (time.size, 1))
    q[:, axis] = start + way if upwards else end - way
    return time, q


def excitation(robot: Robot, seconds: float, rate_hz: float, random: np.random.Generator):
    """time (N,), q (N, n): a random Fourier series over the whole time on every axis, from rest to rest.

    The start is brought to rest by a smooth window of a tenth of the time at both ends.
    """
    time = np.arange(int(round(seconds * rate_hz))) / rate_hz
    low, high = limit(robot, "q_min"), limit(robot, "q_max")
    slowest = 2.0 * np.pi * max(1.0 / seconds, 0.1)
    wave = np.zeros((time.size, robot.axes))
    for k in range(1, _HARMONICS + 1):
        phase = random.uniform(0.0, 2.0 * np.pi, robot.axes)
        wave += random.normal(0.0, 1.0 / np.sqrt(k), robot.axes) * np.sin(k * slowest * time[:, None] + phase)
    wave *= _window(time / time[-1])[:, None]
    rate = np.gradient(wave, time, axis=0)
    acceleration = np.gradient(rate, time, axis=0)
    peak = lambda values: np.maximum(np.max(np.abs(values), axis=0), 1e-12)
    scale = np.minimum.reduce([
        (0.5 - _MARGIN) * (high - low) / peak(wave),
        _SHARE * limit(robot, "q_dot_max") / peak(rate),
        _SHARE * limit(robot, "q_ddot_max") / peak(acceleration),
    ])
    return time, 0.5 * (low + high) + wave * scale


def _window(s: np.ndarray, part: float = 0.1) -> np.ndarray:
    """0 at both ends of [0, 1], 1 in the middle, with three continuous derivatives (order-7 polynomial)."""
    x = np.clip(np.minimum(s, 1.0 - s) / part, 0.0, 1.0)
    return x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3)
