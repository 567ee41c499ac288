"""Tracker drift: a device that moves off, and one that turns as it does."""

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout, predict_poses
from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects import effect_from_table
from exactarm.effects.slow_driver import TIME, drivers
from exactarm.effects.thermal_drift import ThermalZeroDrift
from exactarm.effects.tracker_drift import TrackerDrift
from exactarm.effects.tracker_step import TrackerStep
from exactarm.numerics.rotation import exp as rotation_exp
from exactarm.numerics.rotation import log as rotation_log
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot
from set_ups import joints_in_limits, measured, true_robot

NOISE_M, COUNT, HOURS = 5e-5, 150, 1.5
SHIFT, TURN = np.array([1e-4, -2e-4, 5e-5]), np.array([1.5e-4, -1e-4, 2e-4])  # an hour


def poses(seed, turn, noise_rad=None):
    rng, robot = np.random.default_rng(seed), load_robot("ur10")
    q = np.clip(joints_in_limits(robot, COUNT, rng), -2.2, 2.2)
    data = measured(robot, [true_robot(robot, rng, 0.5)], [q], NOISE_M, rng,
                    noise_rad=noise_rad, identification=np.arange(COUNT) % 4 != 0)
    hours = np.linspace(0.0, HOURS, COUNT)
    moved = data.position + hours[:, None] * (SHIFT + np.cross(turn, data.position))
    turned = None if noise_rad is None else rotation_exp(hours[:, None] * turn) @ data.rotation
    return robot, replace(data, position=moved, rotation=turned, time=3600.0 * hours)


@pytest.mark.parametrize("turn", [False, True])
def test_derivatives(turn):
    robot, data = poses(1, np.zeros(3))
    effect = TrackerDrift(None, (1e-4, 2e-4, -1e-4, *((3e-5, -2e-5, 1e-5) if turn else (0.0,) * 3)), TIME,
                          turn=turn)
    layout = Layout.of((effect,))
    assert layout.size == (6 if turn else 3)
    predict = lambda x: predict_poses(robot, layout.at(x), data, tangents=False).position
    assert_derivative(predict, layout.values, predict_poses(robot, layout, data).jacobian[:, :3],
                      np.full(layout.size, 1e-5))
    assert effect_from_table(effect.to_table()) == effect


@pytest.mark.parametrize("step", [False, True])
def test_a_device_that_turns_measures_turned_orientations(step):
    """As if the base of the robot had turned the same way, to first order; with its derivatives."""
    robot, data = poses(1, np.zeros(3), 1e-4)
    data = replace(data, time=np.full(COUNT, 3600.0))
    values = np.array([1e-4, -2e-4, 5e-5, 3e-5, -2e-5, 1e-5])
    effect = (TrackerStep(None, (0.5, *values), 1, TIME, turn=True) if step else
              TrackerDrift(None, tuple(values), TIME, turn=True))
    layout = Layout.of((effect,))
    if step:
        data = replace(data, time=data.time * np.linspace(1.0, 2.0, COUNT))
    found = predict_poses(robot, layout, data)
    turn, base = rotation_exp(values[3:]), robot.base
    moved = replace(robot, base=Placement(turn @ base.rotation, turn @ base.position + values[:3]))
    expected = predict_poses(moved, Layout.of(()), data, tangents=False)
    np.testing.assert_allclose(found.position, expected.position, atol=1e-8)
    np.testing.assert_allclose(found.rotation, expected.rotation, atol=1e-8)

    def turned(x):
        there = predict_poses(robot, layout.at(x), data, tangents=False).rotation
        return rotation_log(there @ np.swapaxes(found.rotation, -1, -2))

    assert_derivative(turned, layout.values, found.jacobian[:, 3:], np.full(layout.size, 1e-5), relative=1e-4)


@pytest.mark.parametrize("effect", [
    TrackerDrift(None, (1e-4, 2e-4, -1e-4, 3e-5, -2e-5, 1e-5, 0.4), TIME, (0.0, 1.2), True, turn=True),
    ThermalZeroDrift(2, (3e-4, 0.3), TIME, (0.0, 1.2), True)])
