"""The chain for motions: torque against the core's dynamics, energy, and every derivative."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, motion_record, predict_motion
from exactarm.chain.dry_friction import DryFriction
from exactarm.chain.motion import transmission
from exactarm.effects import library
from exactarm.effects.declared_friction import DeclaredFriction
from exactarm.effects.declared_rotor import DeclaredRotor
from exactarm.effects.gravity_compensator import GravityCompensator, Spring
from exactarm.effects.time_delay import TimeDelay
from exactarm.errors import InputError
from motions import fourier_motion, motion_data
from six_axis import six_axis

NONE = Layout.of(())


def record_of(robot, seconds=6.0, rate_hz=250.0, seed=3, bandwidth_hz=None):
    time, angle, _, _ = fourier_motion(robot, seconds, rate_hz, seed)
    return motion_record(robot, motion_data(robot, time, angle), bandwidth_hz)


def frictionless(robot):
    return replace(robot, joints=tuple(replace(joint, coulomb=None, viscous=None) for joint in robot.joints))


def test_torque_is_inverse_dynamics_rotor_and_friction():
    """Against the core on the exact rates: the filter and the numerical derivative change nothing in its
    band."""
    robot = six_axis()
    robot = replace(robot, joints=tuple(replace(joint, coulomb=None) for joint in robot.joints))
    time, angle, rate, acceleration = fourier_motion(robot, 6.0, 250.0, 3)
    record = motion_record(robot, motion_data(robot, time, angle))
    prediction = predict_motion(robot, NONE, record)
    expected = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    rotor = np.array([joint.rotor_inertia for joint in robot.joints])
    viscous = np.array([joint.viscous for joint in robot.joints])
    expected += rotor * robot.ratios**2 * acceleration + viscous * rate
    assert record.theta.shape == angle.shape
    error = (prediction.torque - expected)[record.keep]
    assert np.max(np.abs(error)) < 2e-4 * np.max(np.abs(expected))


def test_coulomb_friction_follows_the_motor_and_negative_ratios():
    robot = six_axis()
    record = record_of(robot, bandwidth_hz=200.0)  # too wide for this log: nothing is filtered
    assert record.bandwidth_hz is None
    bare = predict_motion(frictionless(robot), NONE, record).torque
    friction = predict_motion(robot, NONE, record).torque - bare
    rate = record.theta_dot / robot.ratios
    fast = np.abs(rate) > 0.1
    coulomb, viscous = (np.array([getattr(j, name) for j in robot.joints]) for name in ("coulomb", "viscous"))
    np.testing.assert_allclose(friction[fast], (coulomb * np.sign(rate) + viscous * rate)[fast], rtol=1e-3)


@pytest.mark.parametrize("name", ["joint_coupling", "gear_harmonics", "gear_ratio"])
def test_gears_conserve_power(name):
    """What the motors put in is what the joints take out, whatever the transmission does."""
    robot = frictionless(six_axis())
    robot = replace(robot, joints=tuple(replace(joint, rotor_inertia=None) for joint in robot.joints))
    record = record_of(robot, bandwidth_hz=200.0)
    values = {"joint_coupling": (4.0, 0.7), "gear_ratio": (0.05,), "gear_harmonics": (4.0, 0.1, -0.05)}[name]
    effect = library()[name](5, values)
    view = predict_motion(robot, Layout.of((effect,)), record, tangents=False).view
    motors = np.sum(view.signals["drive"] / robot.controller_ratios * view.signals["theta_dot"], axis=1)
    joints = np.sum(view.torque * view.signals["q_dot"], axis=1)
    plain = np.sum(view.torque * view.signals["theta_dot"] / robot.ratios, axis=1)
    keep = record.keep
    effect_size = np.max(np.abs(plain - joints)[keep])
    assert effect_size > 1e-5 * np.max(np.abs(joints))
    assert np.max(np.abs(motors - joints)[keep]) < 2e-2 * effect_size


def effects_under_test(robot):
    make = library()
    yield DeclaredFriction.of(robot, 1)
    yield DeclaredRotor.of(robot, 2)
    yield make["payload"](None, (3.0, 0.1, -0.2, 0.3))
    yield make["gear_ratio"](3, (0.01,))
    yield make["joint_coupling"](6, (5.0, 0.3))
    yield make["gear_harmonics"](2, (5.0, 0.01, -0.02))
    yield make["joint_compliance"](2, (3e-6, 0.0))
    yield make["gravity_compensator"](2, (50.0, 20.0, 0.0, 0.0))
    yield GravityCompensator(1, (50.0, 20.0, 0.0, 0.0, 30.0, -40.0), Spring.STIFFENING)
    yield GravityCompensator(3, (0.0, 0.0, 30.0, 40.0, 60.0, 0.3, -0.5), Spring.HINGED)
    yield make["load_friction"](3, (0.2,))
    yield make["torque_ripple"](4, (2.0, 0.3, -0.2))
    yield make["rotor_inertia"](5, (1e-4,))
    yield make["load_dependence"](3, (4e-6,))
    yield make["torque_constant"](1, (0.1,))


def steps_of(layout):
    return np.array([(0.02 if "order" in name else 0.2) * p.plausible
                     for name, p in zip(layout.names, layout.parameters)])


@pytest.mark.slow
@pytest.mark.parametrize("springs", [False, True])
def test_jacobian(springs):
    """Every effect alone and all together, with declared springs and without."""
    robot = six_axis(springs=springs)
    record = record_of(robot, seconds=0.8)
    every = tuple(effects_under_test(robot))
    smooth = tuple(effect for effect in every if effect.name != "load_friction")  # |torque| has kinks
    for effects in [(effect,) for effect in every] + [smooth]:
        layout = Layout.of(effects)
        predict = lambda x, layout=layout: predict_motion(robot, layout.at(x), record,
                                                          tangents=False).torque[record.keep]
        jacobian = predict_motion(robot, layout, record).jacobian[record.keep]
        relative = 5e-2 if springs else 5e-4  # the springs' answer is of first order in their stretch
        assert_derivative(predict, layout.values, jacobian, 0.05 * steps_of(layout), relative=relative)


@pytest.mark.parametrize("width", [0.02, 0.005])
def test_slope_of_friction_that_turns_over_within_a_few_samples(width):
    """By a delay, with two samples of the log to a row: by the rows alone it was 40 % off at a reversal."""
    robot = six_axis()
    record = record_of(robot, seconds=8.0, bandwidth_hz=8.0)
    assert record.samples.every == 2
    record = replace(record, dry=DryFriction(np.full(6, width), np.zeros(6), None))
    layout = Layout.of((TimeDelay(None, (0.0,)),))
    predict = lambda x: predict_motion(robot, layout.at(x), record, tangents=False).torque[record.keep]
    jacobian = predict_motion(robot, layout, record).jacobian[record.keep]
    assert_derivative(predict, layout.values, jacobian, 2e-5, relative=1e-3)


def test_a_ripple_that_passes_from_row_to_row_is_no_torque_of_any_row():
    """At its fastest the motor turns by one wave from one row to the next: the rows alone saw a constant."""
    robot = six_axis()
    record = record_of(robot, seconds=8.0, bandwidth_hz=8.0)
    assert record.samples.every == 2
    turns = np.abs(record.theta_dot[:, 3]) / (2.0 * np.pi)
    ripple = library()["torque_ripple"](4, (1.0 / (record.step * turns.max()), 1.0, 0.0))
    torque = [predict_motion(robot, Layout.of(effects), record, tangents=False).torque[:, 3]
              for effects in ((), (ripple,))]
    fast = record.keep & (turns > 0.9 * turns.max())
    assert fast.sum() > 20
    assert np.max(np.abs(torque[1] - torque[0])[fast]) < 0.02


def test_response_to_an_effect_outside_the_layout():
    """What the diagnosis asks of a candidate is its column in a layout that has it."""
    robot = six_axis()
    record = record_of(robot, seconds=2.0)
    coupling = library()["joint_coupling"](6, (5.0, 0.0))
    friction = DeclaredFriction.of(robot, 0)
    alone = predict_motion(robot, Layout.of((friction,)), record).view.response(coupling)
    inside = predict_motion(robot, Layout.of((friction, coupling)), record).jacobian
    np.testing.assert_allclose(alone[:, :, 1], inside[:, :, 2], atol=1e-9 * np.max(np.abs(inside)))
    assert np.max(np.abs(inside[:, 4, 2])) > 1e-3  # the motor that turns another joint feels it


def test_transmission_of_a_coupled_wrist():
    robot = six_axis()
    record = record_of(robot, seconds=1.2)
    layout = Layout.of((library()["joint_coupling"](6, (5.0, -0.8)),))
    view = predict_motion(robot, layout, record).view
    expected = np.diag(1.0 / robot.ratios)
    expected[5, 4] = -0.8 / robot.ratios[4]
    np.testing.assert_allclose(transmission(view, layout)[7], expected, rtol=1e-12)


def test_filter_treats_both_sides_alike():
    """A fast log of a motion with friction: what the low-pass takes from the jumps, it takes from the
    prediction."""
    robot = six_axis()
    time, angle, rate, acceleration = fourier_motion(robot, 4.0, 2000.0, 5)
    fine = motion_record(robot, motion_data(robot, time, angle), 900.0)
    torque = predict_motion(robot, NONE, fine).torque
    random = np.random.default_rng(8)
    noisy = torque + random.normal(0.0, 1.0, torque.shape)
    record = motion_record(robot, motion_data(robot, time, angle, noisy))
    assert record.bandwidth_hz == 20.0 and len(record.theta) == len(time) // 8
    residual = predict_motion(robot, NONE, record).residual()[record.keep]
    assert np.sqrt(np.mean(residual**2)) < 0.25  # of 1 Nm of white noise, 2 x 20 Hz of 2000 Hz remain: 0.14


def test_torque_at_the_motor_and_current(tmp_path):
    robot = six_axis()
    time, angle, _, _ = fourier_motion(robot, 2.0, 250.0, 3)
    torque = np.cos(time)[:, None] * np.arange(1.0, 7.0)
    joints = {"theta": angle * robot.ratios}
    base = motion_data(robot, time, angle, torque)
    at_motor = replace(base, joints=joints | {"tau_motor": torque / robot.ratios})
    current = replace(base, joints=joints | {"current": torque / robot.ratios})
    expected = motion_record(robot, base).torque
    for data in (at_motor, current):
        np.testing.assert_allclose(motion_record(robot, data).torque, expected, atol=1e-12)


def test_measured_rates_are_used():
    robot = six_axis()
    time, angle, rate, acceleration = fourier_motion(robot, 3.0, 100.0, 3)
    data = motion_data(robot, time, angle)
    data = replace(data, joints=data.joints | {"q_dot": rate})
    record = motion_record(robot, data)
    keep = record.keep
    np.testing.assert_allclose((record.theta_dot / robot.ratios)[keep], rate[keep],
                               atol=2e-3 * np.max(np.abs(rate)))
    np.testing.assert_allclose((record.theta_ddot / robot.ratios)[keep], acceleration[keep],
                               atol=5e-3 * np.max(np.abs(acceleration)))


def test_refusals():
    robot = six_axis()
    time, angle, _, _ = fourier_motion(robot, 2.0, 250.0, 3)
    data = motion_data(robot, time, angle)
    with pytest.raises(InputError, match="no torque"):
        motion_record(robot, replace(data, joints={"theta": data.joints["theta"]}))
    with pytest.raises(InputError, match="too short"):
        motion_record(robot, data.select(np.arange(20)))
    with pytest.raises(InputError, match="time"):
        motion_record(robot, replace(data, time=None))


def test_effects_of_no_size_answer_together_as_they_do_alone():
    robot = six_axis()
    view = predict_motion(robot, Layout.of((DeclaredFriction.of(robot, 1),)), record_of(robot)).view
    kinds = library()
    asked = [kinds["gear_ratio"](2, (0.0,)), kinds["time_delay"](None, (0.0,)),
             kinds["payload"](None, (0.0,) * 4),
             kinds["joint_compliance"](3, (0.0, 0.0)), kinds["gear_harmonics"](1, (100.0, 0.0, 0.0))]
    for effect, together in zip(asked, view.responses(asked)):
        linear = [not p.fixed and not p.search for p in effect.parameters()]
        together, alone = together[:, :, linear], view.response(effect)[:, :, linear]
        np.testing.assert_allclose(together, alone, atol=1e-9 * np.max(np.abs(alone)))
