"""What is done to a motion and must come back in its identification: runs in another order or twice, an axis
that counts the other way or from another zero, the mirror image, noise of another size."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout, motion_record, predict_motion
from exactarm.commands.identify import identify
from exactarm.commands.plain import plain
from exactarm.data.dataset import Dataset
from exactarm.robot.robot import Robot
from motions import fourier_motion, motion_data
from six_axis import six_axis
from test_metamorphic_mirror import mirrored_robot

NOISE_NM = np.array([2.0, 3.0, 1.5, 0.5, 0.3, 0.2])
RATE_HZ, SECONDS = 125.0, 10.0
AXIS, MOVED_RAD = 2, 0.3  # counted from 0; what is turned round, or by how much its zero is moved
# The iteration of the weights ends at a tolerance: a thousandth of an interval (measured: below 1e-4).
SAME = 1e-2


def logs(noise: float = 1.0, seeds: tuple[int, ...] = (1, 2, 3)) -> Dataset:
    """One run for each seed, the last of which validates."""
    robot, times, angles, torques = six_axis(), [], [], []
    for seed in seeds:
        time, angle, _, _ = fourier_motion(robot, SECONDS, RATE_HZ, seed, base_hz=0.1, amplitude=0.9)
        record = motion_record(robot, motion_data(robot, time, angle), RATE_HZ)
        torque = predict_motion(robot, Layout.of(()), record, tangents=False).torque
        white = np.random.default_rng(seed).normal(0.0, noise * NOISE_NM, torque.shape)
        times, angles, torques = [*times, time], [*angles, angle], [*torques, torque + white]
    run = np.repeat(np.arange(len(seeds)) + 1, len(times[0]))
    return motion_data(robot, np.concatenate(times), np.concatenate(angles), np.concatenate(torques), run=run,
                       identification=run < len(seeds))


def found(robot: Robot, data: Dataset) -> dict[str, dict]:
    return plain(identify(robot, data, friction_only=True, threads=1).json)["parameters"]


def width(entry: dict) -> float:
    return entry["ci95"][1] - entry["ci95"][0]


@pytest.fixture(scope="module")
def data() -> Dataset:
    return logs()


@pytest.fixture(scope="module")
def reference(data) -> dict[str, dict]:
    return found(six_axis(), data)


def assert_same(one: dict[str, dict], other: dict[str, dict]) -> None:
    assert set(one) == set(other) and len(one) >= 12
    for name in one:
        assert other[name]["value"] == pytest.approx(one[name]["value"], abs=SAME * width(one[name])), name
        assert width(other[name]) == pytest.approx(width(one[name]), rel=SAME), name


def runs_in_another_order(robot, data):
    order = np.concatenate([np.flatnonzero(data.run == run) for run in (2, 3, 1)])
    return robot, data.select(order)


def axis_counts_the_other_way(robot, data):
    joints = list(robot.joints)
    one = joints[AXIS]
    joints[AXIS] = replace(one, sign=-one.sign, q_offset=-one.q_offset, q_min=-one.q_max, q_max=-one.q_min)
    signs = np.where(np.arange(robot.axes) == AXIS, -1.0, 1.0)
    return (replace(robot, joints=tuple(joints)),
            replace(data, joints={name: values * signs for name, values in data.joints.items()}))


def zero_moved(robot, data):
    joints = list(robot.joints)
    one = joints[AXIS]
    joints[AXIS] = replace(one, zero=one.zero - one.sign * MOVED_RAD, q_min=one.q_min + MOVED_RAD,
                           q_max=one.q_max + MOVED_RAD)
    by = np.where(np.arange(robot.axes) == AXIS, MOVED_RAD, 0.0) * robot.ratios
    return (replace(robot, joints=tuple(joints)),
            replace(data, joints=data.joints | {"theta": data.joints["theta"] + by}))


def mirror_image(robot, data):
    return mirrored_robot(robot), replace(data, joints={name: -v for name, v in data.joints.items()})


@pytest.mark.slow
@pytest.mark.parametrize("law", [runs_in_another_order, axis_counts_the_other_way, zero_moved, mirror_image])
def test_friction_is_the_same(reference, data, law):
    assert_same(reference, found(*law(six_axis(), data)))


@pytest.mark.slow
def test_intervals_grow_with_the_noise(reference):
    large = found(six_axis(), logs(3.0))
    ratio = [width(large[name]) / width(reference[name]) for name in reference]
    np.testing.assert_allclose(ratio, 3.0, rtol=0.05)


@pytest.mark.slow
def test_runs_that_are_there_twice_narrow_the_intervals(reference, data):
    twice = np.concatenate([np.flatnonzero(data.run < 3), np.arange(len(data))])
    run = np.concatenate([data.run[data.run < 3] + 3, data.run])
    other = found(six_axis(), replace(data.select(twice), run=run))
    assert set(other) == set(reference)
    shift = [(other[name]["value"] - reference[name]["value"]) / width(reference[name]) for name in reference]
    assert np.abs(shift).max() < SAME
    ratio = [width(other[name]) / width(reference[name]) for name in reference]
    np.testing.assert_allclose(ratio, np.sqrt(0.5), rtol=0.05)
