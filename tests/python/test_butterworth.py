"""The low-pass beside scipy's, which filters forwards and backwards in time."""

import numpy as np
import pytest
from scipy import signal

from exactarm.numerics.butterworth import butterworth, white_noise_behind


@pytest.mark.parametrize("count, order, cutoff, step", [
    (20000, 4, 20.0, 1e-3), (60001, 8, 80.0, 1e-3), (900, 4, 20.0, 2e-3), (47, 4, 5.0, 2e-2)])
def test_it_takes_what_filters_in_time_take(count, order, cutoff, step):
    time = step * np.arange(count)
    values = np.stack([100.0 * np.sin(0.7 * time) + 3.0 * time, np.sin(40.0 * time),
                       np.random.default_rng(0).standard_normal(count)], axis=1)
    pad = min(count - 1, int(np.ceil(17.0 / (cutoff * step))))
    sections = signal.butter(order, cutoff, fs=1.0 / step, output="sos")
    expected = signal.sosfiltfilt(sections, values, axis=0, padtype="odd", padlen=pad)
    apart = np.abs(butterworth(values, order, cutoff, step) - expected)
    reached = 1e-3 if pad == count - 1 else 1e-7  # a short record ends before the filter has faded
    assert apart.max() < reached * np.abs(values).max()


def test_what_lies_far_below_the_cutoff_passes_and_a_ramp_to_its_ends():
    time = 1e-3 * np.arange(5000)
    ramp = np.stack([2.0 + 3.0 * time, np.sin(time)], axis=1)
    smooth = butterworth(ramp, 4, 20.0, 1e-3)
    assert np.allclose(smooth[:, 0], ramp[:, 0], rtol=0.0, atol=1e-12)
    assert np.allclose(smooth[500:-500], ramp[500:-500], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_samples_stay_numbers(count):
    assert np.isfinite(butterworth(np.arange(2.0 * count).reshape(count, 2), 4, 5.0, 2e-2)).all()


def test_many_columns_are_filtered_alike():
    values = np.random.default_rng(1).standard_normal((500, 150))
    whole = butterworth(values, 4, 30.0, 2e-3)
    alone = butterworth(values[:, 149:], 4, 30.0, 2e-3)[:, 0]
    assert np.allclose(whole[:, 149], alone, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("order, cutoff, step, every",
                         [(8, 80.0, 2e-3, 2), (8, 80.0, 1e-3, 4), (4, 20.0, 1e-3, 5)])
def test_white_noise_behind_it_is_alike_as_far_as_it_says(order, cutoff, step, every):
    """Any seed: 0 to 7 were tried. Of 400 s below 20 Hz some 16,000 numbers are independent: 0.008 each."""
    noise = np.random.default_rng(0).standard_normal((400_000, 1))
    smooth = butterworth(noise, order, cutoff, step)[::every, 0]
    lags = 8
    found = [smooth[: smooth.size - k] @ smooth[k:] for k in range(lags + 1)]
    assert np.allclose(white_noise_behind(order, cutoff, step, every, lags), found / found[0], atol=0.03)
