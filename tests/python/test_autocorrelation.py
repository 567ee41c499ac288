"""Autocorrelation of samples in runs: stubs beside gaps count as what they are."""

import numpy as np
import pytest

from exactarm.diagnose.coloured_noise import _share_of, autoregressive_share, filtered_share
from exactarm.noise.autocorrelation import autocorrelation, lags_within, uncertainty

STEP = 0.01


@pytest.fixture(scope="module")
def remembered():
    """Noise (4000, 1) of a memory of ten samples, its runs, and the same runs with two samples cut off."""
    rng = np.random.default_rng(5)
    noise = np.zeros((4000, 1))
    for k in range(1, len(noise)):
        noise[k] = 0.9 * noise[k - 1] + rng.normal()
    halves = [np.arange(2000), np.arange(2000, 4000)]
    return noise, halves, [halves[0][:2], halves[0][2:], halves[1]]


def test_a_run_shorter_than_the_lags_adds_what_it_has():
    values = np.array([1.0, 2.0, 0.5, -1.0, 3.0, 1.0, -2.0])
    runs = [np.arange(5), np.arange(5, 7)]
    expected = [sum(values[a] * values[b] for run in runs for a in run for b in run if b - a == k)
                for k in range(4)]
    np.testing.assert_allclose(autocorrelation(values, runs, 3), np.array(expected) / expected[0], atol=1e-15)


def test_a_stub_beside_a_gap_does_not_shorten_the_memory_of_noise(remembered):
    noise, halves, cut = remembered
    assert lags_within(cut, 1.0, STEP) == lags_within(halves, 1.0, STEP) == 100
    assert _share_of(noise, cut, STEP) == pytest.approx(_share_of(noise, halves, STEP), rel=0.02)
    assert _share_of(noise, cut, STEP) < 0.1  # (1 - 0.9) / (1 + 0.9) of an autoregression
    assert autoregressive_share(noise, cut, STEP) == pytest.approx(autoregressive_share(noise, halves, STEP),
                                                                   rel=0.02)


def test_intervals_with_a_stub_are_as_wide_as_without(remembered):
    noise, halves, cut = remembered
    of = lambda runs: uncertainty(np.ones((len(noise), 1, 1)), noise, np.ones(1), runs,
                                  STEP).covariance[0, 0]
    assert of(cut) == pytest.approx(of(halves), rel=0.02)


def test_runs_that_are_all_short_bound_the_lags():
    assert lags_within([np.arange(8)] * 50, 1.0, STEP) == 2


def moving_mean(width):
    """Autocorrelation of white noise behind a mean over so many samples."""
    return lambda lags: np.maximum(1.0 - np.arange(lags + 1) / width, 0.0)


def test_a_filter_leaves_as_many_independent_numbers_as_it_is_wide():
    """The variance of a sum over all rows in use says how many they are: N^2 / var(sum), sigma = 1."""
    rng, rows, width = np.random.default_rng(3), 1000, 8
    noise = rng.normal(size=(4000, rows + width - 1))
    filtered = np.lib.stride_tricks.sliding_window_view(noise, width, axis=1).sum(axis=2) / np.sqrt(width)
    for used in (np.ones(rows, bool), rng.random(rows) < 0.3, np.arange(rows) % 50 < 10):
        measured = used.sum() / np.var(filtered[:, used].sum(axis=1))
        share = filtered_share(moving_mean(width), used, [np.arange(rows)], STEP)
        assert share == pytest.approx(measured, rel=0.06)  # 4,000 sums tell a variance to 2.2 %
