"""Groups of a cross-validation in time series: an effect that one run alone shows is judged by stretches of
that run."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import predict_gear_run
from exactarm.data.dataset import Dataset
from exactarm.diagnose.cross_validation import CrossValidation
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.time_groups import stretches_of_response
from exactarm.diagnose.verdict import EXPLAINED
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, parse_effect
from exactarm.simulate.profiles import gear_run
from exactarm.simulate.sensors import read

RUNS = np.repeat(np.arange(1, 7), 200)


def lost_of(response):
    """(N,) of an effect beside which nothing is free: each run's own share."""
    shares = np.bincount(RUNS, weights=response) / max(response.sum(), 1e-300)
    return shares[RUNS]


def test_what_one_run_shows_is_judged_by_stretches_of_equal_response():
    response = np.where(RUNS == 4, 1.0, 1e-4)
    response[700:] *= np.where(RUNS[700:] == 4, 3.0, 1.0)
    groups = stretches_of_response(RUNS, response, lost_of(response), memory_rows=1.0)
    assert np.array_equal(groups[RUNS != 4], RUNS[RUNS != 4])
    inside = groups[RUNS == 4]
    shares = np.array([response[RUNS == 4][inside == name].sum() for name in np.unique(inside)])
    assert len(shares) == 20 and np.all(np.diff(inside) >= 0) and np.ptp(shares) < 0.4 * shares.mean()


@pytest.mark.parametrize("response, memory", [
    (np.ones(RUNS.size), 1.0),  # every run shows it
    (np.where(RUNS == 4, 1.0, 0.0), 30.0),  # the noise remembers longer than a stretch would last
    (np.eye(1, RUNS.size, 700)[0], 1.0),  # one row is no shape
    (np.zeros(RUNS.size), 1.0),
])
def test_all_else_is_judged_by_whole_groups(response, memory):
    assert stretches_of_response(RUNS, response, lost_of(response), memory) is RUNS


def test_what_goes_with_one_run_is_judged_by_its_stretches_though_all_show_it():
    """A step before the last run beside a free constant: the others alone take it for the constant."""
    basis = np.full((RUNS.size, 1), RUNS.size**-0.5)
    step = (RUNS == 6) - np.mean(RUNS == 6)
    column = (step / np.linalg.norm(step))[:, None]
    told = CrossValidation(basis, np.zeros(RUNS.size), RUNS.size, RUNS - 1).told_by_others(column)
    np.testing.assert_allclose(told[5], 0.0, atol=1e-9)
    assert np.all(told[:5] > 0.9)
    groups = stretches_of_response(RUNS, column[:, 0]**2, (1.0 - told)[RUNS - 1], memory_rows=1.0)
    assert np.array_equal(groups[RUNS < 6], RUNS[RUNS < 6]) and len(np.unique(groups[RUNS == 6])) == 20


@pytest.mark.slow
def test_hysteresis_is_found_in_the_one_run_that_reverses():
    robot, axis = load_robot("racer-7-1.4"), 1
    virtual = VirtualRobot.of(robot, [parse_effect("hysteresis joint=2 size_rad=3e-4 reach_rad=3e-3", 6)])
    time, q = map(list, zip(*(gear_run(robot, axis, 0.5 + 0.1 * k, k % 2 == 0, 1000.0) for k in range(5))))
    time.append(np.arange(0.0, 12.0, 1e-3))
    q.append(np.tile(q[0][0], (time[-1].size, 1)))
    q[-1][:,
          axis] = np.median(q[0][:, axis]) + 0.5 * np.sin(0.94 * time[-1]) + 0.2 * np.sin(
              2.3 * time[-1] + 1.0
          )
    run = np.repeat(np.arange(1, 7), [part.size for part in time])
    theta, time = virtual.motor_angles(np.concatenate(q)), np.concatenate(time)
    data = Dataset.of_arrays("gear_run", {"theta": theta}, time=time, run=run, gyro=np.zeros((time.size, 3)))
    exact = predict_gear_run(virtual.true, virtual.layout, data, tangents=False).measured
    data = read(replace(data, gyro=exact, identification=run != 2), Sensors(), np.random.default_rng(1))
    found = diagnose(robot, data)
    assert found.verdict == EXPLAINED and [f.effect.label for f in found.findings] == ["hysteresis_2"]
    assert found.findings[0].effect.values == pytest.approx((3e-4, 3e-3), rel=0.05)
