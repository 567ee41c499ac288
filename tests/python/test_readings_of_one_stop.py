"""Readings that a device takes without a move between them: they show the device, not how well the arm comes
back, and count once.

Before, three readings of each pose counted as three poses that agree: unknown functions were certain where
the mean of the readings asked for nothing.
"""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.noise.estimate import estimate_noise
from set_ups import joints_in_limits, measured, true_robot
from six_axis import six_axis

READINGS = 3
ARM_M, DEVICE_M = 3e-5, 2e-6  # scatter of a coordinate from stop to stop, and within one


def readings(seed, poses=45):
    random = np.random.default_rng(seed)
    arm = six_axis(placed=False)
    data = measured(arm, [true_robot(arm, random)], [joints_in_limits(arm, poses, random)], ARM_M, random)
    read = data.select(np.repeat(np.arange(poses), READINGS))
    position = read.position + random.normal(0.0, DEVICE_M, read.position.shape)
    return arm, replace(read, position=position, row=np.arange(1, len(read) + 1))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_readings_of_one_stop_find_no_cause_and_are_no_repeated_visits(seed):
    arm, data = readings(seed)
    result = ea.diagnose(arm, data)
    assert result["verdict"] == "no_undeclared_effect"
    assert "upper bound" in result["noise_source"] and "without a move" in result["noise_source"]
    assert 0.7 < result["noise_floor"] / (np.sqrt(3.0) * ARM_M) < 1.4


@pytest.mark.slow
def test_visits_that_are_named_so_are_a_measure_of_the_noise():
    arm, data = readings(3)
    result = ea.diagnose(arm, replace(data, visit=np.repeat(np.arange(45), READINGS)))
    assert result["noise_source"].startswith("repeated visits")
    assert result["noise_floor"] < 2.0 * np.sqrt(3.0) * DEVICE_M


@pytest.mark.slow
def test_what_a_fit_has_taken_is_missing_in_what_poses_share():
    """34 poses, three readings each, 60 parameters of the poses fitted away."""
    random = np.random.default_rng(4)
    pose, columns = np.repeat(np.arange(34), READINGS), random.normal(size=(102, 60))
    found = []
    for _ in range(40):
        common = random.normal(0.0, ARM_M, 102)
        common -= columns @ np.linalg.lstsq(columns, common, rcond=None)[0]
        residual = common.reshape(34, 3)[pose] + random.normal(0.0, DEVICE_M, (102, 3))
        noise = estimate_noise(residual, 60.0, pose)
        found.append(float(np.sqrt(np.mean(noise.sigma**2) * noise.shared)))
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(ARM_M, rel=0.1)
