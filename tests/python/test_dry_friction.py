"""Dry friction that holds at rest what it was, and friction that turns over between two rows: drives with
Dahl's equation and with breakaway torque, integrated here, not by the chain."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.chain import Layout, motion_record
from exactarm.chain.dry_friction import DryFriction, held_sign
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.motion_problem import MotionProblem
from exactarm.effects.stribeck_friction import StribeckFriction
from exactarm.identify.dynamics import friction_layout
from exactarm.identify.friction_width import dry_friction
from exactarm.identify.motion_fit import fit_motion
from motions import fourier_motion, motion_data
from six_axis import six_axis

RATE_HZ = 250.0


def bare():
    """Without friction and rotors in its tables."""
    robot = six_axis()
    return replace(robot, joints=tuple(replace(joint, coulomb=0.0, viscous=0.0, rotor_inertia=0.0)
                                       for joint in robot.joints))


def stops(axes: int, moves: int, random, rate_hz: float = RATE_HZ):
    """From stay to stay by polynomials of degree 5: time, angle, rate, acceleration."""
    angle, rate, acceleration = [], [], []
    here, s = np.zeros(axes), np.arange(0.0, 1.0, 1.0 / rate_hz)
    for _ in range(moves):
        there = random.uniform(-0.5, 0.5, axes)
        angle += [here + (there - here) * (10 * s**3 - 15 * s**4 + 6 * s**5)[:, None]]
        rate += [(there - here) * (30 * s**2 - 60 * s**3 + 30 * s**4)[:, None]]
        acceleration += [(there - here) * (60 * s - 180 * s**2 + 120 * s**3)[:, None]]
        stay = np.ones((int(0.4 * rate_hz), 1))
        angle, rate = [*angle, there * stay], [*rate, 0.0 * there * stay]
        acceleration, here = [*acceleration, 0.0 * there * stay], there
    angle = np.concatenate(angle)
    return np.arange(len(angle)) / rate_hz, angle, np.concatenate(rate), np.concatenate(acceleration)


def dahl(angle: np.ndarray, way: float) -> np.ndarray:
    """ds = (1 - s sign(dx)) |dx| / way, from nothing."""
    state, found = np.zeros(angle.shape[1]), np.zeros(angle.shape)
    for k in range(1, len(angle)):
        step = angle[k] - angle[k - 1]
        side = np.sign(step)
        state = side * np.abs(side) + (state - side) * np.exp(-np.abs(step) / way) * np.abs(side) + state * (
            1.0 - np.abs(side))
        found[k] = state
    return found


def test_held_friction_is_near_that_of_dahl_and_stays_at_rest():
    angle = np.concatenate([np.linspace(0.0, 0.02, 400), np.full(100, 0.02), np.linspace(0.02, 0.0, 400)])
    found = held_sign(angle, 5e-4)
    behind = slice(500, None)  # the reversal
    np.testing.assert_allclose(found[behind], dahl(angle[:, None], 1e-3)[behind, 0], atol=0.15)
    np.testing.assert_allclose(found[400:500], 1.0, atol=1e-9)


def test_jitter_at_rest_does_not_let_friction_go():
    angle = np.concatenate([np.linspace(0.0, 0.02, 400), np.full(5000, 0.02)])
    angle[400:] += 1e-6 * np.random.default_rng(1).normal(size=5000)
    assert np.min(held_sign(angle, 5e-4)[400:]) > 0.98


def test_an_axis_that_turns_back_between_two_samples_is_followed():
    """Angles of 125 Hz beside those of 12.5 kHz: the way from the last sample before the turn is too short,
    and friction over 0.03 mrad turned over by up to a quarter of it late."""
    fine = np.arange(0.0, 10.0, 8e-5)
    angle = 0.5 * np.sin(2.0 * fine) + 0.1 * np.sin(7.0 * fine)
    apart = held_sign(angle[::100], 3e-5) - held_sign(angle, 3e-5)[::100]
    assert np.max(np.abs(apart)) < 0.05 and np.sqrt(np.mean(apart**2)) < 3e-3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("way", [3e-5, 3e-4])
def test_friction_by_the_way_is_no_delay_where_an_axis_never_rests(seed, way):
    """Of a stranger's four logs without a rest all had a delay of 5 to 17 ms, for certain: laws by the way
    were tried where a log has rests. Seeds 0 to 7, the first eight."""
    robot, random = bare(), np.random.default_rng(seed)
    parts = [fourier_motion(robot, 8.0, RATE_HZ, 10 * seed + k) for k in range(4)]
    angle, rate, acceleration = (np.concatenate([part[k] for part in parts]) for k in (1, 2, 3))
    fine = [fourier_motion(robot, 8.0, 16.0 * RATE_HZ, 10 * seed + k)[1] for k in range(4)]
    rubs = 8.0 * np.concatenate([dahl(part, way)[::16] for part in fine])
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration) + rubs
    torque += random.normal(0.0, 0.3, torque.shape)
    run = np.repeat(np.arange(1, 5), len(parts[0][0]))
    data = Dataset.of_arrays("motion", {"theta": angle * robot.ratios, "tau": torque},
                             time=np.tile(parts[0][0], 4), run=run, identification=run <= 3)
    declared = replace(robot, joints=tuple(replace(joint, coulomb=7.0) for joint in robot.joints))
    found = diagnose(declared, data)
    assert not found.findings and found.verdict == "no_undeclared_effect"


@pytest.mark.slow
def test_a_drive_that_holds_at_rest_is_told_from_one_that_lets_go():
    robot, random = bare(), np.random.default_rng(3)
    time, angle, rate, acceleration = stops(robot.axes, 8, random)
    held = dahl(angle, 6e-4)
    let_go = np.tanh(rate / 0.005)
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque += 20.0 * np.where(np.arange(robot.axes) < 3, held, let_go) + random.normal(0.0, 0.5, angle.shape)
    record = motion_record(robot, motion_data(robot, time, angle, torque))
    layout = friction_layout(robot, record)
    found = dry_friction(robot, layout, record)
    np.testing.assert_allclose(found.reach[:3], 3e-4, rtol=0.25)
    assert not found.reach[3:].any()
    fit = fit_motion(robot, layout, replace(record, dry=found))
    np.testing.assert_allclose(fit.layout.values[:6:2], 20.0, rtol=0.02)
    assert np.all(fit.sigma < 0.35)  # 0.5 Nm behind the low-pass are 0.2


def test_rows_before_the_first_motion_of_a_run_wait_for_what_it_held():
    robot, random = bare(), np.random.default_rng(4)
    time, angle, *_ = stops(robot.axes, 3, random)
    angle = np.concatenate([np.tile(angle[:1], (250, 1)), angle])
    record = motion_record(robot, motion_data(robot, np.arange(len(angle)) / RATE_HZ, angle))
    dry = DryFriction(record.dry.width, np.full(robot.axes, 1e-3))
    assert record.keep.sum() > replace(record, dry=dry).keep.sum()
    assert not replace(record, dry=dry).keep[: int(1.0 / record.step)].any()
    known = replace(dry, start=np.ones((1, robot.axes)))
    np.testing.assert_array_equal(replace(record, dry=known).keep, record.keep)


@pytest.mark.slow
def test_what_friction_holds_of_an_axis_at_rest_is_unknown():
    """A constant torque of a gear that never slides is no mass, and none of the robot's parameters."""
    robot, random = bare(), np.random.default_rng(5)
    time, angle, rate, acceleration = stops(robot.axes, 6, random)
    angle[:, 1], rate[:, 1], acceleration[:, 1] = 0.3, 0.0, 0.0
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque[:, 1] += 6.0
    torque += random.normal(0.0, 0.3, angle.shape)
    data = motion_data(robot, time, angle, torque)
    problem = MotionProblem(robot, data, data.select(np.zeros(0, int)))
    layout = problem.declared()
    assert "held_2_Nm" in layout.names and "coulomb_2_Nm" not in layout.names
    fitted = problem.fit(layout)
    low, high = fitted.fit.interval()[layout.names.index("held_2_Nm")]
    assert low < 6.0 < high and high - low < 0.1
    assert any("friction holds at rest of axis 2" in words for words in problem.left_out())
    assert problem.updated_robot(fitted).joints[1] == robot.joints[1]
    assert "held_2_Nm" not in problem.updated_robot(fitted).intervals


