"""Poses that are reached again are rounded alike: whitening, likelihood and intervals know it, against dense
matrices. Seeds by number; none was changed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from exactarm.noise.estimate import estimate_noise, normal_noise
from exactarm.noise.model import NoiseModel
from exactarm.noise.rounding import evened
from exactarm.noise.sharing import shared_covariance

POSES, VISITS, M, AXES = 60, 3, 6, 5
VISIT = np.repeat(np.arange(POSES), VISITS)
SIGMA = np.array([3e-5] * 3 + [2e-4] * 3)


def set_up(seed, size=1.0):
    """A rounding (N, m, n) that another set-up, at every third row, sees turned, and rows (N, m) with it."""
    random = np.random.default_rng(seed)
    rounding = size * np.repeat(random.normal(0.0, 1.0, (POSES, M, AXES)), VISITS, axis=0) * SIGMA[:, None]
    turn = stats.special_ortho_group.rvs(3, random_state=seed)
    turned = np.kron(np.eye(2), turn)
    rounding[::3] = turned @ rounding[::3]
    unit = random.uniform(-np.sqrt(3.0), np.sqrt(3.0), (POSES, AXES))
    error = np.einsum("nij,nj->ni", rounding, unit[VISIT])
    return rounding, error + random.normal(0.0, 1.0, (POSES * VISITS, M)) * SIGMA, random


def dense(model):
    """(N m, N m) covariance."""
    rows = len(model.visits)
    same = model.visits[:, None] == model.visits
    covariance = np.einsum("aik,bjk->aibj", model.rounding, model.rounding) * same[:, None, :, None]
    each = np.diag(model.sigma**2)
    covariance += model.shared * np.einsum("ab,ij->aibj", same, each)
    covariance += np.einsum("ab,ij->aibj", np.diag(1.0 / model.weight), each)
    return covariance.reshape(rows * len(each), -1)


@pytest.fixture(scope="module")
def model():
    rounding, _, random = set_up(1)
    weight = random.uniform(0.4, 1.0, len(VISIT))
    return NoiseModel(SIGMA, weight, visits=VISIT, shared=0.4, rounding=rounding)


def test_whitened_rows_are_independent(model):
    size = len(VISIT) * M
    columns = np.eye(size).reshape(len(VISIT), M, size)
    white = model.whiten(columns)
    assert_allclose(white @ dense(model) @ white.T, np.eye(size), atol=1e-9)


def test_the_density_is_that_of_the_covariance(model):
    plain = NoiseModel(SIGMA, np.ones(len(VISIT)), visits=VISIT, shared=0.4, rounding=model.rounding)
    _, residual, random = set_up(2)
    law = stats.multivariate_normal(cov=dense(plain))
    ours = [plain.log_density(each, None) for each in (residual, 0.5 * residual)]
    assert_allclose(ours[0] - ours[1], law.logpdf(residual.ravel()) - law.logpdf(0.5 * residual.ravel()))
    declared = random.normal(0.0, 1e-4, (len(VISIT), M, 4))
    flat, inverse = declared.reshape(-1, 4), np.linalg.inv(dense(plain))
    information = flat.T @ inverse @ flat
    best = np.linalg.solve(information, flat.T @ inverse @ residual.ravel())
    restricted = (law.logpdf(residual.ravel() - flat @ best) - 0.5 * np.linalg.slogdet(information)[1]
                  + 0.5 * residual.size * np.log(2.0 * np.pi))
    assert_allclose(plain.log_density(residual, declared), restricted, rtol=1e-9)


@pytest.mark.parametrize("size", [0.5, 1.0, 3.0])
@pytest.mark.slow
def test_rounding_is_told_from_commanded_angles_on_a_grid(size):
    """The noise beside it is found in both cases; twenty sets each."""
    for seed in range(20):
        rounding, residual, random = set_up(seed, size)
        found = estimate_noise(residual, 0.0, VISIT, rounding=rounding)
        assert found.rounding is not None
        assert_allclose(found.sigma, SIGMA, rtol=0.25)
        exact = random.normal(0.0, 1.0, residual.shape) * SIGMA
        assert normal_noise(exact, 0.0, VISIT, rounding).rounding is None


def test_evened_rows_scatter_as_without_rounding():
    """3,000 rows that share nothing: of 60 poses with three visits each the scale itself is uncertain (seed 4
    gave 0.80 to 1.04 of it)."""
    random = np.random.default_rng(4)
    rounding = random.normal(0.0, 1.0, (3000, M, AXES)) * SIGMA[:, None]
    unit = random.uniform(-np.sqrt(3.0), np.sqrt(3.0), (3000, AXES))
    residual = np.einsum("nij,nj->ni", rounding, unit) + random.normal(0.0, 1.0, (3000, M)) * SIGMA
    even = evened(residual, rounding, np.array([3, 3]))
    assert_allclose(np.sqrt(np.mean(even**2, axis=0)), SIGMA, rtol=0.06)


def test_intervals_know_that_poses_are_rounded_alike(model):
    rounding, _, random = set_up(5)
    noise = NoiseModel(SIGMA, np.ones(len(VISIT)), visits=VISIT, rounding=rounding)
    columns = random.normal(0.0, 1.0, (len(VISIT), M, 3))
    found = shared_covariance(columns, np.zeros((0, 3)), noise, VISIT, None, rounding)
    row = np.sqrt(np.mean(np.sum((rounding / SIGMA[:, None]) ** 2, axis=2)) + 1.0)
    scale = np.tile(SIGMA, len(VISIT))
    covariance = dense(noise) / np.outer(scale, scale) / row**2
    flat = columns.reshape(-1, 3)
    inverse = np.linalg.inv(flat.T @ flat)
    assert_allclose(found, inverse @ flat.T @ covariance @ flat @ inverse, rtol=1e-9)
