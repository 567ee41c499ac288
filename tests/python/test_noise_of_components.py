"""A device whose coordinates are not equally precise: each counts by its own noise."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.identify import pose_fit
from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.identify.evaluate import evaluate_poses
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, deviated, measure_poses
from set_ups import joints_in_limits

NOISE_M = np.array([2e-5, 2e-5, 2e-4])


def measured(seed, noise):
    """120 poses of an arm that deviates, and 200 without noise."""
    random = np.random.default_rng(seed)
    nominal = load_robot("ur10")
    virtual = VirtualRobot.of(nominal, [], deviated(nominal, 1.0, random, frames=False))
    exact = Sensors(position_m=0.0, counts=0)
    data, fresh = (measure_poses(virtual, joints_in_limits(nominal, count, random), exact, random)
                   for count in (120, 200))
    spoilt = data.position + noise * random.normal(size=data.position.shape)
    return nominal, replace(data, position=spoilt), fresh


def error(seed, noise):
    nominal, data, fresh = measured(seed, noise)
    result = calibrate(nominal, data, CalibrationOptions())
    return result, evaluate_poses(result.robot, fresh).overall.mean


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.slow
def test_precise_coordinates_are_not_spoilt_by_another(seed, monkeypatch):
    """Weighed alike, the noise of z is in all parameters: 0.029 to 0.053 mm are left, else 0.010 to 0.013.
    Seeds: the first four, none was left out (0 to 7: 0.029 to 0.059 mm, and 0.009 to 0.013)."""
    result, left = error(seed, NOISE_M)
    np.testing.assert_allclose(result.fit.sigma, NOISE_M, rtol=0.35)
    monkeypatch.setattr(pose_fit, "_APART", np.inf)
    assert left < 1.5e-5 < 2.5e-5 < error(seed, NOISE_M)[1]


@pytest.mark.parametrize("seed", [0, 1])  # the first two, none was left out
def test_equal_coordinates_share_one_scale(seed):
    result, _ = error(seed, np.full(3, 5e-5))
    assert np.ptp(result.fit.sigma) == 0.0
