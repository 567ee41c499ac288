"""The memory of noise is told though many fitted columns have followed its slow part."""

import numpy as np
import pytest

from exactarm.noise.restricted_memory import restricted_share
from exactarm.numerics.orthonormal import orthonormal

ROWS, STEP_S = 2600, 0.004


def left_of(shared: float, memory_s: float, seed: int, columns: int = 9):
    """Residual (ROWS, 3) of noise of which a share has a memory, free of slow columns, and these; the
    independent numbers per number that it has."""
    rng = np.random.default_rng(seed)
    rho = np.exp(-STEP_S / memory_s)
    slow = np.zeros((ROWS, 3))
    slow[0] = rng.normal(size=3)
    for k in range(1, ROWS):
        slow[k] = rho * slow[k - 1] + np.sqrt(1.0 - rho**2) * rng.normal(size=3)
    noise = (np.sqrt(shared) * slow + np.sqrt(1.0 - shared) * rng.normal(size=(ROWS, 3))).ravel()
    waves = np.cos(np.pi * np.outer(np.linspace(0.0, 1.0, ROWS), np.arange(columns)))
    basis = orthonormal(np.kron(waves, np.eye(3)))
    residual = (noise - basis @ (basis.T @ noise)).reshape(-1, 3)
    return residual, basis, 1.0 / (1.0 - shared + shared * (1.0 + rho) / (1.0 - rho))


def share(residual, basis, runs=(np.arange(ROWS),)):
    return restricted_share(residual, basis, runs, STEP_S, 1.0)


@pytest.mark.parametrize("seed", range(4))  # the first four, here and below
def test_white_noise_has_none(seed):
    residual, basis, _ = left_of(0.0, 1.0, seed)
    assert share(residual, basis) == 1.0


@pytest.mark.parametrize("shared, memory_s", [(0.5, 0.2), (0.5, 0.1), (0.9, 0.03)])
def test_independent_numbers_are_those_of_the_noise(shared, memory_s):
    """Within the steps of the grid: the next memory is 2.1 times as long, the next share up to 2.5 times."""
    for seed in range(4):
        residual, basis, true = left_of(shared, memory_s, seed)
        assert 0.5 * true < share(residual, basis) < 2.0 * true


def test_two_runs_tell_what_one_does():
    residual, basis, true = left_of(0.5, 0.1, 1)
    halves = (np.arange(ROWS // 2), np.arange(ROWS // 2, ROWS))
    assert 0.5 * true < share(residual, basis, halves) < 2.0 * true


def test_rows_that_are_left_out_say_nothing():
    residual, basis, _ = left_of(0.5, 0.1, 2)
    assert share(np.zeros_like(residual), basis) == 1.0
