"""White noise of a signal, and noise that grows towards the band in which arms move."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from exactarm.numerics.white_noise import rise_towards_band, white_noise

RATE_HZ, RUNS, AXES, BAND_HZ = 500.0, 3, 6, 20.0
TIME = np.arange(0.0, 30.0, 1.0 / RATE_HZ)


def noises(memory_s: float) -> list[np.ndarray]:
    """Unit variance, half of it remembered for `memory_s`."""
    random = np.random.default_rng(5)
    memory = np.exp(-1.0 / RATE_HZ / memory_s)
    white, driven = random.standard_normal((2, RUNS, TIME.size, AXES))
    remembered = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], driven, axis=1)
    return list(np.sqrt(0.5) * (white + remembered))


def drives() -> np.ndarray:
    """What moves an arm, its friction turning over, and the ripple of its motors while they turn fast."""
    phase = 2.0 * np.pi * np.linspace(0.1, 0.3, AXES) * TIME[:, None]
    rate = np.cos(phase)
    ripple = 0.5 * np.sin(100.0 * np.sin(phase)) * (np.abs(rate) > 0.7)
    return 80.0 * np.sin(phase) + 20.0 * np.sign(rate) + ripple


def test_white_noise_of_a_smooth_signal():
    time = np.linspace(0.0, 4.0, 8000)
    noisy = np.sin(3.0 * time) + np.random.default_rng(2).normal(0.0, 1e-3, time.size)
    assert_allclose(white_noise(noisy), 1e-3, rtol=0.05)


def test_white_noise_does_not_rise():
    rise = rise_towards_band([noise + drives() for noise in noises(1e-6)], 1.0 / RATE_HZ, BAND_HZ)
    assert_allclose(rise.min(), 1.0, atol=0.15)


@pytest.mark.parametrize("memory_s", [3e-3, 1e-2, 2e-2])
def test_noise_with_a_memory_rises(memory_s):
    """Expected from the density of a first-order memory beside the white half."""
    rise = rise_towards_band(noises(memory_s), 1.0 / RATE_HZ, BAND_HZ)
    memory = np.exp(-1.0 / RATE_HZ / memory_s)
    density = lambda hz: 1.0 + (1.0 - memory**2) / (
        1.0 - 2.0 * memory * np.cos(2.0 * np.pi * hz / RATE_HZ) + memory**2)
    expected = density(np.arange(28.0, 50.0, 4.0)).mean() / density(np.arange(84.0, 225.0, 4.0)).mean()
    assert_allclose(rise, expected, rtol=0.2)
    assert rise.min() > 1.2


def test_slow_sampling_cannot_tell():
    assert rise_towards_band([noise[::5] for noise in noises(1e-2)], 5.0 / RATE_HZ, BAND_HZ) is None
