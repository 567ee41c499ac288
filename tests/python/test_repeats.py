"""Readings of one pose: what the arm misses the pose by is read each time, and told once."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.identify.declared import geometry_layout
from exactarm.identify.repeats import worth_of_rows
from identification_poses import racer_like
from set_ups import at_random_place, joints_in_limits, measured
from six_axis import six_axis

POSES, READINGS = 60, 5
OF_THE_ARM_M, OF_THE_DEVICE_M = 1e-4, 5e-6
OPTIONS = CalibrationOptions(orientation=False, compliance=())


def arm():
    return six_axis(placed=False)


def read_again(rng, readings, nominal=None, built=None):
    """Poses that the arm misses by errors of its own, each read several times by a device of less scatter."""
    nominal = nominal or arm()
    data = measured(nominal, [at_random_place(built or nominal, rng)],
                    [joints_in_limits(nominal, POSES, rng)], OF_THE_ARM_M, rng, noise_rad=1e-4,
                    identification=np.ones(POSES, bool))
    again = data.select(np.repeat(np.arange(POSES), readings))
    return replace(again, position=again.position + rng.normal(0.0, OF_THE_DEVICE_M, again.position.shape))


@pytest.mark.parametrize(("shared", "readings", "worth"), [(0.0, 4, 1.0), (1.0, 4, 0.25), (0.8, 3, 1 / 2.6)])
def test_readings_are_worth_what_they_do_not_share(shared, readings, worth):
    rng, poses = np.random.default_rng(1), np.repeat(np.arange(400), readings)
    left = np.sqrt(shared) * rng.normal(size=(400, 3))[poses]
    left += np.sqrt(1.0 - shared) * rng.normal(size=(len(poses), 3))
    assert np.mean(worth_of_rows(left, poses)) == pytest.approx(worth, abs=0.05)


def test_poses_read_once_are_worth_a_row_each():
    left = np.random.default_rng(2).normal(size=(50, 3))
    poses = np.minimum(np.arange(50), 45)  # one of them five times
    assert np.all(worth_of_rows(left, poses) == 1.0)  # too few to say
    poses = np.minimum(np.arange(50), 35)  # one of them fifteen times
    left[35:] = left[35]
    worth = worth_of_rows(left, poses)
    assert np.all(worth[:35] == 1.0) and worth[35:] == pytest.approx(1.0 / 15.0)


@pytest.mark.parametrize("orientation", [False, True])
@pytest.mark.slow
def test_more_readings_of_the_same_poses_narrow_no_interval(orientation):
    options = replace(OPTIONS, orientation=orientation)
    once, often = (calibrate(arm(), read_again(np.random.default_rng(3), count), options)
                   for count in (1, READINGS))
    assert once.names == often.names
    assert np.ptp(often.intervals, axis=1) == pytest.approx(np.ptp(once.intervals, axis=1), rel=0.05)


@pytest.mark.slow
def test_intervals_hold_the_truth_however_often_each_pose_is_read():
    """The declared arm itself, at 8 places: 95 % of 8 x 20 numbers within 3 standard errors; independent rows
    held 59 %. No seed was picked: from 10, 20, 100 and 200 on they hold 95.7, 97.8, 91.8 and 97.8 %."""
    inside = []
    for seed in range(8):
        result = calibrate(arm(), read_again(np.random.default_rng(10 + seed), READINGS), OPTIONS)
        layout = geometry_layout(arm())
        truth = dict(zip(layout.names, layout.values))
        inside += [low < truth[name] < high for name, (low, high) in zip(result.names, result.intervals)
                   if name in truth]
    assert abs(np.mean(inside) - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / len(inside)), np.mean(inside)


def test_readings_that_scatter_by_themselves_all_count():
    rng = np.random.default_rng(4)
    nominal = arm()
    q = np.repeat(joints_in_limits(nominal, POSES, rng), READINGS, axis=0)
    data = measured(nominal, [at_random_place(nominal, rng)], [q], OF_THE_ARM_M, rng,
                    identification=np.ones(len(q), bool))
    one, all_of_them = (calibrate(nominal, data.select(rows), OPTIONS) for rows in
                        (np.arange(0, len(q), READINGS), np.arange(len(q))))
    ratio = np.median(np.ptp(all_of_them.intervals, axis=1) / np.ptp(one.intervals, axis=1))
    assert ratio == pytest.approx(1.0 / np.sqrt(READINGS), rel=0.2)


def test_a_tilt_is_no_better_told_by_reading_each_pose_twelve_times():
    """One of 1.6 standard deviations, which chance makes in one set of nine (p = 0.1; twelve times: 1e-9)."""
    nominal = racer_like(hayati=False)
    joints = nominal.joints
    leaning = replace(nominal, joints=(joints[0], replace(joints[1], beta=4e-5), *joints[2:]))
    data = read_again(np.random.default_rng(30), 12, nominal, leaning)
    result = calibrate(nominal, data, OPTIONS)
    low, high = result.intervals[result.names.index("beta_2_rad")]
    assert low < 0.0 < 4e-5 < high
