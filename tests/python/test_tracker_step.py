"""Tracker step: derivatives, robot file, the place of the push, and that a push is not called a drift or
outliers."""

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout, predict_poses
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.joint_fit import refit
from exactarm.diagnose.problems import problem_for
from exactarm.effects import effect_from_table
from exactarm.effects.tracker_step import TrackerStep
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits, measured, true_robot

NOISE_M = 5e-5
COUNT = 150
STEP_M = np.array([2e-4, -1e-4, 1.5e-4])


def poses(seed, pushed_after, turn=np.zeros(3), sessions=1):
    """Poses in the order of measurement, every fourth for validation; the tracker is pushed in the last
    session."""
    rng = np.random.default_rng(seed)
    robot = load_robot("ur10")
    truth = true_robot(robot, rng, 0.5)
    q = [np.clip(joints_in_limits(robot, COUNT, rng), -2.2, 2.2) for _ in range(sessions)]
    data = measured(robot, [truth] * sessions, q, NOISE_M, rng,
                    identification=np.arange(sessions * COUNT) % 4 != 0)
    later = (data.session == sessions) & (np.arange(len(data)) % COUNT >= pushed_after)
    moved = data.position + later[:, None] * (STEP_M + np.cross(turn, data.position))
    return robot, replace(data, position=moved, row=1 + np.arange(len(data)))


@pytest.mark.parametrize("turn", [False, True])
def test_derivatives(turn):
    robot, data = poses(1, 60)
    effect = TrackerStep(None, (70.5, 1e-4, 2e-4, -1e-4, *((3e-5, -2e-5, 1e-5) if turn else (0.0,) * 3)),
                         turn=turn)
    layout = Layout.of((effect,))
    assert layout.size == (6 if turn else 3)
    predict = lambda x: predict_poses(robot, layout.at(x), data, tangents=False).position
    assert_derivative(predict, layout.values, predict_poses(robot, layout, data).jacobian[:, :3],
                      np.full(layout.size, 1e-5))


@pytest.mark.parametrize("turn", [False, True])
def test_table_gives_the_effect_back(turn):
    effect = TrackerStep(None, (0.5, 1e-4, 2e-4, -1e-4, *((3e-5, 0.0, 1e-5) if turn else (0.0,) * 3)), 2,
                         "time", turn)
    assert effect_from_table(effect.to_table()) == effect


@pytest.mark.slow
@pytest.mark.parametrize("turn", [np.zeros(3), np.array([3e-5, -1e-5, 3e-5]), np.array([1e-4, -1e-4, 5e-5])])
def test_a_push_is_named_with_its_place(turn):
    """A turn that the form without one passes over moves the shift at the device's origin by 0.1 mm: the
    intervals know of it."""
    robot, data = poses(3, 83, turn)
    result = diagnose(robot, data)
    first = result.findings[0]
    assert first.effect.name == "tracker_step" and result.verdict == "explained" and len(result.findings) == 1
    assert 81.0 <= first.effect.values[0] <= 86.0
    low, high = first.intervals[1:4].T
    assert np.all((low < STEP_M) & (STEP_M < high)) and first.effect.turn
    assert result.after["validation"].rms < 0.7 * result.before["validation"].rms


@pytest.mark.slow
def test_only_the_session_that_was_pushed_jumps():
    robot, data = poses(4, 40, sessions=2)
    first = diagnose(robot, data).findings[0].effect
    assert (first.name, first.session) == ("tracker_step", 2)


@pytest.mark.slow
def test_drift_is_no_push():
    robot, data = poses(5, COUNT)
    drifting = data.position + (data.row / COUNT)[:, None] * np.array([3e-4, 2e-4, 0.0])
    result = diagnose(robot, replace(data, position=drifting))
    assert [finding.effect.name for finding in result.findings] == ["tracker_drift"]


@pytest.mark.parametrize("wild_m", [0.0, 0.02])
def test_place_is_found_again_from_a_wrong_one(wild_m):
    """Beside a row that is far off, too."""
    robot, data = poses(6, 60)
    data = data.select(np.arange(len(data)))
    effect = TrackerStep(None, (62.5, *STEP_M, 0.0, 0.0, 0.0))
    there = effect.with_values((60.5, *effect.values[1:]))
    position = predict_poses(robot, Layout.of((there,)), data).position.copy()
    position[np.argmin(np.abs(data.row - 64.0))] += wild_m * np.array(STEP_M) / np.linalg.norm(STEP_M)
    view = predict_poses(robot, Layout.of((effect,), estimate=False), replace(data, position=position)).view
    assert effect.moved(view).values[0] == 60.5


def test_a_fit_moves_a_push_to_its_place():
    """From six rows beside it, where the rows between would be called wrong."""
    robot, data = poses(8, 80, np.array([1e-4, -1e-4, 5e-5]))
    every = data.identification
    problem = problem_for(robot, data.select(every), data.select(~every), 1, 0)
    beside = TrackerStep(None, (88.5, *(0.0,) * 6), turn=True)
    first = problem.fit(problem.declared())
    fitted = refit(problem, problem.declared(), [beside], first)
    assert 79.0 <= fitted.layout.effects[-1].values[0] <= 82.0


def test_short_sessions_have_no_candidates():
    robot, data = poses(7, 60)
    few = data.select(np.arange(15))
    view = predict_poses(robot, Layout.of(()), few).view
    assert list(TrackerStep.candidates(robot, view)) == []