@pytest.mark.slow
def test_every_fit_judges_the_same_rows():
    """Also where one takes friction by the way, whose first rows of a run nobody knows."""
    robot, random = bare(), np.random.default_rng(4)
    time, angle, *_ = stops(robot.axes, 3, random)
    data = motion_data(robot, time, angle, random.normal(0.0, 0.3, angle.shape))
    problem = MotionProblem(robot, data, data)
    fitted = problem.fit(problem.declared())
    held_out = replace(data)
    of_reach = lambda reach: replace(fitted.record, dry=replace(fitted.record.dry, reach=reach * np.ones(6)))
    errors, waiting = (problem.errors(replace(fitted, record=of_reach(reach)), held_out)
                       for reach in (0.0, 1e-3))
    assert errors.shape == waiting.shape and np.isnan(waiting).sum() > np.isnan(errors).sum() == 0


@pytest.mark.slow
def test_breakaway_torque_of_a_coarse_log():
    """At 125 Hz a drive passes through breakaway within some samples: 11 to 18 % too large before."""
    robot, random = bare(), np.random.default_rng(6)
    time, angle, rate, acceleration = stops(robot.axes, 14, random, 125.0)
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque += 10.0 * np.tanh(rate / 2e-3)
    torque[:, 1] += 8.0 * np.tanh(rate[:, 1] / 2e-3) * np.exp(-((rate[:, 1] / 0.05) ** 2))
    torque += random.normal(0.0, 0.3, angle.shape)
    record = motion_record(robot, motion_data(robot, time, angle, torque))
    layout = friction_layout(robot, record).joined(Layout.of((StribeckFriction(2, (5.0, 0.07)),)))
    for _ in range(2):
        record = replace(record, dry=dry_friction(robot, layout, record))
        fit = fit_motion(robot, layout, record)
        layout = fit.layout
    place = layout.names.index("stribeck_friction_2.breakaway_Nm")
    low, high = fit.intervals[place]
    assert low < 8.0 < high
    assert high - low < 1.0


@pytest.mark.slow
def test_a_fit_ends_where_friction_turns_over_as_it_says(monkeypatch):
    """Blind motion 96022: one turn left a width beside that of the final layout, and a breakaway torque 11 %
    too small, outside of its interval. Here every turn goes half the way to a width."""
    def halfway(robot, layout, record, threads=1):
        nearer = 0.5 * (record.dry.width + 5e-3)
        near = np.max(np.abs(nearer - record.dry.width)) < 1e-3
        return record.dry if near else replace(record.dry, width=nearer)

    monkeypatch.setattr("exactarm.diagnose.motion_problem.dry_friction", halfway)
    robot, random = bare(), np.random.default_rng(4)
    time, angle, *_ = stops(robot.axes, 3, random)
    data = motion_data(robot, time, angle, random.normal(0.0, 0.3, angle.shape))
    problem = MotionProblem(robot, data, data.select(np.zeros(0, int)))
    fitted = problem.fit(problem.declared())
    assert halfway(robot, fitted.layout, fitted.record) is fitted.record.dry
