"""Base and tool frames found without a guess: 100 random set-ups, and data that cannot tell them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

import exactarm as ea
from exactarm.errors import InputError
from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.identify.frames import find_frames
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot
from set_ups import at_random_place, joints_in_limits, measured, true_robot
from six_axis import six_axis
from test_robot_types import leaning_scara, scara

NOISE_M = 1e-4
SET_UPS = 100  # the marks hold at any count
ROBOTS = ("tx40", "ur10", "six axis")


def nominal(name):
    return six_axis(placed=False) if name == "six axis" else load_robot(name)


@pytest.mark.slow
def test_calibration_reaches_the_noise_in_every_random_set_up():
    """15 to 60 poses, a model wrong by mm, a tool up to half a metre off: what is left is chi-squared
    noise."""
    robots = [nominal(name) for name in ROBOTS]
    surprises = []
    for k in range(SET_UPS):
        rng = np.random.default_rng(k)
        robot, count = robots[k % len(robots)], int(rng.integers(15, 61))
        q = joints_in_limits(robot, count, rng)
        data = measured(robot, [true_robot(robot, rng)], [q], NOISE_M, rng,
                        identification=np.ones(count, bool))
        fit = calibrate(robot, data, CalibrationOptions(compliance=(), seed=k)).fit.fit
        square = np.sum((fit.residual[: 3 * count] / NOISE_M) ** 2)  # behind them: what draws to the drawing
        surprises.append(stats.chi2.sf(square, fit.freedom))
    assert min(surprises) > 0.01 / SET_UPS, f"set-up {int(np.argmin(surprises))}"


@pytest.mark.parametrize("orientation", [False, True])
def test_exact_robot_gives_exact_frames(orientation):
    rng = np.random.default_rng(200)
    robot = six_axis(springs=True, placed=False)
    placed = at_random_place(robot, rng)
    data = measured(robot, [placed], [joints_in_limits(robot, 12, rng)], 0.0, rng,
                    noise_rad=0.0 if orientation else None)
    found = find_frames(robot, data)
    assert found.rms < 1e-9 and found.scale == pytest.approx(1.0, abs=1e-9)
    assert_allclose(found.base.position, placed.base.position, atol=1e-8)
    assert_allclose(found.base.rotation, placed.base.rotation, atol=1e-8)
    assert_allclose(found.tool.position, placed.tool.position, atol=1e-8)
    assert_allclose(found.tool.rotation, np.eye(3), atol=1e-8)


def test_answer_does_not_depend_on_the_seed():
    rng = np.random.default_rng(201)
    robot = load_robot("ur10")
    data = measured(robot, [true_robot(robot, rng)], [joints_in_limits(robot, 20, rng)], NOISE_M, rng)
    tools = [find_frames(robot, data, seed=seed).tool.position for seed in range(5)]
    assert_allclose(tools, np.tile(tools[0], (5, 1)), atol=1e-5)


def test_tells_that_another_tool_point_fits_as_well():
    """A wrist that never turns leaves the target anywhere; one that does pins it down."""
    rng = np.random.default_rng(202)
    robot = load_robot("ur10")
    truth, q = true_robot(robot, rng), joints_in_limits(robot, 20, rng)
    parallel = np.column_stack([np.zeros(20), q[:, 1:3], -q[:, 1] - q[:, 2], np.full(20, -1.2), np.zeros(20)])
    parallel[:10, 0] = 0.4
    turning, fixed = (find_frames(robot, measured(robot, [truth], [each], NOISE_M, rng))
                      for each in (q, parallel))
    assert turning.other_tool is None
    assert fixed.other_tool is not None and np.linalg.norm(fixed.other_tool - fixed.tool.position) > 0.01


@pytest.mark.slow
def test_a_direction_that_no_pose_turns_keeps_its_declared_place():
    """Along the quill of a SCARA a shift of the tool is one of the base; it had ended wherever the search
    began, and base z came with an interval of 0.01 mm at 10 to 580 mm, a zero outside of its own. Seeds: the
    first three, none was left out."""
    tool = Placement(position=np.array([0.02, -0.01, 0.05]))
    robot = replace(scara(), tool=tool)
    for seed in range(3):
        made = ea.simulate(leaning_scara(), count=40, seed=seed, noise=3e-5)
        assert find_frames(robot, made.data, seed=seed).tool.position[2] == pytest.approx(0.05, abs=1e-12)
        calibrated = ea.calibrate(robot, made.data, seed=seed).robot
        assert calibrated.tool.position[2] == pytest.approx(0.05, abs=1e-12)


def test_refuses_fewer_than_four_poses():
    rng = np.random.default_rng(203)
    robot = six_axis(placed=False)
    q = np.repeat(joints_in_limits(robot, 3, rng), 5, axis=0)
    data = measured(robot, [at_random_place(robot, rng)], [q], NOISE_M, rng)
    with pytest.raises(InputError, match="different poses of session .*; expected at least 4"):
        find_frames(robot, data)


def test_refuses_points_on_a_line():
    rng = np.random.default_rng(204)
    robot = six_axis(placed=False)
    data = measured(robot, [at_random_place(robot, rng)], [joints_in_limits(robot, 10, rng)], NOISE_M, rng)
    line = np.array([0.1, 0.2, 0.3]) + np.linspace(0.0, 1.0, 10)[:, None] * np.array([1.0, -2.0, 0.5])
    with pytest.raises(InputError, match="lie on one line"):
        find_frames(robot, replace(data, position=line))
