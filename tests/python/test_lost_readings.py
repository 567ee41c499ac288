"""Readings that were lost and written as 0 are told by their column; what passes 0 or rests there is not."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.data.dataset import read_dataset
from exactarm.files.examples import data_path
from exactarm.first_aid.first_aid import first_aid
from exactarm.first_aid.lost_readings import MOST_ROWS, lost_readings
from exactarm.robot_file import load_robot


@pytest.fixture(scope="module")
def tx40():
    robot = load_robot("tx40")
    return robot, read_dataset(data_path("tx40/motion.parquet"), robot)


def with_zeros(data, name, axis, rows):
    values = data.joints[name].copy()
    values[rows, axis - 1] = 0.0
    return replace(data, joints=data.joints | {name: values})


@pytest.mark.parametrize("name, axis, rows", [
    ("tau_motor", 2, np.arange(50, 45000, 50)),
    ("theta", 3, (np.arange(100, 45000, 500)[:, None] + np.arange(MOST_ROWS)).ravel()),
])
@pytest.mark.slow
def test_zeros_between_other_readings_are_told(tx40, name, axis, rows):
    robot, data = tx40
    found = first_aid(robot, with_zeros(data, name, axis, rows))
    assert found[0].startswith(f"column {name}_{axis} is exactly 0 for a moment between readings of another "
                               "size ") and found[0].endswith(": were readings lost?")


def test_a_brake_a_reversal_and_a_column_that_is_never_measured_are_no_lost_readings(tx40):
    robot, data = tx40
    braked = (np.arange(1000, 45000, 4000)[:, None] + np.arange(10 * MOST_ROWS)).ravel()
    coarse = np.round(data.joints["tau_motor"] / 0.05) * 0.05  # passes and meets 0 in its noise
    random = np.random.default_rng(1)  # a wrist whose torque is about half a step
    torque = data.joints["tau_motor"].copy()
    torque[:, 5] = 0.05 + 0.015 * random.standard_normal(len(data))
    steps = np.round(torque / 0.1) * 0.1
    never = np.arange(len(data))
    assert list(lost_readings(data)) == []
    assert list(lost_readings(with_zeros(data, "tau_motor", 2, braked))) == []
    assert list(lost_readings(replace(data, joints=data.joints | {"tau_motor": coarse}))) == []
    assert list(lost_readings(replace(data, joints=data.joints | {"tau_motor": steps}))) == []
    assert list(lost_readings(with_zeros(data, "tau_motor", 2, never))) == []
