"""Where divide and conquer does not converge, QR iterations give the same; not finite: an error."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from exactarm.numerics.factors import cholesky, lstsq, pinv, svd


@pytest.fixture
def rng():
    return np.random.default_rng(11)


@pytest.fixture
def gives_up(monkeypatch):
    def fail(*_, **__):
        raise np.linalg.LinAlgError("did not converge")

    def begin():
        monkeypatch.setattr(np.linalg, "svd", fail)
        monkeypatch.setattr(np.linalg, "lstsq", fail)

    return begin


@pytest.mark.parametrize("shape", [(9, 4), (4, 9), (5, 6, 3), (2, 3, 3, 3)])
@pytest.mark.parametrize("full", [True, False])
def test_singular_values_are_the_same(rng, gives_up, shape, full):
    matrix = rng.normal(size=shape)
    expected = svd(matrix, full_matrices=full)
    gives_up()
    u, values, vt = svd(matrix, full_matrices=full)
    assert [part.shape for part in (u, values, vt)] == [part.shape for part in expected]
    assert_allclose(values, expected[1], rtol=1e-12)
    assert_allclose(svd(matrix, compute_uv=False), values)
    some = values.shape[-1]
    assert_allclose(u[..., :some] * values[..., None, :] @ vt[..., :some, :], matrix, atol=1e-12)


@pytest.mark.parametrize("shape, dependent", [((12, 4), False), ((12, 4), True), ((3, 5), False)])
@pytest.mark.parametrize("right", [(), (2,)])
def test_least_squares_are_the_same(rng, gives_up, shape, dependent, right):
    matrix, target = rng.normal(size=shape), rng.normal(size=(shape[0], *right))
    if dependent:
        matrix[:, 3] = matrix[:, 0] - 2.0 * matrix[:, 1]
    expected = lstsq(matrix, target, rcond=1e-10)
    gives_up()
    found = lstsq(matrix, target, rcond=1e-10)
    assert found[2] == expected[2]
    for ours, theirs in zip(found, expected):
        assert_allclose(ours, theirs, atol=1e-12)


@pytest.mark.parametrize("shape", [(5, 3), (3, 5), (4, 6, 3)])
def test_pseudoinverses_are_the_same(rng, gives_up, shape):
    matrix = rng.normal(size=shape)
    matrix[..., -1, :] = matrix[..., 0, :]
    expected = np.linalg.pinv(matrix, rcond=1e-10)
    assert_allclose(pinv(matrix, rcond=1e-10), expected, atol=1e-12)
    gives_up()
    assert_allclose(pinv(matrix, rcond=1e-10), expected, atol=1e-12)
    assert_allclose(pinv(np.zeros((3, 2))), np.zeros((2, 3)))


def test_what_is_not_finite_is_an_error(gives_up):
    matrix = np.array([[1.0, np.nan], [0.0, 1.0], [2.0, 0.0]])
    gives_up()
    for asked in (lambda: svd(matrix), lambda: lstsq(matrix, np.ones(3))):
        with pytest.raises(np.linalg.LinAlgError, match="not finite"):
            asked()


def test_a_large_semidefinite_matrix_beside_one_has_a_factor(rng):
    columns = 1e9 * rng.normal(size=(40, 3))
    gram = np.eye(6) + np.hstack([columns, columns]).T @ np.hstack([columns, columns])
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(gram - 1e3 * np.eye(6))  # as rounding may leave it
    lower = cholesky(gram - 1e3 * np.eye(6))
    np.testing.assert_allclose(lower @ lower.T, gram, rtol=1e-9, atol=1e-9 * np.max(gram))
    small = np.eye(6) + 1e-18 * gram
    np.testing.assert_array_equal(cholesky(small), np.linalg.cholesky(small))
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        cholesky(np.full((2, 2), np.nan))
