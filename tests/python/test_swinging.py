"""Swinging: a drive train that swings is told from one that only lags, by the reading where it
accelerates."""

import numpy as np
import pytest

from exactarm.chain.swinging import follows_quietly, swings

RATE_HZ, NOISE, STIFF = 400.0, 1e-3, 2.5e-4  # STIFF: inertia over stiffness, s^2 (10 Hz)


def runs(swing: float, delay: float, seed: int = 3):
    """Two runs with smooth ramps; the reading is tilted, late, and carries `swing` times the bending of a
    spring."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 3.0, 1.0 / RATE_HZ)
    step = lambda t: np.clip(t / 0.25, 0.0,
                             1.0) - np.sin(2.0 * np.pi * np.clip(t / 0.25, 0.0, 1.0)) / (2.0 * np.pi)
    rate = lambda t: step(t - 0.2) - step(t - 2.5)
    first = rate(time)
    bending = -STIFF * np.gradient(np.gradient(first, time), time)
    along = rate(time - delay) + swing * bending
    predicted, bent, read = (np.concatenate([values, -values]) for values in (first, bending, along))
    gyro = read[:, None] * np.array([0.02, -0.01, 1.0]) + random.normal(0.0, NOISE, (read.size, 3))
    parts = [np.arange(time.size), time.size + np.arange(time.size)]
    swinging = np.concatenate([swings(bent[part], time, NOISE) for part in parts])
    return gyro, predicted, bent, np.tile(time, 2), parts, swinging, np.ones(read.size, bool)


@pytest.mark.parametrize("delay", [0.0, 5e-4, 3e-3, 7e-3, 2e-2, -5e-3])
def test_a_lag_is_quiet(delay):
    asked = runs(0.0, delay)
    assert 0.05 < asked[5].mean() < 0.5
    assert follows_quietly(*asked)


@pytest.mark.parametrize("swing", [0.6, 1.0, 1.5])
@pytest.mark.parametrize("delay", [0.0, 1e-3, 6e-3])
def test_a_bending_spring_is_not(swing, delay):
    assert not follows_quietly(*runs(swing, delay))


def test_ringing_is_not_quiet():
    """A link on its spring, driven through the ramps: it rings on after them."""
    gyro, predicted, bent, time, parts, swinging, usable = runs(0.0, 0.0)
    for part in parts:
        q, speed, read = 0.0, 0.0, np.empty(part.size)
        angle = np.cumsum(predicted[part]) / RATE_HZ
        for k, motor in enumerate(angle):
            for _ in range(10):
                speed += 0.1 / RATE_HZ * ((motor - q) / STIFF - 2.0 * speed + 2.0 * predicted[part][k])
                q += 0.1 / RATE_HZ * speed
            read[k] = speed
        gyro[part, 2] += read - predicted[part]
    assert not follows_quietly(gyro, predicted, bent, time, parts, swinging, usable)
