"""The yardstick of bench/black_box.py is fair: frames, blocks and residuals are what they are said to be."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "bench"))

import black_box  # noqa: E402
from blind.arm import posture, read_arm, turn  # noqa: E402

ARM = read_arm(TOP / "python" / "exactarm" / "data" / "robots" / "ur10.toml")
TRUE = black_box.Frames(
    np.array([0.4, -2.9, 0.3]), np.array([0.2, -0.4, 2.6]), np.array([0.03, -0.05, 0.12])
)


def poses(count: int) -> np.ndarray:
    return np.random.default_rng(2).uniform(-2.0, 2.0, (count, ARM.axes))


def placed(q: np.ndarray, frames: black_box.Frames) -> np.ndarray:
    at = posture(ARM, q)
    return frames.base + (at.flange + at.rotation[:, -1] @ frames.tool) @ turn(frames.turned).T


def test_frames_are_found_from_anywhere():
    q = poses(40)
    found = black_box.fitted_frames(ARM, q, placed(q, TRUE))
    np.testing.assert_allclose(found.base, TRUE.base, atol=1e-9)
    np.testing.assert_allclose(found.tool, TRUE.tool, atol=1e-9)
    np.testing.assert_allclose(placed(poses(50), found), placed(poses(50), TRUE), atol=1e-9)


def test_jacobian_of_the_frames_is_the_difference_of_places():
    q, step = poses(10), 1e-6
    jacobian = black_box.frame_jacobian(ARM, q, TRUE)
    for k in range(9):
        change = step * np.eye(9)[k]
        turned = Rotation.from_matrix(turn(change[3:6]) @ turn(TRUE.turned)).as_rotvec()
        moved = black_box.Frames(TRUE.base + change[:3], turned, TRUE.tool + change[6:])
        difference = placed(q, moved) - placed(q, TRUE)
        np.testing.assert_allclose(jacobian[:, :, k], difference / step, atol=1e-4)


def test_frames_that_moved_a_little_leave_nothing():
    q = poses(60)
    moved = black_box.Frames(TRUE.base + 1e-4, TRUE.turned + 1e-4, TRUE.tool - 1e-4)
    left = placed(q, moved) - placed(q, TRUE)
    assert np.abs(black_box.without_frames(ARM, q, TRUE, left)).max() < 1e-3 * np.abs(left).max()


def test_a_smooth_rest_is_learned_and_evaluated_where_it_was_not_fitted():
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (400, 6))
    rest = lambda x: 1e-3 * np.stack([x[:, 0] ** 2, x[:, 1] * x[:, 2], np.cos(x[:, 3])], axis=1)
    learned = black_box.thin_plate(q[:300], rest(q[:300]), np.random.default_rng(1))
    left = np.linalg.norm(learned(q[300:]) - rest(q[300:]), axis=1).mean()
    assert left < 0.2 * np.linalg.norm(rest(q[300:]) - rest(q[:300]).mean(axis=0), axis=1).mean()


def test_quadrants_hold_every_row_once_and_lie_apart_in_axes_2_and_3():
    table = pd.DataFrame(poses(200), columns=black_box.JOINTS)
    block = black_box.quadrants(table)
    assert set(block) == {0, 1, 2, 3} and len(block) == 200
    assert table["q_2_rad"][block < 2].max() <= table["q_2_rad"][block >= 2].min()


def test_summary_is_in_millimetres_and_leaves_out_rows_that_have_no_error():
    found = black_box.summary(np.array([1e-3, 3e-3, np.nan]))
    assert found["rows"] == 2 and found["mean_mm"] == pytest.approx(2.0)
