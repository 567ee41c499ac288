"""Spectrum, bandwidth and ringing of accelerations whose content is known."""

import numpy as np
import pytest

from exactarm.plan.spectrum import amplitude, peak_bandwidth, ringing

STEP, COUNT = 1e-3, 2000
TIME = STEP * np.arange(COUNT)


def test_a_sine_has_its_amplitude_at_its_frequency():
    signal = np.stack([3.0 * np.sin(2 * np.pi * 40.0 * TIME), 0.5 * np.cos(2 * np.pi * 7.5 * TIME)], axis=1)
    frequency, height = amplitude(signal, STEP)
    np.testing.assert_allclose(frequency[height.argmax(axis=0)], [40.0, 7.5])
    np.testing.assert_allclose(height.max(axis=0), [3.0, 0.5], rtol=1e-9)


def test_the_bandwidth_ends_where_the_amplitude_falls_below_its_share_of_the_largest_peak():
    loud = np.sin(2 * np.pi * 5.0 * TIME)
    signal = np.stack([loud + 2e-3 * np.sin(2 * np.pi * 60.0 * TIME)
                       + 5e-4 * np.sin(2 * np.pi * 200.0 * TIME),
                       2e-3 * np.sin(2 * np.pi * 10.0 * TIME), 5e-4 * loud], axis=1)
    assert peak_bandwidth(signal, STEP) == (60.0, 10.0, None)


@pytest.mark.parametrize("frequency, gain", [(500.0, 1.0), (100.0, np.sin(0.1 * np.pi) ** 4), (5.0, 0.0)])
def test_ringing_sees_what_alternates_and_nothing_slow(frequency, gain):
    signal = np.cos(2 * np.pi * frequency * TIME)
    expected = gain * (1.0 if frequency == 500.0 else np.sqrt(0.5))
    assert ringing(signal[:, None])[0] == pytest.approx(expected, rel=0.01, abs=1e-6)
