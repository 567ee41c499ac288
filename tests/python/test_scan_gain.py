"""What a candidate's columns earn in a scan: the least-squares solution on the columns that can be used, the
shortest where they depend on each other."""

import numpy as np
import pytest

from exactarm.diagnose.scan import _gains

LENGTHS = np.array([1.0, 30.0, 0.01])


def gain_of(normal, onto, usable):
    gain, values = _gains(normal[None], onto[None], usable[None])
    return gain[0], values[0]


def products(columns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    residual = np.random.default_rng(6).normal(size=len(columns))
    return columns.T @ columns, columns.T @ residual, residual


def test_independent_columns_earn_what_their_fit_explains():
    columns = np.random.default_rng(5).normal(size=(40, 3)) * LENGTHS
    normal, onto, residual = products(columns)
    gain, values = gain_of(normal, onto, np.ones(3, bool))
    expected, left = np.linalg.lstsq(columns, residual, rcond=None)[:2]
    assert values == pytest.approx(expected, rel=1e-10)
    assert gain == pytest.approx(residual @ residual - left[0], rel=1e-10)


@pytest.mark.parametrize("apart", [0.0, 1e-9])
def test_columns_that_depend_on_each_other_share_what_they_earn(apart):
    first = np.random.default_rng(5).normal(size=(40, 2))
    normal, onto, _ = products(np.column_stack([first[:, 0], first[:, 0] + apart * first[:, 1]]))
    gain, values = gain_of(normal, onto, np.ones(2, bool))
    assert values[0] == pytest.approx(values[1], rel=1e-6)
    assert gain == pytest.approx(onto[0] ** 2 / normal[0, 0], rel=1e-6)


def test_columns_that_cannot_be_used_get_nothing():
    normal, onto, _ = products(np.random.default_rng(5).normal(size=(40, 3)))
    usable = np.array([True, False, True])
    gain, values = gain_of(normal, onto, usable)
    part, kept = gain_of(normal[np.ix_(usable, usable)], onto[usable], np.ones(2, bool))
    assert values[1] == 0.0 and values[usable] == pytest.approx(kept, rel=1e-12)
    assert gain == pytest.approx(part, rel=1e-14)
    assert gain_of(normal, onto, np.zeros(3, bool))[0] == 0.0


def test_many_at_once_are_each_alone():
    random = np.random.default_rng(8)
    each = [products(random.normal(size=(40, 3)))[:2] for _ in range(5)]
    usable = random.random((5, 3)) < 0.7
    gains, values = _gains(*map(np.stack, zip(*each)), usable)
    for (normal, onto), mask, gain, value in zip(each, usable, gains, values):
        alone = gain_of(normal, onto, mask)
        assert gain == pytest.approx(alone[0], rel=1e-12) and value == pytest.approx(alone[1], rel=1e-12)
