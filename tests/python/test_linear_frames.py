"""Frames of many sets of rows at once are those of each by itself, and no frames go below the least."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import read_dataset
from exactarm.files.examples import data_path
from exactarm.first_aid.linear_frames import frames_of_stack, least_left, linear_frames
from exactarm.first_aid.misfit import flanges
from exactarm.first_aid.pose_candidates import candidates
from exactarm.robot_file import load_robot

SETS, ROWS = 5, 30


def rows(spread: np.ndarray, about: np.ndarray) -> tuple[np.ndarray, ...]:
    """Points (SETS, ROWS, 3) and rotations about the axes that `about` leaves, and what a device measures."""
    random = np.random.default_rng(4)
    points = random.normal(size=(SETS, ROWS, 3)) * spread
    turns = Rotation.from_rotvec(random.normal(size=(SETS * ROWS, 3)) * about).as_matrix()
    rotations, base = turns.reshape(SETS, ROWS, 3, 3), Rotation.random(SETS, random_state=5).as_matrix()
    targets = points + rotations @ [0.1, -0.2, 0.3] + 1e-3 * random.normal(size=points.shape)
    return points, rotations, targets @ np.swapaxes(base, 1, 2) + [3.0, 1.0, -2.0]


@pytest.mark.parametrize("spread, about", [(1.0, 1.0), (np.eye(3)[0], 0.0), (0.0, np.eye(3)[2])],
                         ids=["in space", "on a line without turning", "about one axis"])
def test_a_stack_is_what_each_set_gives_alone(spread, about):
    given = rows(spread, about)
    base, offset = frames_of_stack(*given)
    for k in range(SETS):
        points, rotations, measured = (values[k] for values in given)
        alone = linear_frames(points, rotations, measured)
        np.testing.assert_allclose(base[k], alone[0], atol=1e-9)
        np.testing.assert_allclose(offset[k], alone[1], atol=1e-9)


def test_no_frames_leave_less_than_the_least():
    given = rows(1.0, 1.0)
    least = least_left(*given)
    for k in range(SETS):
        points, rotations, measured = (values[k] for values in given)
        columns = np.zeros((ROWS, 3, 15))  # a matrix, an offset and a tool, all free
        for axis in range(3):
            columns[:, axis, 4 * axis : 4 * axis + 4] = np.insert(measured, 3, 1.0, axis=1)
        columns[:, :, 12:] = rotations
        left = np.linalg.lstsq(columns.reshape(-1, 15), points.ravel(), rcond=None)[1]
        assert least[k] == pytest.approx(float(left[0]), rel=1e-9)
        assert np.sum(linear_frames(points, rotations, measured)[2] ** 2) >= least[k]


def test_rows_of_zeros_do_not_count_in_the_least():
    points, rotations, measured = rows(1.0, 1.0)
    some = np.arange(ROWS) < 20
    wide = np.insert(measured, 3, 1.0, axis=2)
    masked = least_left(points * some[:, None], rotations * some[:, None, None], wide * some[:, None])
    np.testing.assert_allclose(masked, least_left(points[:, some], rotations[:, some], measured[:, some]))


def test_changed_angles_are_evaluated_together_as_alone():
    robot = load_robot("ur10")
    data = read_dataset(data_path("ur10/series_B.csv"), robot).select(np.arange(12))
    tried = [(other, Layout.of(()), changed)
             for _, other, changed in candidates(robot, data, data, np.arange(12), 1.0)]
    assert len(tried) > 100
    position, rotation = flanges(tried)
    for k, (other, layout, changed) in enumerate(tried):
        alone = predict_poses(other, layout, changed, tangents=False)
        np.testing.assert_allclose(position[k], alone.position, atol=1e-12)
        np.testing.assert_allclose(rotation[k], alone.rotation, atol=1e-12)
