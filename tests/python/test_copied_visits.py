"""Rows that were written twice are no repeated visits: the noise is not nothing.

Seeds: none exchanged; with 10, 20, 30 and 40 added to them both tests hold as well.
"""

import numpy as np

import exactarm as ea
from exactarm.noise.estimate import estimate_noise
from set_ups import joints_in_limits, measured, true_robot
from six_axis import six_axis

NOISE_M = 3e-5


def test_the_noise_of_copied_rows_is_shared_by_them_and_of_its_size():
    e = np.random.default_rng(1).normal(0.0, NOISE_M, (60, 3))
    noise = estimate_noise(np.tile(e, (2, 1)), 0.0, np.tile(np.arange(60), 2))
    whole = float(np.sqrt(np.mean(noise.sigma**2) * (1.0 + noise.shared)))
    assert abs(whole / e.std() - 1.0) < 0.01
    assert np.isfinite(noise.whiten(np.tile(e, (2, 1))[:, :, None])).all() and noise.shared < 1e7


def test_a_diagnosis_of_copied_rows_ends_and_finds_the_noise():
    random = np.random.default_rng(2)
    arm = six_axis(placed=False)
    truth = true_robot(arm, random)
    data = measured(arm, [truth], [joints_in_limits(arm, 70, random)], NOISE_M, random)
    result = ea.diagnose(arm, data.select(np.concatenate([np.arange(70), np.arange(40)])))
    assert 0.8 < result["noise_floor"] / (np.sqrt(3.0) * NOISE_M) < 1.2
    assert "upper bound" in result["noise_source"]
