"""Zero shift: derivatives, robot file, axis, place and size of a zero that moved once, and what it is not."""

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout, predict_poses
from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects import effect_from_table
from exactarm.effects.step_in_order import AT_THE_END
from exactarm.effects.zero_shift import ZeroShift
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits, measured, true_robot

NOISE_M, COUNT, SHIFT_RAD = 5e-5, 150, 5e-4


def poses(seed, joint, until, sessions=1, size=SHIFT_RAD):
    """Poses in the order of measurement, every fourth for validation; `joint` stood off up to row `until`."""
    rng = np.random.default_rng(seed)
    robot = load_robot("ur10")
    truth = true_robot(robot, rng, 0.5)
    q = [np.clip(joints_in_limits(robot, COUNT // sessions, rng), -2.2, 2.2) for _ in range(sessions)]
    place = np.arange(COUNT) if sessions == 1 else np.tile(np.arange(COUNT // sessions), sessions)
    count = len(place)
    off = ZeroShift(joint, (until, size), 1 if sessions == 1 else sessions - 1)
    data = measured(robot, [truth] * sessions, q, NOISE_M, rng, identification=np.arange(count) % 4 != 0,
                    layout=Layout.of((off,), estimate=False), row=1 + place)
    return robot, data


def test_derivatives():
    robot, data = poses(1, 2, 60.5)
    layout = Layout.of((ZeroShift(2, (60.5, 1e-4)),))
    assert layout.size == 1
    predict = lambda x: predict_poses(robot, layout.at(x), data, tangents=False).position
    analytic = predict_poses(robot, layout, data).jacobian[:, :3]
    assert_derivative(predict, layout.values, analytic, np.array([1e-5]))


def test_table_gives_the_effect_back():
    effect = ZeroShift(3, (0.5, 1e-4), 2, "time")
    assert effect_from_table(effect.to_table()) == effect


@pytest.mark.slow
@pytest.mark.parametrize("joint, until", [(2, 83.5), (4, 40.5)])
def test_a_shift_is_named_with_axis_place_and_size(joint, until):
    robot, data = poses(3, joint, until)
    result = diagnose(robot, data)
    (first,) = result.findings
    assert (first.effect.name, first.effect.joint, result.verdict) == ("zero_shift", joint, "explained")
    assert abs(first.effect.values[0] - until) < 4.0
    low, high = first.intervals[1]
    assert low < SHIFT_RAD < high and first.effect.of_record
    assert result.after["validation"].rms < 0.8 * result.before["validation"].rms


@pytest.mark.slow
def test_between_two_sessions():
    robot, data = poses(5, 3, 1e9, sessions=2)
    (first,) = diagnose(robot, data).findings
    assert (first.effect.name, first.effect.joint, first.effect.session) == ("zero_shift", 3, 1)


def test_rows_that_were_not_fitted_between_those_that_were_are_on_no_side():
    _, data = poses(1, 2, 60.5)
    fitted, other = data.select(data.identification), data.select(~data.identification)
    undecided = lambda after: ZeroShift(2, (after, 1e-4)).undecided(fitted, other)
    assert other.row[undecided(61.0)].tolist() == [61]  # the fitted ones beside it are 60 and 62
    assert not undecided(59.5).any()
    assert undecided(AT_THE_END) is None
    assert "up to the end of session 1" in ZeroShift(2, (AT_THE_END, 0.0)).describe()


@pytest.mark.slow
@pytest.mark.parametrize("sessions, until, undecided", [(1, 60.5, 1), (2, AT_THE_END, 0)])
def test_mastering_done_anew_beside_rows_that_were_not_fitted(sessions, until, undecided):
    """One degree: a row on the wrong side is 10 mm off. In one session row 61 lies between the fitted ones;
    of two the first ends with three rows that are not fitted."""
    robot, data = poses(8, 3, until, sessions, np.radians(1.0))  # the first seed tried
    data = replace(data, identification=data.identification & ((data.session == 2) | (data.row != 73)
                                                               & (data.row != 74) & (data.row != 75)))
    result = diagnose(robot, data)
    (first,) = result.findings
    assert (first.effect.name, first.effect.joint, result.verdict) == ("zero_shift", 3, "explained")
    assert result.after["validation"].rms < 3.0 * NOISE_M and result.before["validation"].rms > 1e-3
    assert len(result.undecided) == undecided and not result.excluded_elsewhere
    judged = len(result.problem.held_out) - undecided  # the same rows before and after
    assert result.after["validation"].n == result.before["validation"].n == judged


@pytest.mark.slow
def test_a_steady_drift_is_no_shift():
    robot, data = poses(6, 2, -1.0)
    drifting = data.position + (data.row / COUNT)[:, None] * np.array([3e-4, 2e-4, 0.0])
    result = diagnose(robot, replace(data, position=drifting))
    assert [finding.effect.name for finding in result.findings] == ["tracker_drift"]


def test_a_shift_may_lie_in_the_last_rows_before_another_session():
    """The other session shows the arm as it is behind them; in one session alone five rows have to."""
    robot, data = poses(7, 3, -1.0, sessions=2)
    there, beside = (Layout.of((ZeroShift(3, (after, SHIFT_RAD)),)) for after in (73.5, 72.5))
    data = replace(data, position=predict_poses(robot, there, data).position)
    found = {}
    for name, rows in (("two", np.arange(len(data))), ("one", np.flatnonzero(data.session == 1))):
        view = predict_poses(robot, beside, data.select(rows)).view
        tried = next(e for e in ZeroShift.candidates(robot, view) if e.session == 1 and e.joint == 3).search
        found[name] = 73.5 in tried, beside.effects[0].moved(view).values[0]
    assert found == {"two": (True, 73.5), "one": (False, 70.5)}
