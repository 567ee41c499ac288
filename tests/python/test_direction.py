"""Direction of motion: where an axis reverses, how one gear table passes into the other, and that rest is no
reversal."""

import time as clock

import numpy as np
import pytest

from exactarm import _core
from exactarm.chain.direction import (
    LEAST_TURN_RAD,
    TRANSITION_S,
    _passed,
    direction_of_motion,
    eased,
    rests,
    reversals,
)
from exactarm.chain.gear import declared_output_angle
from exactarm.data.dataset import Dataset
from exactarm.robot_file import load_robot
from exactarm.view import View

TIME = np.linspace(0.0, 2.0, 2001)


@pytest.mark.parametrize("instant", [0.7, 0.70037, 0.7005])
@pytest.mark.parametrize("rate", [250, 1000])
def test_a_reversal_is_found_between_samples(instant, rate):
    time = np.linspace(0.0, 2.0, 2 * rate + 1)
    first, turns = reversals(time, -0.5 * (time - instant) ** 2)
    assert first == 1.0 and [after for _, after in turns] == [-1.0]
    assert turns[0][0] == pytest.approx(instant, abs=2e-5)


def test_the_passage_is_halved_by_the_reversal_and_ends_in_time():
    direction = direction_of_motion(TIME, (-((TIME - 0.8) ** 2))[:, None])[:, 0]
    before, behind = TIME < 0.8 - 0.51 * TRANSITION_S, TIME > 0.8 + 0.51 * TRANSITION_S
    assert np.all(direction[before] == 1.0) and np.all(direction[behind] == -1.0)
    assert direction[800] == pytest.approx(0.0, abs=1e-3) and np.all(np.diff(direction) <= 1e-15)
    fine = np.linspace(0.7, 0.9, 801)
    fourth = np.diff(direction_of_motion(fine, (-((fine - 0.8) ** 2))[:, None])[:, 0], n=4)
    assert np.abs(np.diff(fourth)).max() < 0.1 * np.abs(fourth).max()  # no jump there


def test_rest_has_the_direction_of_the_last_motion_and_before_the_first_that_of_the_coming_one():
    angle = np.interp(TIME, [0.0, 0.3, 0.8, 2.0], [0.0, 0.0, 0.2, 0.2])
    assert np.all(direction_of_motion(TIME, angle[:, None]) == 1.0)
    assert np.all(direction_of_motion(TIME, -angle[:, None]) == -1.0)


def test_a_rest_between_two_directions_is_halved():
    angle = np.interp(TIME, [0.0, 0.5, 1.1, 2.0], [0.0, 0.15, 0.15, 0.0])
    jitter = np.random.default_rng(1).uniform(-0.2, 0.2, TIME.size) * LEAST_TURN_RAD
    for moved in (angle, angle + jitter):
        (instant, after), = reversals(TIME, moved)[1]
        assert instant == pytest.approx(0.8, abs=2e-3) and after == -1.0


def minimum_jerk(share):
    share = np.clip(share, 0.0, 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


@pytest.mark.parametrize("rate, step", [(125, 0.0), (125, LEAST_TURN_RAD), (500, 1e-5)])
def test_how_long_an_axis_rests_before_it_turns_back(rate, step):
    """Two strokes with a rest of 0.2 s between them, rounded angles too, and an axis that turns at once."""
    time = np.arange(0.0, 2.0, 1.0 / rate)
    angle = 0.5 * minimum_jerk(time / 0.8) - 0.5 * minimum_jerk((time - 1.0) / 0.8)
    (instant, rest, after), = rests(time, np.round(angle / step) * step if step else angle)[1]
    assert instant == pytest.approx(0.9, abs=1e-3) and rest == pytest.approx(0.2, abs=0.03) and after == -1.0
    (_, rest, _), = rests(time, -((time - 0.8) ** 2))[1]
    assert rest < 1e-3


def test_jitter_is_no_motion_and_an_axis_at_rest_has_no_direction():
    jitter = 0.4 * LEAST_TURN_RAD * np.sin(300.0 * TIME)
    assert np.all(direction_of_motion(TIME, jitter[:, None]) == 0.0)
    assert np.all(direction_of_motion(TIME, (jitter + 0.1 * TIME)[:, None]) == 1.0)
    assert np.all(direction_of_motion(TIME, np.zeros((TIME.size, 2))) == 0.0)


def test_quick_reversals_stay_between_the_tables():
    direction = direction_of_motion(TIME, 1e-3 * np.sin(2.0 * np.pi * 25.0 * TIME)[:, None])
    assert np.abs(direction).max() <= 1.0 and np.ptp(direction) > 0.5


def test_easing_is_the_same_passage():
    step = 1e-3
    jump = np.where(TIME < 0.9995, -1.0, 1.0)[:, None]
    smooth = eased(jump, step)
    passage = direction_of_motion(TIME, np.abs(TIME - 0.9995)[:, None])
    np.testing.assert_allclose(smooth, passage, atol=2e-3)
    np.testing.assert_allclose(eased(np.full((50, 2), 0.7), step), 0.7, rtol=1e-14)


def test_the_gear_between_its_tables_is_inverted_exactly():
    robot = load_robot("racer-7-1.4")
    random = np.random.default_rng(2)
    phi, direction = random.uniform(-1.0, 1.0, (40, 6)), random.uniform(-1.0, 1.0, (40, 6))
    direction[:3] = np.array([[-1.0], [0.0], [1.0]])
    theta = phi * robot.ratios
    for i, joint in enumerate(robot.joints):
        if joint.has_harmonics:
            cw, ccw = (_core.gear_motor_angle(joint.ratio, t.core(), phi[:, i])
                       for t in (joint.cw, joint.ccw))
            theta[:, i] = 0.5 * (1.0 - direction[:, i]) * cw + 0.5 * (1.0 + direction[:, i]) * ccw
    data = Dataset.of_arrays("tracked_motion", {"theta": theta}, time=0.01 * np.arange(40))
    view = View(robot, data, "tracked_motion", signals={"theta": theta, "direction": direction})
    found, slope = declared_output_angle(view)
    np.testing.assert_allclose(found, phi, atol=1e-13)
    view.signals["theta"] = theta + 1e-4
    np.testing.assert_allclose((declared_output_angle(view)[0] - found) / 1e-4, slope, rtol=1e-4)


@pytest.mark.slow
def test_many_reversals_take_a_time_that_grows_with_the_samples():
    """Each was once looked at in all samples: 60,000 with 1,800 of them on each of two axes took 28 s, and
    0.4 s now. Outside of its passage nothing changes, so the result is the same to the bit."""
    time = 0.05 * np.arange(60_000)
    angle = 0.2 * np.sin(0.6 * np.pi * time)[:, None] * np.array([1.0, -1.0])
    begun = clock.process_time()
    found = direction_of_motion(time, angle)
    assert clock.process_time() - begun < 5.0
    some = slice(0, 600)
    whole, turns = reversals(time[some], angle[some, 0])
    for turn, after in turns:
        whole = whole + 2.0 * after * _passed((time[some] - turn) / TRANSITION_S)
    np.testing.assert_array_equal(found[:590, 0], np.clip(whole, -1.0, 1.0)[:590])
