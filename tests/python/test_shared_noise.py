"""Intervals of a fit whose rows share noise: they hold the truth, where those of independent rows do not."""

import numpy as np
import pytest

from exactarm.noise.model import NoiseModel
from exactarm.noise.sharing import shared_covariance
from exactarm.noise.wandering import Wandering, kernel

ROWS, REPEATS = 150, 300


def inside(columns, cover, covariance):
    """(k,) share of repeats of least squares whose 95 % intervals hold the truth; cover (N, N) of the rows,
    each component by itself."""
    rng, k = np.random.default_rng(21), columns.shape[2]
    root, flat = np.linalg.cholesky(cover + 1e-12 * np.eye(len(cover))), columns.reshape(-1, k)
    solve = np.linalg.pinv(flat)
    found = np.zeros(k)
    for _ in range(REPEATS):
        noise = root @ rng.standard_normal((len(cover), columns.shape[1]))
        found += np.abs(solve @ noise.ravel()) < 1.96 * np.sqrt(np.diag(covariance))
    return found / REPEATS


@pytest.fixture
def columns():
    """(N, 3, 4): a shift of the device, a drift of it, and two turns that change from pose to pose."""
    rng = np.random.default_rng(20)
    found = rng.standard_normal((ROWS, 3, 4))
    found[:, :, 0] = [1.0, 0.0, 0.0]
    found[:, :, 1] = np.linspace(-1.0, 1.0, ROWS)[:, None] * [0.0, 1.0, 1.0]
    return found


@pytest.mark.parametrize("ratio, memory", [(1.0, 6.0), (3.0, 20.0)])
def test_intervals_hold_the_truth_where_neighbours_share_noise(columns, ratio, memory):
    order = np.arange(float(ROWS))
    cover = (np.eye(ROWS) + ratio * kernel(order, memory)) / (1.0 + ratio)
    noise = NoiseModel(np.ones(3), np.ones(ROWS), wandering=Wandering(ratio, memory, 0.0), order=order)
    shared = shared_covariance(columns, np.zeros((0, 4)), noise, np.arange(ROWS), order, None)
    alone = np.linalg.inv(columns.reshape(-1, 4).T @ columns.reshape(-1, 4))
    assert np.all(np.abs(inside(columns, cover, shared) - 0.95) < 4.0 * np.sqrt(0.95 * 0.05 / REPEATS))
    assert np.all(inside(columns, cover, alone)[:2] < 0.75)  # what stays from row to row
    # the chance correlation of 150 random rows, about 1 / sqrt(150) times a few rows of memory
    assert np.sqrt(np.diag(shared) / np.diag(alone))[2:] == pytest.approx(1.0, abs=0.2)


def test_intervals_hold_the_truth_where_visits_share_noise(columns):
    visits = np.repeat(np.arange(ROWS // 3), 3)
    same = columns[3 * visits]  # three visits of each pose
    cover = (np.eye(ROWS) + 2.0 * (visits[:, None] == visits)) / 3.0
    noise = NoiseModel(np.ones(3), np.ones(ROWS), visits=visits, shared=2.0)
    shared = shared_covariance(same, np.zeros((0, 4)), noise, visits, None, None)
    alone = np.linalg.inv(same.reshape(-1, 4).T @ same.reshape(-1, 4))
    assert np.all(np.abs(inside(same, cover, shared) - 0.95) < 4.0 * np.sqrt(0.95 * 0.05 / REPEATS))
    assert np.all(inside(same, cover, alone) < 0.9)


def test_rows_that_share_nothing_have_the_covariance_of_independent_ones(columns):
    noise = NoiseModel(np.ones(3), np.ones(ROWS))
    prior = np.diag([0.0, 0.0, 5.0, 0.0])
    flat = columns.reshape(-1, 4)
    found = shared_covariance(columns, prior, noise, np.arange(ROWS), None, None)
    np.testing.assert_allclose(found, np.linalg.inv(flat.T @ flat + prior.T @ prior), rtol=1e-10)
