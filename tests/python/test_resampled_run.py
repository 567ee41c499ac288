"""Thinned gear runs: fewer rows, the same gear in them; between two encoders as under a gyroscope."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import gear_record
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.gear_problem import GearProblem
from exactarm.diagnose.resampled_run import resampled_run
from exactarm.diagnose.verdict import NOTHING
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_gear_runs

RATE_HZ, SECONDS = 1000.0, 20.0
WAVE_RAD, PER_MOTOR_TURN = 3e-5, 1.0
NOISE_RAD = 1e-5


@pytest.fixture(scope="module")
def robot():
    return load_robot("kr300")


def between_encoders(robot) -> Dataset:
    """Axis 1 turns to and fro with one error a motor revolution, of which its link encoder tells."""
    time = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    phi = np.zeros((time.size, 6))
    phi[:, 0] = 0.4 * np.sin(0.5 * time)
    q = np.full_like(phi, np.nan)
    noise = np.random.default_rng(3).normal(0.0, NOISE_RAD, time.size)
    q[:, 0] = phi[:, 0] + WAVE_RAD * np.cos(PER_MOTOR_TURN * robot.ratios[0] * phi[:, 0]) + noise
    joints = {"theta": phi * robot.ratios, "q": q}
    return Dataset.of_arrays("gear_run", joints, time=time, run=np.ones(time.size, int))


def test_link_encoders_keep_the_wave_and_lose_rows_and_noise(robot):
    data = between_encoders(robot)
    resampled, record = resampled_run(robot, data, gear_record(robot, data))
    assert record.encoder_axes == (0,)
    assert len(data) / 5 < len(resampled) <= len(data) / 3 + 1 and len(resampled) == len(record.theta)
    phi = record.theta[:, 0] / robot.ratios[0]
    error = resampled.joints["q"][:, 0] - phi
    inside = slice(50, -50)
    wave = np.cos(PER_MOTOR_TURN * robot.ratios[0] * phi)
    columns = np.column_stack([wave, np.ones_like(wave)])[inside]
    coefficients = np.linalg.lstsq(columns, error[inside], rcond=None)[0]
    assert coefficients[0] == pytest.approx(WAVE_RAD, rel=0.03)
    left = error[inside] - columns @ coefficients
    assert np.std(left) < 0.6 * NOISE_RAD  # 96 of 500 Hz are left of it


def test_the_overtone_of_a_wave_generator_passes_whole_at_every_speed(robot):
    """Four waves a motor revolution: what the low-pass took of them would look like a matter of speed."""
    time = np.arange(0.0, 4.0, 1.0 / 2000.0)
    speed = 2.0 * np.pi * 25.0 / abs(robot.ratios[0])
    phi = np.outer(speed * time, np.eye(6)[0])
    wave = np.cos(4.0 * robot.ratios[0] * phi[:, 0])
    q = np.where(np.arange(6) == 0, phi + WAVE_RAD * wave[:, None], np.nan)
    data = Dataset.of_arrays("gear_run", {"theta": phi * robot.ratios, "q": q}, time=time,
                             run=np.ones(time.size, int))
    resampled, record = resampled_run(robot, data, gear_record(robot, data))
    assert len(resampled) < len(data)
    inside = slice(50, -50)
    angle = record.theta[inside, 0]
    error = resampled.joints["q"][inside, 0] - angle / robot.ratios[0]
    assert 2.0 * np.mean(error * np.cos(4.0 * angle)) == pytest.approx(WAVE_RAD, rel=0.02)


def test_slow_records_stay_as_they_are(robot):
    data = between_encoders(robot).select(np.arange(0, int(SECONDS * RATE_HZ), 5))
    record = gear_record(robot, data)
    resampled, same = resampled_run(robot, data, record)
    assert resampled is data and same is record


def test_run_that_is_cut_in_motion_goes_on_moving_at_its_ends(robot):
    speed, time = 0.5, np.arange(0.0, 4.0, 1.0 / RATE_HZ)
    phi = np.outer(speed * time, np.eye(6)[0])
    q = np.where(np.arange(6) == 0, phi, np.nan)
    data = Dataset.of_arrays("gear_run", {"theta": phi * robot.ratios, "q": q}, time=time,
                             run=np.ones(time.size, int))
    resampled, record = resampled_run(robot, data, gear_record(robot, data))
    assert (
        len(resampled) < len(data) and 0.9 < record.keep.mean() < 1.0 and not record.keep[0]
        and not record.keep[-1]
    )
    assert np.max(np.abs(record.theta[:, 0] / robot.ratios[0] - speed * record.time)) < 1e-9
    assert np.max(np.abs(record.theta_dot[:, 0] / robot.ratios[0] - speed)) < 1e-7
    assert np.max(np.abs(resampled.joints["q"][:, 0] - speed * record.time)) < 1e-9


@pytest.mark.slow
def test_clean_runs_that_are_cut_in_motion_lack_nothing():
    robot = load_robot("racer-7-1.4")
    data = measure_gear_runs(VirtualRobot.of(robot), [1], [0.5, 1.0], 2, Sensors(), np.random.default_rng(1),
                             in_motion=True)
    found = diagnose(robot, data)
    assert not found.findings and found.verdict == NOTHING
    # Four samples at both ends of eight runs: the derivative has a lower order there (6 times the noise).
    (said,) = found.left_out
    assert said.startswith(f"64 of {len(data)} samples were left out: there a run is cut in motion")
    assert found.after["identification"].rms == pytest.approx(Sensors().gyro_rad_s, rel=0.05)


def test_samples_that_count_for_nothing_are_said():
    robot = load_robot("racer-7-1.4")
    runs = measure_gear_runs(VirtualRobot.of(robot), [1], [1.0], 1, Sensors(), np.random.default_rng(1))
    there_and_back = 1e-3 * np.arange(len(runs))  # one run that reverses
    data = replace(runs, run=np.ones(len(runs), int), time=there_and_back)
    problem = GearProblem(robot, data, data.select(np.zeros(0, int)))
    out = int(np.sum(~gear_record(robot, data, accelerating=True).keep))
    assert problem.left_out()[0].startswith(f"{out} of {len(data)} samples were left out") and out
