"""Orthonormal bases: of dependent columns, and one that grows by further columns."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from exactarm.numerics.orthonormal import added_to, extended, narrowed, orthonormal, shown


@pytest.fixture
def rng():
    return np.random.default_rng(31)


def projection(basis):
    return basis @ basis.T


def test_a_basis_that_grows_spans_what_one_of_all_columns_spans(rng):
    columns, more = rng.normal(size=(80, 6)), 1e3 * rng.normal(size=(80, 4))
    basis = extended(orthonormal(columns), more)
    assert_allclose(basis.T @ basis, np.eye(10), atol=1e-14)
    assert_allclose(projection(basis), projection(orthonormal(np.column_stack([columns, more]))), atol=1e-12)


def test_what_a_basis_holds_already_does_not_make_it_grow(rng):
    columns = rng.normal(size=(80, 6))
    weak = columns @ rng.normal(size=(6, 3))
    weak[:, 2] += 1e-4 * rng.normal(size=80)  # a part of it is new, and has to come out clean
    basis = extended(orthonormal(columns), np.column_stack([weak, np.zeros(80)]))
    assert basis.shape == (80, 7)
    assert_allclose(basis.T @ basis, np.eye(7), atol=1e-13)


@pytest.mark.parametrize("weakest, kept", [(1e-6, 4), (1e-7, 5)])
def test_directions_weaker_than_asked_for_are_left_out(rng, weakest, kept):
    left, right = (np.linalg.qr(rng.normal(size=(n, 6)))[0] for n in (80, 6))
    sizes = np.array([1.0, 0.1, 1e-3, 1e-5, 4e-7, 1e-12])
    columns = (left * sizes) @ right.T
    columns = columns / np.linalg.norm(columns, axis=0).mean()
    basis = orthonormal(columns, weakest)
    assert basis.shape == (80, kept)
    assert_allclose(basis.T @ basis, np.eye(kept), atol=1e-14)


def test_a_basis_without_some_columns_spans_the_others(rng):
    columns = rng.normal(size=(80, 7)) * 10.0 ** rng.uniform(-6, 6, 7)
    columns[:, 2] = columns[:, :2] @ [1.0, 2.0] + 1e-4 * columns[:, 2] * np.linalg.norm(columns[:, :2])
    gone = np.isin(np.arange(7), [2, 5])
    whole = orthonormal(columns)
    basis = narrowed(whole, np.linalg.inv(whole.T @ columns), gone)
    assert_allclose(basis.T @ basis, np.eye(5), atol=1e-14)
    assert_allclose(projection(basis), projection(orthonormal(columns[:, ~gone])), atol=1e-9)


def test_a_column_of_rounding_is_no_direction(rng):
    columns = rng.normal(size=(80, 3)) * [1.0, 1e3, 1e-14]
    assert orthonormal(columns).shape == (80, 2)
    assert added_to(np.zeros((80, 0)), columns).shape == (80, 2)


def test_a_column_too_small_to_have_a_length_is_none():
    """Its square is zero: a fit ended in a fault."""
    columns = np.random.default_rng(2).normal(size=(50, 3)) * [1.0, 1e-170, 0.0]
    assert shown(columns, 1e-9).shape == (50, 1)


def test_weak_directions_count_as_far_as_is_asked(rng):
    columns = rng.normal(size=(50, 3)) * [1.0, 1e6, 1e-6]
    columns = np.column_stack([columns, columns[:, 0] + 1e-8 * rng.normal(size=50)])
    assert shown(columns, 1e-6).shape == (50, 3)
    basis = shown(columns, 1e-10)
    np.testing.assert_allclose(basis.T @ basis, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(basis @ (basis.T @ columns), columns, rtol=1e-9, atol=1e-12)
