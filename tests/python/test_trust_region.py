"""The lowest point of a quadratic model, where columns are nearly or wholly dependent on others."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from exactarm.numerics.trust_region import Model

ROWS, COLUMNS, WEAK = 300, 60, 7


def model_of(left):
    """The last columns are sums of the first but for a share `left` of their own; one column is held."""
    rng = np.random.default_rng(7)
    columns = rng.normal(size=(ROWS, COLUMNS))
    mixed = columns[:, :WEAK] @ rng.normal(size=(WEAK, WEAK))
    columns[:, -WEAK:] = mixed + left * columns[:, -WEAK:]
    columns /= np.linalg.norm(columns, axis=0)
    free = np.arange(COLUMNS) != COLUMNS - 2 * WEAK
    return Model(columns, rng.normal(size=ROWS)), free


@pytest.mark.parametrize("left, to", [(1e-3, 1e-9), (1e-6, 1e-6), (1e-9, 1e-3), (0.0, 1e-9)])
def test_the_lowest_point_is_that_of_the_columns_themselves(left, to):
    """Not of their products, which hold half as many digits; of many lowest points the shortest."""
    model, free = model_of(left)
    expected = np.linalg.lstsq(model.jacobian[:, free], -model.residual, rcond=1e-13)[0]
    found = model.lowest(free, model.gradient[free])
    assert_allclose(found, expected, atol=to * np.abs(expected).max())


@pytest.mark.parametrize("left", [3e-13, 0.0])
def test_what_is_neither_seen_nor_lost_is_left_to_the_spectrum(left):
    model, free = model_of(left)
    assert (model.lowest(free, model.gradient[free]) is None) == (left > 0.0)


def test_many_dependent_columns_are_left_to_the_spectrum():
    model, free = model_of(0.0)
    few = free & (np.arange(COLUMNS) < 3 * WEAK) | (np.arange(COLUMNS) >= COLUMNS - WEAK)
    few[3 * WEAK - 1] = False
    assert model.lowest(few, model.gradient[few]) is None


def test_where_pivoting_shows_none_that_depends_on_others_there_is_nothing_to_part():
    """An unpivoted factor may fail of them all the same; J'r of no columns at all was asked for."""
    model, free = model_of(1.0)
    gram = model.gram[np.ix_(free, free)]
    found = model._lowest_in_two(gram, free, model.gradient[free])
    assert_allclose(found, -np.linalg.solve(gram, model.gradient[free]), rtol=1e-9)
