"""Diagnosis between two encoders: a cause is named although the noise drifts further than the cause moves the
joint."""

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout, predict_gear_run
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects import effect_from_table
from exactarm.effects.load_dependence import LoadDependence
from exactarm.identify.evaluate import evaluate_gear_runs
from exactarm.robot_file import load_robot

RATE_HZ, SECONDS, RUNS = 125.0, 8.0, 2
COMPLIANCE, FRICTION_NM = 1.2e-7, 500.0
MEMORY, DRIFT_RAD = 0.95, 2e-5


@pytest.fixture(scope="module")
def robot():
    return load_robot("kr300")


def drift(random, rows):
    noise = np.zeros((rows, 2))
    for t in range(1, rows):
        noise[t] = MEMORY * noise[t - 1] + np.sqrt(1.0 - MEMORY**2) * random.normal(0.0, DRIFT_RAD, 2)
    return noise


def measured(robot, compliance: float, seed: int = 7) -> Dataset:
    """Axes 1 and 2 wander; the link of axis 2 is heavy, and the motors report what their friction takes as
    well."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    parts = {"theta": [], "q": [], "tau_motor": []}
    for _ in range(RUNS):
        waves = [(random.uniform(0.05, 0.3), random.uniform(0.5, 4.0), random.uniform(0.0, 6.0))
                 for _ in range(8)]
        phi, rate, acceleration = np.zeros((3, time.size, 6))
        for k, (size, omega, phase) in enumerate(waves):
            phi[:, k % 2] += size * np.sin(omega * time + phase)
            rate[:, k % 2] += size * omega * np.cos(omega * time + phase)
            acceleration[:, k % 2] -= size * omega**2 * np.sin(omega * time + phase)
        load = np.zeros_like(phi)
        load[:, 1] = 2500.0 * np.cos(phi[:, 1]) + 900.0 * acceleration[:, 1]
        link = phi[:, :2] - compliance * load[:, :2]
        parts["theta"].append(phi * robot.ratios)
        parts["q"].append(np.hstack([link + drift(random, time.size), np.full((time.size, 4), np.nan)]))
        parts["tau_motor"].append((load + FRICTION_NM * np.tanh(rate / 0.01)) / robot.ratios)
    joints = {name: np.concatenate(values) for name, values in parts.items()}
    run = np.repeat(np.arange(1, RUNS + 1), time.size)
    return Dataset.of_arrays("gear_run", joints, time=np.tile(time, RUNS), run=run)


@pytest.fixture(scope="module")
def result(robot):
    return diagnose(robot, measured(robot, COMPLIANCE))


@pytest.mark.slow
def test_names_the_gear_that_winds_up_under_a_measured_torque(result):
    assert [(f.effect.name, f.effect.joint) for f in result.findings] == [("load_dependence", 2)]
    (low, high), (least, most) = result.findings[0].intervals
    assert low < COMPLIANCE < high and high - low < COMPLIANCE
    assert least < COMPLIANCE * FRICTION_NM < most
    axes = {axis["joint"]: axis for axis in result.axes}
    assert axes[2]["after"] < 0.5 * axes[2]["before"]
    assert axes[1]["after"] == pytest.approx(axes[1]["before"], rel=0.02)


@pytest.mark.slow
def test_the_updated_robot_carries_what_was_found(robot, result):
    left = evaluate_gear_runs(result.robot, measured(robot, COMPLIANCE)).error
    declared = evaluate_gear_runs(robot, measured(robot, COMPLIANCE)).error
    assert np.sqrt(np.mean(left**2)) < 0.5 * np.sqrt(np.mean(declared**2))


@pytest.mark.slow
def test_a_second_diagnosis_adds_nothing(robot, result):
    again = diagnose(result.robot, measured(robot, COMPLIANCE))
    assert not again.findings


@pytest.mark.slow
def test_a_slow_cause_in_white_noise_is_no_drift(robot):
    """A ratio and a delay, either of them slow; what both leave is white."""
    data = measured(robot, 0.0)
    random = np.random.default_rng(11)
    rate = np.concatenate([np.gradient(data.joints["theta"][data.run == run], 1.0 / RATE_HZ, axis=0)
                           for run in (1, 2)])
    phi = data.joints["theta"][:, 0] / robot.ratios[0]
    link = data.joints["theta"][:, :2] / robot.ratios[:2] + random.normal(0.0, 1e-5, (len(data), 2))
    link[:, 0] += 4e-5 * phi
    q = np.hstack([link - 3e-5 * rate[:, :2] / robot.ratios[:2], np.full((len(data), 4), np.nan)])
    arrays = {"theta": data.joints["theta"], "q": q}
    found = diagnose(robot, Dataset.of_arrays("gear_run", arrays, time=data.time, run=data.run)).findings
    assert {(f.effect.name, f.effect.joint) for f in found} == {("time_delay", None), ("gear_ratio", 1)}


def test_drift_alone_is_no_effect(robot):
    result = diagnose(robot, measured(robot, 0.0))
    assert not result.findings


def test_wind_up_and_the_friction_of_the_drive_have_the_right_derivatives(robot):
    data, layout = measured(robot, COMPLIANCE), Layout.of((LoadDependence(2, (1e-7, 5e-5)),))
    predict = lambda x: predict_gear_run(robot, layout.at(x), data, tangents=False).measured
    jacobian = predict_gear_run(robot, layout, data).jacobian
    assert_derivative(predict, layout.values, jacobian, np.array([1e-9, 1e-7]), relative=1e-6)
    assert (
        np.abs(jacobian[:, 1, 0]).max() > 1000.0
        and np.abs(jacobian[:, 1, 1]).max() == pytest.approx(1.0, abs=0.05)
    )


def test_robot_file_gives_it_back(robot):
    effect = LoadDependence(2, (1e-7, 5e-5))
    assert effect_from_table(effect.to_table()) == effect
