"""Smoothness over a space: white noise is none, a bump in one corner and a product of two angles are."""

import numpy as np
import pytest

from exactarm.diagnose.smoothness import closeness, follows_space, second_order
from exactarm.numerics.orthonormal import orthonormal

ROWS = 90


@pytest.fixture
def rng():
    return np.random.default_rng(12)


def case(rng, bump=0.0):
    """Residual (ROWS, 3) free of a fitted linear model, its basis, the patterns and the kernel."""
    points = rng.uniform(-1.5, 1.5, (ROWS, 3))
    columns = np.zeros((ROWS, 3, 12))
    for k in range(3):
        columns[:, k, 4 * k : 4 * k + 4] = np.column_stack([np.ones(ROWS), points])
    basis = orthonormal(columns.reshape(3 * ROWS, -1))
    residual = rng.normal(size=(ROWS, 3))
    residual[:, 1] += bump * np.exp(-0.5 * np.sum((points - 0.8) ** 2, axis=1) / 0.6**2)
    flat = residual.ravel()
    residual = (flat - basis @ (basis.T @ flat)).reshape(-1, 3)
    patterns = [np.tile(np.eye(3)[k], (ROWS, 1)) for k in range(3)]
    return residual, basis, patterns, closeness(points, 1.0)


@pytest.mark.slow
def test_p_values_of_noise_are_evenly_spread(rng):
    """Of 400 draws as many lie under 0.05 and 0.01 as should, within four standard errors."""
    p = np.array([follows_space(*case(rng))[0] for _ in range(400)])
    for level in (0.05, 0.01):
        assert abs(np.mean(p < level) - level) < 4.0 * np.sqrt(level * (1.0 - level) / p.size)
    assert 0.4 < np.median(p) < 0.6


def test_noise_of_uneven_size_is_no_structure(rng):
    count = 0
    for _ in range(100):
        residual, basis, patterns, kernel = case(rng)
        uneven = (residual * np.exp(rng.normal(0.0, 0.5, (ROWS, 1)))).ravel()
        count += follows_space((uneven - basis @ (basis.T @ uneven)).reshape(-1, 3), basis, patterns,
                               kernel)[0] < 1e-3
    assert count <= 2


def test_noise_that_grows_with_the_distance_is_no_structure():
    """Near and far rows with frames of their own, near ones noisier: without what P leaves of each row 24 of
    30 draws, the first ones, lay under 0.05. One or two are expected there; seven is five standard errors
    more."""
    count = 0
    for seed in range(30):
        rng, far = np.random.default_rng(seed), np.arange(150) % 3 == 0
        points = rng.normal(size=(150, 3)) * np.where(far, 0.3, 1.5)[:, None] + np.outer(far, [4.0, 0.0, 0.0])
        columns = np.concatenate([np.kron(np.column_stack([np.ones(150), points]), np.eye(3)),
                                  np.kron(np.column_stack([np.ones(150), points]) * ~far[:, None],
                                          np.eye(3))], axis=1)
        basis = orthonormal(columns)
        noise = (rng.normal(size=(150, 3)) * np.where(far, 1.0, 3.0)[:, None]).ravel()
        residual = (noise - basis @ (basis.T @ noise)).reshape(-1, 3)
        patterns = [np.tile(np.eye(3)[k], (150, 1)) for k in range(3)]
        count += follows_space(residual, basis, patterns, closeness(points, 1.0))[0] < 0.05
    assert count <= 7


def test_bump_is_found_with_its_share(rng):
    residual, basis, patterns, kernel = case(rng, bump=5.0)
    p_value, share = follows_space(residual, basis, patterns, kernel)
    assert p_value < 1e-5 and 0.1 < share <= 1.0


def test_more_than_the_fit_leaves_free_says_nothing(rng):
    residual, _, patterns, kernel = case(rng)
    assert follows_space(residual, np.eye(3 * ROWS), patterns, kernel) == (1.0, 0.0)


def test_second_order_surface_holds_every_product(rng):
    angles = rng.normal(size=(40, 4))
    columns = second_order(angles)
    assert columns.shape == (40, 1 + 4 + 10)
    target = angles[:, 1] * angles[:, 3] - angles[:, 0] ** 2
    left = target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]
    np.testing.assert_allclose(left, 0.0, atol=1e-12)


def test_rows_that_lie_far_apart_say_nothing():
    residual, apart = np.ones((20, 3)), np.eye(20)  # failed before: division by zero, a tracked straight line
    none = np.zeros((60, 1))
    assert follows_space(residual, none, [residual], apart) == (1.0, 0.0)
    assert follows_space(residual, none, [np.zeros((20, 3))], np.ones((20, 20))) == (1.0, 0.0)
