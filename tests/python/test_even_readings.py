"""Readings at the even clock of their run: those that were taken when their stamps say, and no others."""

from dataclasses import replace

import numpy as np

from exactarm.chain import gear_record, predict_gear_run
from exactarm.data.even_readings import at_even_readings
from exactarm.identify.gear_declared import sensor_layout
from gear_simulation import DEGREE, GearRuns, simulate
from rigid_arm import rigid

STEP_S, LATE = 0.01, 0.1  # of a step
NOISE = 2e-4


def gyroscope_runs(read_at_stamps: bool):
    """Axis 1 to and fro smoothly at 100 Hz, stamps a tenth of a step off."""
    robot = rigid().with_joint(0, cw=None, ccw=None)
    data = simulate(robot, GearRuns(1, 40.0 * DEGREE, 1, 1.0 / STEP_S, 0.0, tilt=(0.0, 0.0), counts=0))
    random = np.random.default_rng(8)
    time = np.arange(3000) * STEP_S
    late = LATE * STEP_S * np.clip(random.standard_normal(time.size), -2.0, 2.0)
    at = time + late if read_at_stamps else time
    angle, rate = 1.2 * np.sin(1.1 * at), 1.32 * np.cos(1.1 * at)
    data = data.select(np.resize(np.arange(len(data)), time.size))
    theta = np.repeat(data.joints["theta"][:1], time.size, axis=0)
    theta[:, 0] = angle * robot.ratios[0]
    gyro = NOISE * random.standard_normal((time.size, 3))
    gyro[:, 2] += rate
    return robot, replace(data, time=time + late, gyro=gyro, run=np.ones(time.size, int),
                          joints=data.joints | {"theta": theta})


def test_what_was_read_at_its_stamps_meets_the_prediction():
    robot, data = gyroscope_runs(True)
    even = at_even_readings(data)
    record = gear_record(robot, even)
    left = predict_gear_run(robot, sensor_layout(robot, even, record), even, record=record).residual()
    left = left[record.keep, 2]
    assert np.count_nonzero(record.keep) > 0.8 * len(data)
    assert np.sqrt(np.mean(left**2)) < 1.1 * NOISE


def test_what_was_read_evenly_and_stamped_late_stays():
    data = gyroscope_runs(False)[1]
    assert np.array_equal(at_even_readings(data).gyro, data.gyro)


def test_an_encoder_at_the_output_is_moved_as_well():
    random = np.random.default_rng(9)
    robot, data = gyroscope_runs(True)
    q = np.full_like(data.joints["theta"], np.nan)
    q[:, 0] = data.joints["theta"][:, 0] / robot.ratios[0] + 2e-6 * random.standard_normal(len(data))
    even = at_even_readings(replace(data, gyro=None, joints=data.joints | {"q": q}))
    record = gear_record(robot, even)
    left = even.joints["q"][:, 0] - record.theta[:, 0] / robot.ratios[0]
    assert np.std(left[2:-2]) < 1.2 * 2e-6
    assert np.isnan(even.joints["q"][:, 1:]).all()
