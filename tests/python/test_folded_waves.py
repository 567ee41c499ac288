"""Declared gear waves that pass faster than a log's samples: what they leave in a torque folds back to any
order, and no wave is found there."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import motion_record
from exactarm.diagnose.joint_fit import candidates_for
from exactarm.diagnose.motion_problem import MotionProblem
from exactarm.diagnose.signal import Quantity
from exactarm.robot.robot import GearTable
from motions import fourier_motion, motion_data
from six_axis import six_axis

ORDER = 160.0


@pytest.fixture(scope="module")
def waving():
    """Axis 2 has a wave of ORDER a turn."""
    robot = six_axis()
    table = GearTable(np.array([ORDER]), np.array([1e-3]), np.array([0.0]))
    return robot.with_joint(1, cw=table, ccw=table)


def log_of(robot, rate_hz):
    time, angle, rate, _ = fourier_motion(robot, 10.0, rate_hz, 3)
    torque = np.random.default_rng(2).normal(0.0, 0.3, angle.shape)
    return motion_data(robot, time, angle, torque), rate


@pytest.mark.parametrize("rate_hz", [60.0, 1000.0])
def test_axes_fold_where_waves_pass_half_the_sampling_rate(waving, rate_hz):
    data, rate = log_of(waving, rate_hz)
    share = np.mean(ORDER * np.abs(rate[:, 1]) / (2.0 * np.pi) > 0.5 * rate_hz)
    expected = np.arange(6) == (1 if share > 0.1 else -1)
    np.testing.assert_array_equal(motion_record(waving, data).folded(waving), expected)
    assert (share > 0.1) == (rate_hz < 1000.0)  # both occur


@pytest.mark.slow
def test_no_wave_is_searched_of_an_axis_that_folds(waving):
    data, _ = log_of(waving, 60.0)
    for robot, folds in ((waving, True), (replace(waving, joints=six_axis().joints), False)):
        problem = MotionProblem(robot, data, data.select(np.zeros(0, int)))
        fitted = problem.fit(problem.declared())
        field = candidates_for(problem, fitted)
        waves = {effect.joint for effect in field if effect.of_waves}
        assert (2 in waves) != folds and {1, 3} < waves
        motors = {signal.axis for signal in problem.signals(fitted)
                  if signal.quantity == Quantity.MOTOR_ANGLE}
        assert (2 in motors) != folds and {1, 3} < motors
        assert any("gear waves of axis 2" in words for words in problem.left_out()) == folds
        assert any(effect.joint == 2 for effect in field)
