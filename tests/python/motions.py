"""Smooth motions for tests: a few harmonics on every axis, known in closed form."""

from __future__ import annotations

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.robot.robot import Robot


def fourier_motion(robot: Robot, seconds: float, rate_hz: float, seed: int, base_hz: float = 0.2,
                   amplitude: float = 0.6):
    """time (N,), output angles (N, n) in rad and their first and second derivatives, of a periodic motion."""
    random = np.random.default_rng(seed)
    time = np.arange(int(seconds * rate_hz)) / rate_hz
    angle, rate, acceleration = (np.zeros((time.size, robot.axes)) for _ in range(3))
    for harmonic in (1, 2, 3, 5):
        w = 2.0 * np.pi * base_hz * harmonic
        size = amplitude / harmonic * random.uniform(0.3, 1.0, robot.axes)
        phase = random.uniform(0.0, 2.0 * np.pi, robot.axes)
        s, c = np.sin(w * time[:, None] + phase), np.cos(w * time[:, None] + phase)
        angle += size * s
        rate += size * w * c
        acceleration -= size * w**2 * s
    return time, angle, rate, acceleration


def motion_data(robot: Robot, time, angle, torque=None, **more) -> Dataset:
    """A motion log: motor angles by the constant ratio, and a torque (zero where none is given)."""
    torque = np.zeros_like(angle) if torque is None else torque
    return Dataset.of_arrays("motion", {"theta": angle * robot.ratios, "tau": torque}, time=time, **more)
