"""How sharply dry friction turns over: the mean sign over a row, and the width that a torque shows, axis by
axis."""

from dataclasses import replace

import numpy as np

from exactarm import _core
from exactarm.chain import Layout, motion_record, predict_motion
from exactarm.chain.dry_friction import DryFriction
from exactarm.effects.drive import smooth_sign, smooth_sign_slope, smooth_square
from exactarm.effects.thermal_drift import ThermalFriction
from exactarm.identify.dynamics import friction_layout
from exactarm.identify.friction_width import _Axis, dry_friction
from exactarm.view import SIGN_WIDTH_RAD_S
from motions import fourier_motion, motion_data
from six_axis import six_axis


def test_smooth_sign_is_the_mean_over_the_swing():
    rate, swing = np.array([-0.3, -0.01, 0.0, 0.004, 0.2]), 0.03
    grid = np.linspace(-swing, swing, 20001)
    mean, slope = (each(rate, 0.01, swing) for each in (smooth_sign, smooth_sign_slope))
    np.testing.assert_allclose(mean, np.tanh((rate[:, None] + grid) / 0.01).mean(axis=1), atol=2e-4)
    step = 1e-6
    np.testing.assert_allclose(
        slope,
        (smooth_sign(rate + step, 0.01, swing) - smooth_sign(rate - step, 0.01, swing)) / (2 * step),
        atol=1e-4
    )


def test_smooth_square_is_the_mean_over_the_swing():
    rate, swing = np.array([-0.3, -0.01, 0.0, 0.004, 0.2]), 0.03
    grid = np.linspace(-swing, swing, 20001)
    mean, slope = smooth_square(rate, 0.01, swing)
    np.testing.assert_allclose(mean, (np.tanh((rate[:, None] + grid) / 0.01) ** 2).mean(axis=1), atol=2e-4)
    step = 1e-6
    np.testing.assert_allclose(
        slope,
        (smooth_square(rate + step, 0.01, swing)[0] - smooth_square(rate - step, 0.01, swing)[0])
        / (2 * step), atol=1e-4
    )


def test_without_swing_it_is_the_hyperbolic_tangent():
    rate = np.linspace(-0.1, 0.1, 11)
    np.testing.assert_allclose(smooth_sign(rate), np.tanh(rate / SIGN_WIDTH_RAD_S), atol=1e-6)


def test_each_axis_takes_the_width_of_its_torque():
    robot = six_axis()
    plain = tuple(replace(joint, coulomb=0.0, viscous=0.0, rotor_inertia=0.0) for joint in robot.joints)
    robot = replace(robot, joints=plain)
    time, angle, rate, acceleration = fourier_motion(robot, 10.0, 500.0, 3)
    widths = np.array([1e-3, 1e-3, SIGN_WIDTH_RAD_S, SIGN_WIDTH_RAD_S, 0.08, 0.08])
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque += 20.0 * np.tanh(rate / widths) + np.random.default_rng(1).normal(0.0, 0.5, rate.shape)
    record = motion_record(robot, motion_data(robot, time, angle, torque))
    found = dry_friction(robot, friction_layout(robot, record), record)
    assert np.all(found.width[:2] < 0.003)
    np.testing.assert_allclose(found.width[2:], widths[2:], rtol=0.1)
    assert not found.reach.any()


def test_what_rounding_leaves_of_a_column_says_nothing():
    """What turns over with dry friction and is the same at each reversal (a share of the load that a gear
    loses) may be a sum of the other columns: rounding is left of it, and took whatever direction it had."""
    robot = six_axis()
    time, angle, rate, acceleration = fourier_motion(robot, 10.0, 500.0, 3)
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque += 20.0 * np.tanh(rate / 4e-3) + np.random.default_rng(1).normal(0.0, 0.5, rate.shape)
    record = motion_record(robot, motion_data(robot, time, angle, torque))
    layout = friction_layout(robot, record)
    axis = _Axis(predict_motion(robot, layout, record), layout, 1)
    least, own = axis.left((4e-3, 0.0)), axis.rubbing.at

    def with_a_sum_of_others(view):
        torque, columns = own(view)
        total = np.zeros(len(columns))
        total[axis.keep] = axis.others.sum(axis=1)
        return torque, np.column_stack([columns, total])

    axis.rubbing.at = with_a_sum_of_others
    np.testing.assert_allclose(axis.left((4e-3, 0.0)), least, rtol=1e-9)


def test_a_parameter_of_other_axes_says_nothing_of_this_one():
    """Of a link that axis 1 does not feel, its torque has rounding, which another processor rounds otherwise:
    brought to unit length it took a direction, and with it 0.2 % of the square sum and another law."""
    robot = six_axis()
    time, angle, rate, acceleration = fourier_motion(robot, 10.0, 500.0, 3)
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque += np.random.default_rng(1).normal(0.0, 0.5, rate.shape)
    record = motion_record(robot, motion_data(robot, time, angle, torque))
    layout = friction_layout(robot, record)
    prediction = predict_motion(robot, layout, record)
    least, left = _Axis(prediction, layout, 0).left((4e-3, 0.0)), []
    for seed in (1, 2):  # as two processors may round; no other was tried
        columns = prediction.jacobian.copy()
        gone = ~columns[:, 0].any(axis=0)
        assert gone.sum() >= 5  # friction of the other axes
        columns[:, 0, gone] = np.random.default_rng(seed).normal(0.0, 1e-15, (len(columns), gone.sum()))
        left.append(_Axis(replace(prediction, jacobian=columns), layout, 0).left((4e-3, 0.0)))
    np.testing.assert_allclose(left, least, rtol=1e-12)


def test_friction_of_all_axes_turns_over_with_each():
    """What a law leaves does not hang on the law of the record, also beside friction that falls on all axes
    as they warm up: with its column as the record turns it over, another law always left less."""
    robot = six_axis()
    time, angle, rate, acceleration = fourier_motion(robot, 10.0, 500.0, 3)
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque += 20.0 * np.tanh(rate / 4e-3) + np.random.default_rng(1).normal(0.0, 0.5, rate.shape)
    record = motion_record(robot, motion_data(robot, time, angle, torque))
    layout = friction_layout(robot, record).joined(Layout.of((ThermalFriction(None, (2e-3,), "time"),)))
    left = []
    for width in (3e-3, 2e-2):
        turned = replace(record, dry=replace(record.dry, width=np.full(robot.axes, width)))
        left.append(_Axis(predict_motion(robot, layout, turned), layout, 1).left((4e-3, 0.0)))
    np.testing.assert_allclose(left[1], left[0], rtol=1e-9)


def test_a_law_that_is_gone_round_is_taken_half_the_way():
    law = lambda width, reach=0.0: DryFriction(np.array([width, 0.01]), np.array([reach, 0.0]))
    first, here = law(0.04), law(0.001)
    np.testing.assert_allclose(here.towards(law(0.009), first).width, [0.003, 0.01])  # back
    np.testing.assert_allclose(here.towards(law(0.0005), first).width, [0.0005, 0.01])  # further
    turned = here.towards(law(SIGN_WIDTH_RAD_S, 1e-3), first)  # another kind of law
    assert (turned.width[0], turned.reach[0]) == (SIGN_WIDTH_RAD_S, 1e-3)
    reaches = law(SIGN_WIDTH_RAD_S, 1e-4).towards(law(SIGN_WIDTH_RAD_S, 4e-4), law(SIGN_WIDTH_RAD_S, 1e-3))
    np.testing.assert_allclose(reaches.reach, [2e-4, 0.0])
