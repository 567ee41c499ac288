"""Drifting noise: the filter leaves white what a first-order autoregression makes, run by run."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from exactarm.noise.drifting import DriftingNoise

MEMORY = np.array([0.9, 0.6])


def drifting(rows: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A stationary autoregression (N, 2) of unit steps, sample by sample, and its steps."""
    random = np.random.default_rng(seed)
    steps = random.normal(0.0, 1.0, (rows, 2))
    values = np.empty_like(steps)
    values[0] = steps[0] / np.sqrt(1.0 - MEMORY**2)
    for t in range(1, rows):
        values[t] = MEMORY * values[t - 1] + steps[t]
    return values, steps


def two_runs():
    (first, a), (second, b) = drifting(3000, 1), drifting(2000, 2)
    runs = (np.arange(3000), 3000 + np.arange(2000))
    return np.concatenate([first, second]), np.concatenate([a, b]), runs


def test_filter_gives_the_steps_back():
    values, steps, runs = two_runs()
    assert_allclose(DriftingNoise(runs, MEMORY).white(values), steps, atol=1e-12)


def test_tangents_pass_like_values():
    values, _, runs = two_runs()
    noise = DriftingNoise(runs, MEMORY)
    tangents = np.stack([values, -2.0 * values], axis=2)
    assert_allclose(noise.white(tangents)[:, :, 1], -2.0 * noise.white(values), atol=1e-12)


def test_memory_is_found():
    values, _, runs = two_runs()
    assert_allclose(DriftingNoise.of(values, runs).memory, MEMORY, atol=0.03)


def test_white_noise_has_none():
    assert DriftingNoise.of(np.random.default_rng(3).normal(size=(4000, 2)), (np.arange(4000),)) is None


def test_a_line_through_drift_is_as_uncertain_as_it_is_said_to_be():
    """Slopes fitted to pure drift scatter as the filtered fit claims, and several times more than the plain
    fit does."""
    rows, line = 400, np.linspace(-1.0, 1.0, 400)[:, None] * np.ones(2)
    runs = (np.arange(rows),)
    noise = DriftingNoise(runs, MEMORY)
    column, slopes = noise.white(line), []
    for seed in range(200):
        values, _ = drifting(rows, seed)
        slopes.append(np.sum(column * noise.white(values), axis=0) / np.sum(column**2, axis=0))
    claimed = 1.0 / np.sqrt(np.sum(column**2, axis=0))
    assert_allclose(np.std(slopes, axis=0), claimed, rtol=0.15)
    plain = np.sqrt(1.0 / (1.0 - MEMORY**2)) / np.sqrt(np.sum(line**2, axis=0))
    assert claimed[0] > 3.0 * plain[0] and claimed[1] == pytest.approx(2.0 * plain[1], rel=0.3)
