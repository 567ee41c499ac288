"""Rows that were written twice are no repeated visits: the noise is not nothing.

Seeds: none exchanged; with 10, 20, 30 and 40 added to them both tests hold as well.
"""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.data.dataset import write_dataset
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


@pytest.mark.slow
def test_a_diagnosis_of_copied_rows_ends_and_finds_the_noise():
    random = np.random.default_rng(2)
    arm = six_axis(placed=False)
    truth = true_robot(arm, random)
    data = measured(arm, [truth], [joints_in_limits(arm, 70, random)], NOISE_M, random)
    result = ea.diagnose(arm, data.select(np.concatenate([np.arange(70), np.arange(40)])))
    assert 0.8 < result["noise_floor"] / (np.sqrt(3.0) * NOISE_M) < 1.2
    assert "upper bound" in result["noise_source"]


def test_copies_in_a_file_are_left_out_and_counted(tmp_path):
    """Repeated visits whose readings are coarse are none."""
    random = np.random.default_rng(3)
    arm = six_axis(placed=False)
    q = np.repeat(joints_in_limits(arm, 30, random), 2, axis=0)
    data = measured(arm, [true_robot(arm, random)], [q], NOISE_M, random)
    coarse = replace(data, position=np.round(data.position, 4))
    for name, written in (("visits", data), ("coarse", coarse),
                          ("copied", data.select(np.concatenate([np.arange(60), [3, 50, 7, 7]])))):
        write_dataset(tmp_path / f"{name}.csv", written, arm)
    rows = {name: ea.read(tmp_path / f"{name}.csv", arm) for name in ("visits", "coarse", "copied")}
    assert [len(each) for each in rows.values()] == [60, 60, 60]
    assert not rows["visits"].notes and not rows["coarse"].notes
    assert rows["copied"].notes[0].startswith("4 of 64 rows are copies of others")
    assert np.array_equal(rows["copied"].row, rows["visits"].row)
    assert np.array_equal(rows["copied"].way, rows["visits"].way)
