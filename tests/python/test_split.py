"""The split of rows: whole poses, whole runs, by session, the same for a seed."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from exactarm.data.dataset import Dataset
from exactarm.data.split import pose_groups

AXES = 3


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 1000), sessions=st.integers(1, 3), repeats=st.integers(1, 4))
def test_split_keeps_poses_whole_and_shares_by_session(seed, sessions, repeats):
    random = np.random.default_rng(seed)
    pose = np.repeat(np.arange(20 * sessions), repeats)
    q = random.normal(size=(20 * sessions, AXES))[pose]
    by_visit = seed % 2 == 0
    if by_visit:
        q = q + 1e-5 * random.normal(size=q.shape)
    data = Dataset.of_arrays("poses", {"q": q}, session=1 + pose // 20, visit=pose if by_visit else None)
    data = data.select(random.permutation(len(data)))
    pose = data.visit if by_visit else np.unique(data.joints["q"], axis=0, return_inverse=True)[1].ravel()
    mask = data.split(seed)
    np.testing.assert_array_equal(mask, data.split(seed))
    for session in range(1, sessions + 1):
        inside = data.session == session
        assert len(np.unique(pose[inside & mask])) == 14
        assert not set(pose[inside & mask]) & set(pose[inside & ~mask])


def test_poses_that_differ_by_encoder_noise_are_one():
    random = np.random.default_rng(4)
    pose = np.repeat(np.arange(30), 3)
    q = random.uniform(-2, 2, (30, AXES))[pose] + 1e-5 * random.uniform(-1, 1, (90, AXES))
    for unit in (1.0, 120.0):
        groups = pose_groups(Dataset.of_arrays("poses", {"q": unit * q}))
        assert len(np.unique(groups)) == 30
        assert all(len(np.unique(groups[pose == each])) == 1 for each in range(30))


def test_split_takes_whole_runs_of_each_sort():
    time, turn = np.arange(50) * 0.01, np.linspace(0, 100, 50)
    theta = np.zeros((8, 50, AXES))
    for run in range(8):
        theta[run, :, run // 4] = turn if run % 2 else -turn
    arrays = {"time": np.tile(time, 8), "run": np.repeat(np.arange(8), 50)}
    data = Dataset.of_arrays("gear_run", {"theta": theta.reshape(-1, AXES)}, **arrays)
    for seed in range(5):
        mask = data.split(seed).reshape(8, 50)
        assert (mask.all(1) | ~mask.any(1)).all()
        # Axis 1 and 2, to and fro: two runs of each sort, one of them identifies.
        assert [mask[[i, i + 2], 0].sum() for i in (0, 1, 4, 5)] == [1, 1, 1, 1]


def test_one_run_is_cut_in_time():
    data = Dataset.of_arrays("motion", {"theta": np.zeros((10, AXES))}, time=np.arange(10)[::-1] * 0.1)
    np.testing.assert_array_equal(data.split(3), np.arange(10) >= 3)
    assert "one run" in data.split_rule() and "later in time" in data.split_rule()
