"""Curves of gears: how well they are known at every angle, gaps included."""

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout, predict_poses
from exactarm.effects import effect_from_table
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.known_curve import KnownCurve
from exactarm.identify.calibrate import calibrated_robot
from exactarm.identify.pose_fit import fit_poses
from exactarm.robot_file import load_robot, read_robot, write_robot
from set_ups import joints_in_limits, measured, true_robot

ORDER_RAD, ORDERS, AXIS = 1e-4, 40, 2


def fitted(seed=3, rows=400, noise=3e-5):
    """A UR10 whose axis 2 was measured between -1.5 and 1.2 rad but for a gap of 0.6 rad."""
    rng, robot = np.random.default_rng(seed), load_robot("ur10")
    q = joints_in_limits(robot, rows, rng)
    angle = rng.uniform(-1.5, 0.6, rows)
    q[:, AXIS - 1] = np.where(angle > -0.4, angle + 0.6, angle)
    curve = GearHarmonics.curve(AXIS, ORDERS, ORDER_RAD, (-1.5, 1.2))
    sizes = np.array([p.prior if np.isfinite(p.prior) else 0.0 for p in curve.parameters()])
    values = np.where(sizes > 0.0, rng.standard_normal(sizes.size) * sizes, curve.values)
    true = true_robot(robot, rng, 0.0)
    truth = replace(curve.with_values(values), seen=None)
    data = measured(robot, [true], [q], noise, rng, layout=Layout.of((truth,), estimate=False))
    fit = fit_poses(true, Layout.of((curve,)), data)
    return true, calibrated_robot(true, data, fit.layout, fit.fit), truth, q[:, AXIS - 1]


@pytest.fixture(scope="module")
def calibrated():
    return fitted()


def curve_of(robot):
    return next(effect for effect in robot.effects if effect.name == "gear_harmonics")


def value(robot, effect, angles):
    """(N,) what a curve adds at output angles of its axis, rad."""
    q = np.zeros((len(angles), robot.axes))
    q[:, AXIS - 1] = angles
    data = measured(robot, [robot], [q], 0.0, np.random.default_rng(0))
    view = predict_poses(robot, Layout.of(()), data).view
    return effect.change(view)


def test_a_curve_is_known_where_it_was_measured_and_not_in_the_gap(calibrated):
    known = curve_of(calibrated[1]).known
    weight = lambda *angles: known.weight(np.array(angles))
    assert np.all(weight(-1.2, -0.8, 0.5, 0.9) > 0.9)
    # In the gap, four wave lengths wide, a little is known from what lies beside it.
    assert np.all(weight(2.0, 3.0, -2.5) < 0.1) and weight(-0.1)[0] < 0.25
    assert known.measured(np.array([-1.0, -0.1])).tolist() == [True, False]


def test_deviations_hold_the_true_curve(calibrated):
    true, robot, truth, seen = calibrated
    effect, angles = curve_of(robot), np.linspace(-3.1, 3.1, 200)
    seen = seen - robot.offsets[AXIS - 1]
    of = lambda which, at: value(true, which, at).value[:, 0]
    error = (of(effect, angles) - of(effect, seen).mean()) - (of(truth, angles) - of(truth, seen).mean())
    score = error / effect.known.deviation(angles)
    assert 0.88 <= np.mean(np.abs(score) < 1.96) <= 1.0
    assert 0.5 < np.sqrt(np.mean(score**2)) < 1.3


def test_the_derivative_of_a_curve_from_a_file_holds(calibrated):
    true, robot, *_ = calibrated
    effect = curve_of(robot)
    angles = np.random.default_rng(4).uniform(-3.0, 3.0, 30)
    slope = value(true, effect, angles).by_signal["phi"][:, 0, AXIS - 1]
    at = lambda x: value(true, effect, x).value[:, 0]
    assert_derivative(at, angles, np.diag(slope), 1e-4)


def test_what_is_known_survives_the_robot_file_and_old_files_are_read(calibrated, tmp_path):
    robot = calibrated[1]
    write_robot(tmp_path / "robot.toml", robot)
    effect = curve_of(read_robot(tmp_path / "robot.toml"))
    assert effect == curve_of(robot)
    table = {k: v for k, v in effect.to_table().items() if k not in ("sd_rad", "prior_rad")}
    assert effect_from_table(table) == replace(effect, known=None)


def test_another_estimate_begins_without_what_was_known_of_the_last(calibrated):
    effect = curve_of(calibrated[1])
    assert effect.with_values(effect.values).known is None


def test_a_standard_deviation_below_zero_is_refused():
    with pytest.raises(ValueError, match="standard deviations"):
        KnownCurve.from_table({"sd_rad": [1e-5, -1e-5, 1e-5, 0.0], "prior_rad": 1e-4})
