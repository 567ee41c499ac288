"""Noise of the device from repeated visits: its standard deviation, gross errors in single rows or not."""

import numpy as np
import pytest

from exactarm.diagnose.noise import repeat_scatter


def visits(seed, poses=150, repeats=2):
    """Rows (N, 3) of unit noise about unknown means, and the number of each row's pose."""
    rng = np.random.default_rng(seed)
    # 40 poses were visited once
    group = np.concatenate([np.arange(poses)] * repeats + [poses + np.arange(40)])
    return rng.normal(0.0, 30.0, (poses + 40, 3))[group] + rng.normal(0.0, 1.0, (len(group), 3)), group


@pytest.mark.parametrize("repeats", [2, 3])
def test_noise_about_unknown_means(repeats):
    found = [repeat_scatter(*visits(seed, repeats=repeats)) for seed in range(20)]
    assert np.mean(found) == pytest.approx(1.0, abs=0.02)


def test_gross_errors_are_no_noise():
    rows, group = visits(3)
    clean = repeat_scatter(rows, group)
    rows[[4, 77, 120]] += 100.0
    assert repeat_scatter(rows, group) == pytest.approx(clean, rel=0.03)


def test_what_scatters_often_is_noise():
    rows, group = visits(4)
    rows[:60] += np.random.default_rng(5).normal(0.0, 20.0, (60, 3))
    assert repeat_scatter(rows, group) > 5.0


def test_rows_that_repeat_exactly_have_no_noise():
    rows, group = visits(6)
    assert repeat_scatter(np.round(rows[group], 3)[group], group) == 0.0
