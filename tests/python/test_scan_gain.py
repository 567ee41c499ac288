"""What a candidate's columns earn in a scan: the least-squares solution on the columns that can be used, the
shortest where they depend on each other."""

import numpy as np
import pytest

from exactarm.diagnose.scan import _gain

LENGTHS = np.array([1.0, 30.0, 0.01])


def products(columns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    residual = np.random.default_rng(6).normal(size=len(columns))
    return columns.T @ columns, columns.T @ residual, residual


def test_independent_columns_earn_what_their_fit_explains():
    columns = np.random.default_rng(5).normal(size=(40, 3)) * LENGTHS
    normal, onto, residual = products(columns)
    gain, values = _gain(normal, onto, np.ones(3, bool))
    expected, left = np.linalg.lstsq(columns, residual, rcond=None)[:2]
    assert values == pytest.approx(expected, rel=1e-10)
    assert gain == pytest.approx(residual @ residual - left[0], rel=1e-10)


@pytest.mark.parametrize("apart", [0.0, 1e-9])
def test_columns_that_depend_on_each_other_share_what_they_earn(apart):
    first = np.random.default_rng(5).normal(size=(40, 2))
    normal, onto, _ = products(np.column_stack([first[:, 0], first[:, 0] + apart * first[:, 1]]))
    gain, values = _gain(normal, onto, np.ones(2, bool))
    assert values[0] == pytest.approx(values[1], rel=1e-6)
    assert gain == pytest.approx(onto[0] ** 2 / normal[0, 0], rel=1e-6)


def test_columns_that_cannot_be_used_get_nothing():
    normal, onto, _ = products(np.random.default_rng(5).normal(size=(40, 3)))
    usable = np.array([True, False, True])
    gain, values = _gain(normal, onto, usable)
    part, kept = _gain(normal[np.ix_(usable, usable)], onto[usable], np.ones(2, bool))
    assert values[1] == 0.0 and np.array_equal(values[usable], kept)
    assert gain == pytest.approx(part, rel=1e-14)
    assert _gain(normal, onto, np.zeros(3, bool))[0] == 0.0
