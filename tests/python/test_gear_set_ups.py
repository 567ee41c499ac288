"""A gyroscope behind axes that stand elsewhere in some runs: set-ups of their own; on the link: one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exactarm.chain import Layout
from exactarm.data.kinds import data_kinds
from exactarm.diagnose.gear_problem import GearProblem
from exactarm.effects.gyro_bias import GyroBias
from gear_simulation import DEGREE, GearRuns, simulate
from rigid_arm import rigid

NOISE = 0.05 * DEGREE
BIAS = np.array([-6e-3, -5e-3, 3e-3])
TURNED = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()


@pytest.fixture(scope="module")
def robot():
    """Without springs: the simulation turns one axis without gravity."""
    return rigid()


@pytest.fixture(scope="module")
def runs(robot):
    """Axis 2 to and fro four times; in runs 3 and 4 axis 5 stands elsewhere, which the file holds."""
    data = simulate(robot, GearRuns(2, 60.0 * DEGREE, 4, 200.0, NOISE), rest=np.zeros(6))
    theta = data.joints["theta"].copy()
    theta[data.run > 2, 4] += 0.6 * robot.ratios[4]
    return replace(data, joints={"theta": theta})


def at_the_flange(runs):
    """The same runs felt behind axis 5, by a sensor with a bias."""
    gyro = np.where((runs.run > 2)[:, None], runs.gyro @ TURNED.T, runs.gyro)
    return replace(runs, gyro=gyro + BIAS)


def test_a_gyroscope_on_the_link_of_the_gear_has_one_set_up(robot, runs):
    found = data_kinds(runs, robot)
    assert np.array_equal(found["session"], runs.session) and found["notes"] == ()


def test_a_stance_that_the_gyroscope_feels_is_a_set_up_and_said(robot, runs):
    data = at_the_flange(runs)
    found = data_kinds(data, robot)
    assert set(found["session"][data.run <= 2]) == {1} and set(found["session"][data.run > 2]) == {2}
    assert "runs 3, 4" in found["notes"][0]


def test_an_unseen_set_up_is_aligned_beside_the_bias_that_was_found(robot, runs):
    data = at_the_flange(runs)
    data = replace(data, session=data_kinds(data, robot)["session"])
    problem = GearProblem(robot, data.select(data.run <= 2), data.select(data.run > 2))
    bias = Layout.of((GyroBias(None, (0.0, 0.0, 0.0)),))
    fitted = problem.fit(problem.declared().joined(bias))
    errors = problem.errors(fitted, problem.held_out)
    # tables of one run a direction are known to a third of the noise
    assert np.sqrt(np.nanmean(errors**2)) == pytest.approx(NOISE, rel=0.1)


def test_one_speed_a_run_leaves_a_bias_small_that_it_cannot_part_from_the_alignment(robot, runs):
    """Constant speed, one way: only what lies along the axis shows; the rest was a hundred mrad/s."""
    rate = np.abs(np.gradient(runs.joints["theta"][:, 1] / robot.ratios[1], runs.time))
    steady = runs.select((runs.run == 1) & (rate > 0.99 * 60.0 * DEGREE))
    steady = replace(steady, gyro=steady.gyro + BIAS)
    problem = GearProblem(robot, steady, steady.select(np.zeros(len(steady), bool)))
    fitted = problem.fit(problem.declared().joined(Layout.of((GyroBias(None, (0.0, 0.0, 0.0)),))))
    value = fitted.layout.effects[-1].values
    low, high = fitted.fit.interval()[-3:].T
    assert np.all(np.abs(value) < 0.02) and np.all((low < BIAS) & (BIAS < high))
