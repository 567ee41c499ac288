"""Orientations by three turns: read as what they are, and told where they pass for something else."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from exactarm import cli
from exactarm.data.dataset import read_dataset, write_dataset
from exactarm.errors import InputError
from exactarm.first_aid.first_aid import first_aid
from exactarm.robot.writer import write_robot
from set_ups import at_random_place, joints_in_limits, measured, true_robot
from six_axis import six_axis

COUNT = 50


@pytest.fixture(scope="module")
def poses():
    """An arm off by millimetres, as they come; (COUNT, 3, 3) orientations as a device tells them."""
    rng, nominal = np.random.default_rng(5), six_axis(placed=False)
    true = at_random_place(true_robot(nominal, rng, 3.0), rng)
    data = measured(nominal, [true], [joints_in_limits(nominal, COUNT, rng)], 1e-4, rng, noise_rad=2e-4)
    return nominal, data


def table(data, names, turns):
    angles = {f"theta_{i + 1}_rad": column for i, column in enumerate(data.joints["theta"].T)}
    places = {f"{axis}_m": column for axis, column in zip("xyz", data.position.T)}
    return pd.DataFrame(angles | places | dict(zip(names, turns.T)))


def read(poses, tmp_path, names, axes, degrees=False):
    robot, data = poses
    turns = Rotation.from_matrix(data.rotation).as_euler(axes, degrees=degrees)
    table(data, names, turns).to_csv(tmp_path / "poses.csv", index=False)
    return read_dataset(tmp_path / "poses.csv", robot)


@pytest.mark.parametrize(("unit", "axes", "order"), [
    ("rad", "xyz", ("roll", "pitch", "yaw")), ("deg", "xyz", ("roll", "pitch", "yaw")),
    ("deg", "ZYX", ("yaw", "pitch", "roll")),
])
def test_roll_pitch_and_yaw_are_an_orientation(poses, tmp_path, unit, axes, order):
    found = read(poses, tmp_path, [f"{name}_{unit}" for name in order], axes, unit == "deg")
    np.testing.assert_allclose(found.rotation, poses[1].rotation, atol=1e-9)
    assert not found.covariates and first_aid(poses[0], found) == ()


def test_an_inclinometers_roll_and_pitch_stay_what_they_were(poses, tmp_path):
    robot, data = poses
    table(data, ["roll_deg", "pitch_deg"], np.zeros((COUNT, 2))).to_csv(tmp_path / "poses.csv", index=False)
    found = read_dataset(tmp_path / "poses.csv", robot)
    assert found.rotation is None and set(found.covariates) == {"roll_deg", "pitch_deg"}


@pytest.mark.parametrize("second", ["rx_rad,ry_rad,rz_rad", "qw,qx,qy,qz", "yaw_deg"])
def test_an_orientation_is_told_once(poses, tmp_path, second):
    robot, data = poses
    names = ["roll_rad", "pitch_rad", "yaw_rad", *second.split(",")]
    turns = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (COUNT, 1))
    table(data, names, turns).to_csv(tmp_path / "poses.csv", index=False)
    with pytest.raises(InputError, match="an orientation beside roll_rad, pitch_rad, yaw_rad; expected it"):
        read_dataset(tmp_path / "poses.csv", robot)


@pytest.mark.parametrize(("axes", "words"), [
    ("xyz", "rx, ry, rz as roll, pitch and yaw"), ("ZYX", "rx, ry, rz as yaw, pitch and roll"),
    ("XYZ", "rx, ry, rz as turns about moving x, y and z"),
    ("ZYZ", "rx, ry, rz as turns about moving z, y and z"),
])
def test_turns_that_pass_for_a_rotation_vector_are_told(poses, tmp_path, axes, words):
    (line, *_) = first_aid(poses[0], read(poses, tmp_path, ["rx_rad", "ry_rad", "rz_rad"], axes))
    assert f"with {words}" in line


def test_files_with_turns_and_with_a_quaternion_go_together(poses, tmp_path):
    robot, data = poses
    read(poses, tmp_path, ["roll_rad", "pitch_rad", "yaw_rad"], "xyz")
    write_dataset(tmp_path / "more.csv", data.select(np.arange(COUNT) < 20), robot)
    both = read_dataset([tmp_path / "poses.csv", tmp_path / "more.csv"], robot)
    np.testing.assert_allclose(both.rotation[-COUNT:], data.rotation, atol=1e-9)
    assert len(both) == COUNT + 20 and both.turns is None


@pytest.mark.parametrize(("names", "words"), [
    ("yaw pitch roll", "with roll and yaw exchanged"), ("pitch roll yaw", "with roll and pitch exchanged"),
    ("rz ry rx", "with rx and rz exchanged")])
def test_a_mistake_is_told_by_the_columns_of_the_file(poses, tmp_path, names, words):
    """It named qx and qz, which such a file has not."""
    axes = [f"{name}_rad" for name in names.split()]
    robot, data = poses
    turns = Rotation.from_matrix(data.rotation)
    numbers = turns.as_euler("xyz") if "yaw" in names else turns.as_rotvec()
    table(data, axes, numbers).to_csv(tmp_path / "poses.csv", index=False)
    (line, *_) = first_aid(robot, read_dataset(tmp_path / "poses.csv", robot))
    assert words in line and "q_" not in line and "qx" not in line and "quaternion" not in line


@pytest.mark.parametrize(("change", "words"), [
    (lambda turns: turns * [1.0, 1.0, -1.0], "the opposite sign of yaw"),
    (np.degrees, "roll, pitch, yaw in degrees labelled as radians"),
    (np.radians, "roll, pitch, yaw in radians labelled as degrees")])
def test_mistakes_of_three_turns_are_found(poses, tmp_path, change, words):
    robot, data = poses
    turns = Rotation.from_matrix(data.rotation).as_euler("xyz")
    names = ["roll_rad", "pitch_rad", "yaw_rad"]
    table(data, names, change(turns)).to_csv(tmp_path / "poses.csv", index=False)
    assert words in first_aid(robot, read_dataset(tmp_path / "poses.csv", robot))[0]


def test_a_rotation_vector_is_left_alone(poses, tmp_path):
    robot, data = poses
    vectors = Rotation.from_matrix(data.rotation).as_rotvec()
    table(data, ["rx_rad", "ry_rad", "rz_rad"], vectors).to_csv(tmp_path / "poses.csv", index=False)
    assert first_aid(robot, read_dataset(tmp_path / "poses.csv", robot)) == ()


def test_orientations_that_follow_nothing_are_told_of_an_arm_that_is_off_by_centimetres(poses):
    robot, data = poses
    far = replace(robot, joints=(robot.joints[0], replace(robot.joints[1], a=robot.joints[1].a + 0.03),
                                 *robot.joints[2:]))
    shuffled = replace(data, rotation=np.random.default_rng(1).permutation(data.rotation))
    assert any("orientations do not follow" in line for line in first_aid(far, shuffled))
    assert not any("orientations" in line for line in first_aid(far, data))


def test_a_calibration_says_by_how_much_orientations_are_missed(poses, tmp_path, capsys):
    robot, data = poses
    write_robot(tmp_path / "arm.toml", robot)
    write_dataset(tmp_path / "poses.csv", data, robot)
    assert cli.main(["calibrate", str(tmp_path / "arm.toml"), str(tmp_path / "poses.csv"),
                     "--compliance", "none", "--out", str(tmp_path / "out")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    missed = float(re.search(r"orientations of the fitted rows are missed by ([0-9.]+) mrad", told)[1])
    assert missed == pytest.approx(1e3 * np.sqrt(3.0) * 2e-4, rel=0.2)
