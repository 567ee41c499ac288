"""Logs that hold angles to a hundredth or a thousandth of a degree: clean arms still lack nothing."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import exactarm as ea
from exactarm import _core
from exactarm.chain.angle_noise import angle_noise, quiet_acceleration
from exactarm.chain.encoder_counts import crept
from exactarm.chain.motion_record import BANDWIDTH_HZ, full_record, motion_record
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import NOTHING
from exactarm.robot_file import load_robot
from motions import fourier_motion, motion_data
from rigid_arm import LINKS_ALONE, rigid
from test_diagnose_tracked import tracked, ur10

HUNDREDTH, THOUSANDTH = np.radians(0.01), np.radians(0.001)
COULOMB_NM, NOISE_NM, RATE_HZ = 5.0, 0.5, 500.0


def rounded(data, step, ratios=1.0):
    """The same log with the output angles of gears rounded to a step in rad."""
    name, step = "q" if "q" in data.joints else "theta", step * np.abs(ratios)
    return replace(data, joints=data.joints | {name: np.round(data.joints[name] / step) * step})


def motion(robot, seed=5):
    """12 s at 500 Hz: rigid inverse dynamics, dry friction of 5 Nm, white noise; the seeds of the motions at
    100 Hz (test_diagnose_motion.py)."""
    time, angle, rate, acceleration = fourier_motion(robot, 12.0, RATE_HZ, seed=seed)
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque += COULOMB_NM * np.tanh(rate / 0.02)
    torque += np.random.default_rng(2).normal(0.0, NOISE_NM, torque.shape)
    return motion_data(robot, time, angle, torque)


@pytest.fixture(scope="module")
def racer():
    return rigid(**LINKS_ALONE)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2, 3])
def test_poses_seen_from_two_places(seed):
    """Each pose is visited in either of two set-ups: what its rounding does points another way there.

    Seeds 0 to 5 were tried with 60 poses visited thrice and with 50 visited four times; these three failed
    before. Two are left out: 60 poses of seed 0 are given a tracker's drift with exact angles, too, and 50 of
    seed 2, of which 35 identify 33 parameters, are unexplained by their held-out error."""
    made = ea.simulate("ur10", count=60 if seed else 50, visits=3 if seed else 4, noise=3e-5, counts=0,
                       seed=seed).data
    other = np.flatnonzero(np.arange(len(made)) % 2)
    turned = np.array([[0.0, -1.0, 0.0], [0.8, 0.0, 0.6], [-0.6, 0.0, 0.8]])
    position, session = made.position.copy(), made.session.copy()
    position[other], session[other] = position[other] @ turned.T + [0.3, -0.2, 1.0], session.max() + 1
    data = rounded(replace(made, position=position, session=session), 2.0 * HUNDREDTH)
    result = diagnose(load_robot("ur10"), data)
    assert result.verdict == NOTHING and not result.findings


@pytest.mark.slow
@pytest.mark.parametrize("step", [HUNDREDTH, THOUSANDTH])
def test_motions(racer, step):
    result = diagnose(racer, rounded(motion(racer), step, racer.ratios))
    assert result.verdict == NOTHING and not result.findings
    said = f"the angles are rounded to {np.degrees(step):.2g} degrees: torques are compared below"
    assert sum(line.startswith(said) for line in result.left_out) == 1


@pytest.mark.slow
def test_tracked_motions():
    """Accelerations hold the rounding of the very angles whose error is judged. No other seed was tried."""
    result = diagnose(ur10(), rounded(tracked(None, 9), HUNDREDTH))
    assert result.verdict == NOTHING and not result.findings


def test_accelerations_hold_as_much_noise_as_is_said(racer):
    """Of rounded angles, at two bandwidths; where the angles are exact, the filter is the usual one.
    What is smoothed between counts holds less."""
    data = motion(racer)
    exact, coarse = motion_record(racer, data), rounded(data, HUNDREDTH, racer.ratios)
    assert exact.bandwidth_hz == BANDWIDTH_HZ and not exact.creeping.any()
    step = 1.0 / RATE_HZ
    for bandwidth in (8.0, 15.0):
        fine, rough = (motion_record(racer, each, bandwidth) for each in (data, coarse))
        off = (rough.smooth(rough.theta_ddot) - fine.smooth(fine.theta_ddot))[fine.inside & ~rough.creeping]
        noise = HUNDREDTH / np.sqrt(12.0) * np.sqrt(2.0 * bandwidth * step)
        said = noise * (2.0 * np.pi * bandwidth) ** 2 / np.sqrt(5.0)
        found = np.sqrt(np.mean((off / racer.ratios) ** 2, axis=0))
        assert np.all((0.6 * said < found) & (found < 1.1 * said)), (found, said)


def test_the_bandwidth_falls_as_angles_are_rounded_more(racer):
    data = motion(racer)
    found = [motion_record(racer, rounded(data, step, racer.ratios)) for step in (THOUSANDTH, HUNDREDTH)]
    assert BANDWIDTH_HZ > found[0].bandwidth_hz > found[1].bandwidth_hz >= 5.0
    for record in found:
        left = record.noise.torque(record.bandwidth_hz) / record.noise.own
        assert np.max(left) < 0.34 or record.bandwidth_hz == 5.0


def test_friction_is_seen_in_how_torques_change(racer):
    data = motion(racer)
    theta = rounded(data, HUNDREDTH, racer.ratios).joints["theta"]
    noise = angle_noise(racer, data, theta, data.joints["tau"], None)
    assert_allclose(noise.slope * 0.02, COULOMB_NM, rtol=0.15)
    assert_allclose(noise.step, HUNDREDTH, rtol=1e-6)


@pytest.mark.parametrize("name", ["ur10", "kr300"])
def test_robots_without_ratios_or_lengths_and_torques_that_were_not_measured(name):
    robot, time = load_robot(name), np.arange(0.0, 4.0, 0.004)
    torque = np.random.default_rng(0).normal(0.0, 1.0, (len(time), robot.axes))
    torque[:, 2], torque[5:9, 1] = np.nan, np.nan
    angle = np.round(np.sin(time)[:, None] * np.ones(robot.axes) / THOUSANDTH) * THOUSANDTH
    data = motion_data(robot, time, angle, torque)
    record = motion_record(robot, data)
    assert 5.0 <= record.bandwidth_hz <= BANDWIDTH_HZ and np.isnan(record.noise.own[2])
    rates = data.joints | {"theta_dot": np.round(np.cos(time) * 100.0)[:, None] / 100.0 * robot.ratios}
    assert motion_record(robot, replace(data, joints=rates)).noise.of_rates


def test_rows_between_few_counts_creep():
    time = np.arange(0.0, 4.0, 1.0 / RATE_HZ)
    angle = np.where(time < 2.0, 5.0 * HUNDREDTH * np.sin(4.0 * time), 0.5 * time - 1.0)[:, None]
    angle[(time > 0.6) & (time < 1.4)] = angle[np.argmax(time > 0.6)]
    counted = np.round(angle / HUNDREDTH + 1e-4 * np.cos(9.0 * time[:, None])) * HUNDREDTH
    slow = crept(counted, time, 10.0)[:, 0]
    assert slow[(time > 0.1) & (time < 0.3)].all() and not slow[(time > 0.8) & (time < 1.2)].any()
    assert not slow[time > 2.1].any()


def test_rates_of_tracked_motions_are_filtered_below_the_noise_of_their_angles():
    data = tracked(None, 9)
    robot = ur10()
    fine, rough = full_record(robot, data), full_record(robot, rounded(data, HUNDREDTH))
    assert fine.bandwidth_hz == BANDWIDTH_HZ and rough.bandwidth_hz < 0.4 * BANDWIDTH_HZ
    off = np.sqrt(np.mean((rough.theta_ddot - fine.theta_ddot) ** 2, axis=0))
    assert np.all(off < 0.1 * np.sqrt(np.mean(fine.theta_ddot**2, axis=0)))
    assert quiet_acceleration(data.joints["q"], list(fine.runs), fine.step, 50.0) == 50.0