def test_what_settles_has_its_derivatives_stands_still_at_the_end_and_goes_no_farther(effect):
    """The rows lie up to 1.5 h, its record ended at 1.2 h."""
    robot, data = poses(1, np.zeros(3))
    layout = Layout.of((effect,))
    predict = lambda x, rows=data: predict_poses(robot, layout.at(x), rows, tangents=False).position
    assert_derivative(predict, layout.values, predict_poses(robot, layout, data).jacobian[:, :3],
                      np.full(layout.size, 1e-4))
    assert effect_from_table(effect.to_table()) == effect
    at = lambda time: predict(layout.values, replace(data, time=time))
    still = predict_poses(robot, Layout.of(()), data, tangents=False).position
    np.testing.assert_allclose(at(np.full(COUNT, 4320.0)), still, atol=1e-12)
    np.testing.assert_allclose(at(None), still, atol=1e-12)  # nothing known: as at the end
    np.testing.assert_allclose(at(np.full(COUNT, 32400.0)), at(np.full(COUNT, 6480.0)), atol=1e-12)
    assert np.max(np.abs(at(np.zeros(COUNT)) - still)) > 3e-5


def test_files_of_a_shift_alone_are_read():
    old = {"effect": "tracker_drift", "driver": "time", "x_m_per_h": 1e-4, "y_m_per_h": 0.0,
           "z_m_per_h": 2e-4}
    assert effect_from_table(old) == TrackerDrift(None, (1e-4, 0.0, 2e-4, 0.0, 0.0, 0.0))
    with pytest.raises(KeyError):
        effect_from_table({key: value for key, value in old.items() if not key.startswith("z")})


@pytest.mark.slow
@pytest.mark.parametrize("turn, noise_rad", [(np.zeros(3), None), (TURN, None), (TURN, 5e-5)])
def test_a_drift_is_named_and_its_turn_is_drawn_to_zero_only_where_the_device_does_not_turn(turn, noise_rad):
    """It was held there, and the intervals of the shift did not know of it. Orientations turn, too: they were
    left as they are, and half of the drift passed for noise that neighbours share."""
    robot, data = poses(3, turn, noise_rad)
    result = diagnose(robot, data)
    (first,) = result.findings
    assert (first.effect.name, first.effect.drawn,
            result.verdict) == ("tracker_drift", not turn.any(), "explained")
    low, high = first.intervals.T
    inside = (low <= [*SHIFT, *turn]) & ([*SHIFT, *turn] <= high)
    assert inside.sum() >= 5  # of six intervals of 95 %
    assert result.after["validation"].rms < 0.75 * result.before["validation"].rms


@pytest.mark.parametrize("entry", [{"settling_h": 0.0}, {"settling_h": -1.0}, {"between": [2.0, 1.0]},
                                   {"between": [0.0]}, {"between": None}, {"between": ["a", "b"]}])
def test_a_drift_that_cannot_be_is_refused(entry):
    table = ThermalZeroDrift(2, (3e-4, 0.3), TIME, (0.0, 1.2), True).to_table()
    assert effect_from_table(table).settles
    with pytest.raises((TypeError, ValueError)):
        effect_from_table({key: value for key, value in (table | entry).items() if value is not None})


def test_the_order_of_rows_is_no_clock_across_set_ups():
    """Nobody knows how long the fixture, or the tracker, took to the next one: with a time what settles is
    sought over all of them, by the order of rows in one set-up only."""
    robot, data = poses(1, np.zeros(3))
    two = replace(data, session=np.repeat([1, 2], COUNT // 2))
    forms = lambda rows: [form.settles for form in
                          TrackerDrift(None, (0.0,) * 3, drivers(rows)[0]).forms_on(rows)]
    assert forms(data) == forms(two) == [False, True]
    assert forms(replace(data, time=None)) == [False, True]
    assert forms(replace(two, time=None)) == [False]
