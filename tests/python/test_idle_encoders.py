"""Gear runs between encoders that log all axes, whichever is turned: those that rest, and dead encoders."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain.idle_encoders import without_idle_encoders
from exactarm.data.dataset import Dataset, read_dataset
from exactarm.files.examples import data_path
from exactarm.identify.gear import identify_gears
from exactarm.robot_file import load_robot

NOISE_RAD = 4e-6  # of an encoder behind a gear


@pytest.fixture(scope="module")
def runs():
    """Axes 2 and 3 of the KR300; axis 1 rests, elsewhere in each of the runs, and its encoder has noise (any
    seed: none of it is compared)."""
    robot = load_robot("kr300")
    files = [data_path(f"kr300/run_{name}.parquet") for name in "AB"]
    return robot, resting(read_dataset(files, robot, "gear_run"), robot, 0)


def resting(data: Dataset, robot, axis: int) -> Dataset:
    angle = np.where(data.run == data.run[0], 0.3, -0.4)
    noise = np.random.default_rng(1).normal(0.0, NOISE_RAD, len(data))
    return changed(data, axis, theta=angle * robot.ratios[axis], q=angle + noise)


def changed(data: Dataset, axis: int, **columns: np.ndarray) -> Dataset:
    joints = {name: values.copy() for name, values in data.joints.items()}
    for name, values in columns.items():
        joints[name][:, axis] = values
    return replace(data, joints=joints)


def encoders(data: Dataset) -> list[int]:
    return np.flatnonzero(~np.isnan(data.joints["q"][0])).tolist()


def test_an_axis_that_rests_in_every_run_tells_nothing_of_its_gear(runs):
    """Its noise was taken for a ratio, and the runs of all axes were refused by it."""
    robot, data = runs
    part, = without_idle_encoders(robot, data)
    assert (encoders(data), encoders(part)) == ([0, 1, 2], [1, 2])
    found = identify_gears(robot, data)
    assert {gear.joint for gear in found.gears} == {2, 3}
    assert "axis 1 stands still beside the others" in found.warnings[0]


def test_a_dead_encoder_is_none(runs):
    """Of a constant column what rounding left was "something else", and every cause was thrown away."""
    robot, data = runs
    dead = changed(data, 2, q=np.full(len(data), 0.123))
    assert encoders(without_idle_encoders(robot, dead)[0]) == [1]
    alone = changed(dead, 1, q=np.full(len(data), 0.2))
    assert without_idle_encoders(robot, alone) == (alone,)  # nothing would be left; what fails says why


def test_an_axis_that_moves_in_one_part_alone_keeps_its_encoder_in_both(runs):
    robot, data = runs
    first = data.run == data.run[0]
    here, there = data.select(first), data.select(~first)
    rest = resting(here, robot, 1)
    assert [encoders(part) for part in without_idle_encoders(robot, rest, there)] == [[1, 2], [1, 2]]
    assert encoders(without_idle_encoders(robot, rest)[0]) == [2]
    none = there.select(np.zeros(len(there), bool))
    assert encoders(without_idle_encoders(robot, here, none)[0]) == [1, 2]
