"""Variances of linear numbers: r C r' of every row, of any number of parameters."""

import numpy as np
import pytest

from exactarm.numerics.quadratic import variances


@pytest.mark.parametrize("shape", [(5, 3, 4), (7, 2), (4, 3, 0), (6, 0), (0, 3)])
def test_variances_are_those_of_every_row_by_itself(shape):
    random = np.random.default_rng(1)
    rows, root = random.normal(size=shape), random.normal(size=(shape[-1], shape[-1]))
    found = variances(rows, root @ root.T)
    each = [row @ root @ root.T @ row for row in rows.reshape(int(np.prod(shape[:-1])), shape[-1])]
    assert found.shape == shape[:-1]
    np.testing.assert_allclose(found.ravel(), each, rtol=1e-12)
