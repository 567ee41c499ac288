"""Waves in time beside waves of a gear, at one speed, where both are lines of the same spectrum."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import cumulative_trapezoid

from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import NOTHING
from exactarm.diagnose.wave_in_time import _Cause, _Contest, waves
from exactarm.numerics.signals import gaussian_filter
from exactarm.robot_file import load_robot

AXIS, RUNS, STEP_S, NOISE = 2, 6, 2.5e-3, 1e-3  # axis from 0; rad/s
SPEED, ORDER, RIPPLE_RAD = 0.8, 31.0, 5e-5  # the gear's line stands at 3.9 Hz
SHAKE_HZ, SHAKE = 6.3, 2e-3


@pytest.fixture(scope="module")
def racer():
    robot = load_robot("racer-7-1.4")
    return replace(robot, links=None, joints=tuple(replace(j, cw=None, ccw=None) for j in robot.joints))


def one_speed(robot, *, gear=False, shakes=None, hertz=SHAKE_HZ):
    """Runs to one side and back at SPEED; shakes: phases (RUNS,) of a floor that shakes, and how fast its
    size changes in Hz."""
    random = np.random.default_rng(7)
    parts = []
    for run in range(RUNS):
        time = np.arange(0.0, 4.0, STEP_S)
        rate = SPEED * np.clip(np.minimum(time, time[-1] - time) / 0.3 - 0.3, 0.0, 1.0)
        rate = gaussian_filter(rate, time, 8.0) * (1.0 if run % 2 else -1.0)
        output = cumulative_trapezoid(rate, dx=STEP_S, initial=0.0) - 1.2
        theta, gyro = np.zeros((time.size, robot.axes)), random.normal(0.0, NOISE, (time.size, 3))
        theta[:, AXIS] = output * robot.joints[AXIS].ratio
        gyro[:, 2] += rate * (1.0 + gear * RIPPLE_RAD * ORDER * np.cos(ORDER * output))
        if shakes is not None:
            phase, swell_hz = shakes
            wave = np.sin(2.0 * np.pi * hertz * time + phase[run]) * np.cos(2.0 * np.pi * swell_hz * time)
            gyro += SHAKE * wave[:, None] * np.array([0.3, -0.2, 0.9])
        parts.append((theta, gyro, time, np.full(time.size, run + 1)))
    theta, gyro, time, run = map(np.concatenate, zip(*parts))
    return Dataset.of_arrays("gear_run", {"theta": theta}, time=time, run=run, gyro=gyro)


def frequency_told(result):
    return float(re.search(r"([\d.]+) Hz", result.sentence)[1])


def test_what_the_declared_parameters_explain_is_no_wave_and_no_effect():
    """Cleared of them only rounding is left, whose products are of any sign."""
    time, rng = np.arange(400) * STEP_S, np.random.default_rng(2)
    runs, hertz = [np.arange(400)], 5.0
    line = waves(time, hertz, 1)[:, None]  # (N, 1, 2)
    basis = np.linalg.qr(np.concatenate([line[:, 0], np.ones((400, 1))], axis=1))[0]
    residual = rng.normal(size=400)
    residual -= basis @ (basis.T @ residual)
    bare = SimpleNamespace(basis=basis, residual=residual[:, None], free_residual=residual, data_numbers=400,
                           standard=lambda response: response.reshape(400, -1))
    causes = [_Cause(1e5 * basis @ rng.normal(size=(3, 9)), np.full(9, np.inf), 1.0)]
    contest = _Contest(bare, causes, runs, time, 400.0, 1)
    wave = contest.wave(hertz, 1)
    assert_allclose(contest.left(wave), residual, atol=1e-4)
    assert np.isfinite(contest.best(wave)[0])


@pytest.mark.parametrize("begins_with_run", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_a_floor_that_shakes_is_no_gear(racer, begins_with_run):
    """Where it begins with every run it imitates a gear of two tables: direction and speed dependence at 1.00
    before."""
    own = np.random.default_rng(3).uniform(0.0, 6.0, RUNS)
    result = diagnose(racer, one_speed(racer, shakes=(0.0 * own if begins_with_run else own, 0.0)))
    assert result.verdict == "unexplained" and result.findings == ()
    assert_allclose(frequency_told(result), SHAKE_HZ, atol=0.25)


@pytest.mark.slow
def test_one_whose_size_changes_is_no_gear(racer):
    own = np.random.default_rng(3).uniform(0.0, 6.0, RUNS)
    result = diagnose(racer, one_speed(racer, shakes=(own, 0.15)))
    assert result.verdict == "unexplained" and result.findings == ()
    assert_allclose(frequency_told(result), SHAKE_HZ, atol=0.25)


@pytest.mark.slow
def test_hum_of_the_mains_is_told_and_explains_itself(racer):
    """No rest shows it; in phase with every run, it imitates a gear."""
    result = diagnose(racer, one_speed(racer, shakes=(np.zeros(RUNS), 0.0), hertz=50.02))
    assert result.verdict == NOTHING and result.findings == ()
    assert any("hum of the mains at 50 Hz" in text for text in result.left_out)


def waves_of_the_gear(result):
    """At one speed, one that grows with speed is the same."""
    found = [f.effect for f in result.findings if f.probability >= 0.5]
    assert found and {effect.name for effect in found} <= {"gear_harmonics", "speed_dependence"}
    assert {effect.joint for effect in found} == {AXIS + 1}
    return [effect.values[0] for effect in found]


@pytest.mark.slow
def test_a_wave_of_the_gear_stays_one(racer):
    result = diagnose(racer, one_speed(racer, gear=True))
    assert result.verdict == "explained"
    assert_allclose(waves_of_the_gear(result), ORDER, atol=0.2)


@pytest.mark.slow
def test_beside_a_floor_that_shakes_the_gear_keeps_its_wave(racer):
    result = diagnose(racer, one_speed(racer, gear=True, shakes=(np.zeros(RUNS), 0.0)))
    assert result.verdict == "unexplained"
    assert_allclose(frequency_told(result), SHAKE_HZ, atol=0.05)
    assert_allclose(waves_of_the_gear(result), ORDER, atol=0.2)
    assert result.after["validation"].rms < 1.05 * NOISE
