"""Sums of numbers by their logarithms."""

import numpy as np
from scipy import special

from exactarm.numerics.log_sum import log_sum


def test_a_sum_is_that_of_the_library_far_beyond_the_range_of_doubles():
    rng = np.random.default_rng(1)
    logs = rng.normal(size=(7, 40, 3)) * 10.0 ** rng.uniform(-3, 5, (40, 3))
    assert np.ptp(logs) > 1e4
    np.testing.assert_allclose(log_sum(logs), special.logsumexp(logs, axis=0), rtol=1e-14, atol=1e-14)
