"""The torque error of a robot file on a motion: noise for the arm that made it, more for another, refused
without masses."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.errors import InputError
from exactarm.identify.evaluate import evaluate_motion
from exactarm.robot_file import load_robot
from motions import fourier_motion, motion_data


@pytest.fixture(scope="module")
def motion():
    return ea.simulate("racer-7-1.4", measure="motion", runs=2, seconds=4.0, noise=0.5, seed=3).data


@pytest.mark.slow
def test_the_arm_that_made_it_is_off_by_the_noise(motion):
    robot = load_robot("racer-7-1.4")
    own = evaluate_motion(robot, motion)
    last = robot.links[-1]
    heavier = replace(robot, links=robot.links[:-1] + (replace(last, mass=last.mass + 5.0),))
    other = evaluate_motion(heavier, motion)
    assert np.sqrt(np.mean(own.error**2)) < 0.5 < 5.0 < np.sqrt(np.mean(other.error**2))
    assert own.residual.shape == (len(own.data), 6) and own.columns[0] == "dtau_1_Nm"
    assert np.allclose(own.error, np.sqrt(np.mean(own.residual**2, axis=1)))
    # a row's RMS over the axes hides the axis that errs most
    assert own.overall.max == np.max(np.abs(own.residual)) and own.overall.n == own.residual.size
    assert own.overall.mean == pytest.approx(np.mean(np.abs(own.residual)))


def test_a_file_without_masses_is_refused():
    robot = replace(load_robot("racer-7-1.4"), links=None)
    time, angle, _, _ = fourier_motion(robot, 1.0, 100.0, 3)
    with pytest.raises(InputError, match="has no masses"):
        evaluate_motion(robot, motion_data(robot, time, angle))
