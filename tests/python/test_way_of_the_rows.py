"""Poses without approach columns: each as if reached straight from the one before, as a cause to be tried."""

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects import effect_from_table
from exactarm.effects.hysteresis import Hysteresis
from exactarm.effects.settling import Settling
from exactarm.robot_file import load_robot
from exactarm.view import View
from set_ups import joints_in_limits, measured, true_robot

NOISE_M, COUNT, SIZE_RAD = 4e-5, 120, 2.5e-4


def poses(seed, effects):
    rng = np.random.default_rng(seed)
    robot = load_robot("ur10")
    q = np.clip(joints_in_limits(robot, COUNT, rng), -2.2, 2.2)
    data = measured(robot, [true_robot(robot, rng, 0.5)], [q], NOISE_M, rng,
                    identification=np.arange(COUNT) % 4 != 0, layout=Layout.of(effects, estimate=False))
    return robot, data


def test_the_way_is_that_of_the_rows_as_they_were_measured():
    q = np.array([[0.0], [0.5], [0.5], [0.2], [1.0], [0.3]])
    data = Dataset.of_arrays("poses", {"q": q}, session=np.array([1, 1, 1, 1, 2, 2]))
    assert data.way[:, 0].tolist() == [0.0, 1.0, 1.0, -1.0, 0.0, -1.0]
    assert data.select(np.array([1, 3, 5])).way[:, 0].tolist() == [1.0, -1.0, -1.0]


@pytest.mark.slow
def test_lag_is_found_without_approach_columns_and_says_what_it_assumes():
    robot, data = poses(7, (Hysteresis(2, (SIZE_RAD,), by_rows=True),))
    result = diagnose(robot, data)
    (found,) = result.findings
    assert (found.effect.name, found.effect.joint, found.effect.by_rows) == ("hysteresis", 2, True)
    low, high = found.intervals[0]
    assert low < SIZE_RAD < high and result.verdict == "explained"
    assert "straight from that of the row before" in found.effect.describe()
    assert effect_from_table(found.effect.to_table()) == found.effect


def test_approach_columns_are_believed():
    q = np.array([[0.0], [0.5], [0.2]])
    told = np.array([[1.0], [-1.0], [1.0]])
    robot = load_robot("ur10")
    wide = lambda column: np.tile(column, (1, 6))
    without = View(robot, Dataset.of_arrays("poses", {"q": wide(q)}), "poses")
    beside = View(robot, Dataset.of_arrays("poses", {"q": wide(q), "approach": wide(told)}), "poses")
    assert without.way[:, 0].tolist() == [0.0, 1.0, -1.0] and not without.direction.any()
    assert beside.way[:, 0].tolist() == told[:, 0].tolist()


SHARE = 4e-4


def test_a_move_is_that_of_the_rows_as_they_were_measured():
    q = np.array([[0.0], [0.5], [0.5], [0.2], [1.0], [0.3]])
    data = Dataset.of_arrays("poses", {"q": q}, session=np.array([1, 1, 1, 1, 2, 2]))
    np.testing.assert_allclose(data.step[:, 0], [0.0, 0.5, 0.0, -0.3, 0.0, -0.7])
    np.testing.assert_allclose(data.select(np.array([3, 5])).step[:, 0], [-0.3, -0.7])
    robot = load_robot("kr300")
    theta = np.linspace(0.0, 1.0, 4)[:, None] * robot.controller_ratios
    moved = View(robot, Dataset.of_arrays("poses", {"theta": theta}), "poses").move
    np.testing.assert_allclose(moved[1:], 1.0 / 3.0)
    told = Dataset.of_arrays("poses", {"theta": theta, "approach": np.ones((4, robot.axes))})
    assert not View(robot, told, "poses").move.any()


def test_the_derivative_of_settling():
    robot, data = poses(1, ())
    layout = Layout.of((Settling(2, (SHARE,)), Settling(5, (-SHARE,))))
    analytic = predict_poses(robot, layout, data).jacobian[:, :3]
    at = lambda x: predict_poses(robot, layout.at(x), data, tangents=False).position
    assert_derivative(at, layout.values, analytic, 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("share", [SHARE, -SHARE])
def test_poses_that_were_read_before_the_arm_stood_still_are_told_from_lag(share):
    """Without it, angles that were logged too early passed for a lag of negative size."""
    robot, data = poses(8, (Settling(2, (share,)),))
    result = diagnose(robot, data)
    (found,) = result.findings
    assert (found.effect.name, found.effect.joint, result.verdict) == ("settling", 2, "explained")
    low, high = found.intervals[0]
    assert low < share < high
    assert ("still to go" in found.effect.describe()) == (share > 0.0)
    assert ("log them when it stands" in found.effect.caveat(None)) == (share < 0.0)
    assert effect_from_table(found.effect.to_table()) == found.effect
