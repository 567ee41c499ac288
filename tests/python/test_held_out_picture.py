"""Held-out rows of time series: their residual and its Jacobian are those of the errors that are reported."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.diagnose.problems import problem_for
from exactarm.effects.rotor_inertia import RotorInertia
from motions import fourier_motion, motion_data
from rigid_arm import LINKS_ALONE, rigid


def parted(robot, data: Dataset):
    rows = data.split(0)
    return problem_for(robot, data.select(rows), data.select(~rows), 1, 0)


def motion():
    robot = rigid(**LINKS_ALONE)
    time, angle, rate, acceleration = fourier_motion(robot, 6.0, 100.0, seed=5)
    torque = _core.inverse_dynamics(robot.core, angle + robot.offsets, rate, acceleration)
    torque += 5.0 * np.tanh(rate / 0.02) + np.random.default_rng(2).normal(0.0, 0.5, torque.shape)
    data = motion_data(robot, time, angle, torque)
    return parted(robot, replace(data, identification=np.arange(time.size) < 400))


@pytest.mark.slow
def test_the_picture_is_that_of_the_errors():
    problem = motion()
    fitted = problem.fit(problem.declared())
    residual, jacobian = problem.held_out_picture(fitted)
    assert jacobian.shape == (*residual.shape, fitted.layout.size)
    errors = problem.errors(fitted, problem.held_out)
    np.testing.assert_allclose(np.sort(np.abs(residual).ravel()), np.sort(errors[np.isfinite(errors)]))
    step = 1e-4 * np.abs(fitted.layout.values).max() * np.eye(fitted.layout.size)[0]
    other = replace(fitted, layout=fitted.layout.at(fitted.layout.values + step))
    moved = problem.held_out_picture(other)[0]
    np.testing.assert_allclose(residual - moved, jacobian @ step, rtol=1e-3,
                               atol=1e-6 * np.abs(residual).max())


@pytest.mark.slow
def test_nothing_held_out_has_no_picture():
    problem = motion()
    none = problem.data.select(np.zeros(len(problem.data), bool))
    whole = problem_for(problem.robot, problem.data, none, 1, 0)
    assert whole.held_out_picture(whole.fit(whole.declared())) is None


@pytest.mark.slow
def test_a_rotor_beside_the_declared_model_has_a_column():
    problem = motion()
    layout = problem.declared().joined(Layout.of((RotorInertia(3, (0.0,)),)))
    residual, jacobian = problem.held_out_picture(problem.fit(layout))
    assert np.abs(jacobian[:, 2, -1]).max() > 0.0 and not jacobian[:, [0, 1, 3, 4, 5], -1].any()
    assert np.isfinite(residual).all()
