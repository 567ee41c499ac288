"""What is done to the data and must come back in the answer: rows and files in another order, other units,
moved frames, doubled data, a shifted clock, another number of threads."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from exactarm.commands.calibrate import calibrate
from exactarm.commands.diagnose import diagnose
from exactarm.commands.evaluate import evaluate
from exactarm.commands.identify import identify
from exactarm.commands.plain import plain
from exactarm.data.dataset import read_dataset, read_planned_poses, write_dataset
from exactarm.files.examples import data_path
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_poses
from exactarm.simulate.profiles import limit

SAME = 1e-6  # relative: what another order of sums and another start of the search may change


@pytest.fixture(scope="module")
def poses():
    robot = load_robot("ur10")
    data = read_dataset(data_path("ur10/series_B.csv"), robot)
    data = data.select(np.arange(0, len(data), 12))
    return robot, replace(data, identification=np.arange(len(data)) % 3 > 0)


@pytest.fixture(scope="module")
def motion():
    robot = load_robot("tx40")
    data = read_dataset(data_path("tx40/motion.parquet"), robot)
    return robot, data.select(np.arange(0, len(data), 10))


def geometry(result) -> np.ndarray:
    """Estimates of the arm, not of the set-up."""
    return np.array([entry["value"] for name, entry in plain(result.json["parameters"]).items()
                     if not name.startswith("session")])


def rms(result, when="after") -> float:
    return plain(result.json)[when]["validation"]["rms"]


@pytest.fixture(scope="module")
def calibrated(poses):
    return calibrate(*poses, compliance=(), threads=1)


@pytest.mark.slow
def test_poses_in_another_order_give_the_same_arm(poses, calibrated):
    robot, data = poses
    shuffled = data.select(np.random.default_rng(1).permutation(len(data)))
    one, other = calibrated, calibrate(robot, shuffled, compliance=(), threads=1)
    assert (
        geometry(other) == pytest.approx(geometry(one), rel=SAME, abs=1e-9)
        and rms(other) == pytest.approx(rms(one), rel=SAME)
    )


def test_a_moved_tracker_gives_the_same_arm(poses, calibrated):
    robot, data = poses
    turn = Rotation.random(random_state=3).as_matrix()
    moved = replace(data, position=data.position @ turn.T + [3.0, -1.0, 0.5], rotation=turn @ data.rotation)
    one, other = calibrated, calibrate(robot, moved, compliance=(), threads=1)
    assert (
        geometry(other) == pytest.approx(geometry(one), rel=1e-4, abs=1e-7)
        and rms(other) == pytest.approx(rms(one), rel=1e-4)
    )


@pytest.mark.slow
def test_doubled_poses_give_the_same_arm_and_the_same_intervals(poses):
    """A copy tells nothing new. (Intervals narrower by the root of two were asked for here until readings of
    one pose counted for what they do not share.)"""
    robot, data = poses
    twice = data.select(np.repeat(np.arange(len(data)), 2))
    one, other = (calibrate(robot, each, compliance=(), use="position", threads=1) for each in (data, twice))
    width = lambda result: np.array([np.ptp(entry["ci95"])
                                     for entry in plain(result.json["parameters"]).values()])
    assert plain(other.json["parameters"]).keys() == plain(one.json["parameters"]).keys()
    robots = np.array([not name.startswith("session") for name in plain(one.json["parameters"])])
    moved = np.abs(geometry(other) - geometry(one)) / (0.5 * width(one)[robots])
    assert moved.max() < 0.05
    assert width(other) / width(one) == pytest.approx(1.0, rel=0.05)
    assert rms(other) == pytest.approx(rms(one), rel=0.05)


def test_units_of_a_file_mean_nothing(poses, tmp_path):
    robot, data = poses
    write_dataset(tmp_path / "si.csv", data, robot)
    table = pd.read_csv(tmp_path / "si.csv")
    other = {}
    for name, values in table.items():
        if name.endswith("_rad"):
            other[name.removesuffix("_rad") + "_deg"] = np.degrees(values)
        elif name.endswith("_m"):
            other[name.removesuffix("_m") + "_mm"] = 1e3 * values
        else:
            other[name] = values
    pd.DataFrame(other).to_csv(tmp_path / "shop.csv", index=False)
    one, two = (evaluate(robot, tmp_path / name, threads=1) for name in ("si.csv", "shop.csv"))
    assert two["error"]["rms"] == pytest.approx(one["error"]["rms"], rel=1e-9)


@pytest.fixture(scope="module")
def two_files(tmp_path_factory):
    """Few rows of each of two series, with names whose numbers have one and two digits."""
    folder, robot, names = tmp_path_factory.mktemp("two"), load_robot("ur10"), ("day2.csv", "day10.csv")
    for name, series in zip(names, ("ur10/series_B.csv", "ur10/series_C.parquet")):
        data = read_dataset(data_path(series), robot)
        write_dataset(folder / name, data.select(np.arange(0, len(data), 36)), robot)
    return [folder / name for name in names]


@pytest.mark.slow
@pytest.mark.parametrize("command", [evaluate, calibrate, diagnose])
def test_the_order_of_files_means_nothing(two_files, command):
    one, other = (command("ur10", order, threads=1) for order in (two_files, two_files[::-1]))
    assert one.json == other.json and one.robot == other.robot
    for name, table in one.tables.items():
        assert pd.DataFrame(table).equals(pd.DataFrame(other.tables[name]))


@pytest.mark.parametrize("read", [read_dataset, read_planned_poses])
def test_files_are_read_in_the_order_of_their_numbers(two_files, read):
    """Planned poses were read in the order given: `identifiable` had other last digits."""
    data = read(two_files[::-1], load_robot("ur10"))
    assert [source.path for source in data.sources] == [str(path) for path in two_files]


@pytest.mark.slow
def test_two_threads_give_the_same_bits(poses, motion):
    robot, data = poses
    assert calibrate(robot, data, threads=1) == calibrate(robot, data, threads=2)
    assert evaluate(robot, data, threads=1) == evaluate(robot, data, threads=2)
    arm, rows = motion
    assert identify(arm, rows, friction_only=True,
                    threads=1) == identify(arm, rows, friction_only=True, threads=2)


@pytest.mark.slow
def test_a_shifted_clock_gives_the_same_dynamics(motion):
    robot, data = motion
    one, other = (identify(robot, each, threads=1) for each in (data, replace(data, time=data.time + 100.0)))
    # The iteration of the weights ends at a tolerance, and the resampled rows may begin a sample later: both
    # move an estimate by a hundredth of its own uncertainty (measured: 0.013 of the half width, the RMS by
    # 7e-4).
    half = np.array([0.5 * np.ptp(entry["ci95"]) for entry in plain(one.json["parameters"]).values()])
    assert (
        np.all(np.abs(geometry(other) - geometry(one)) < 0.05 * half)
        and rms(other) == pytest.approx(rms(one), rel=2e-3)
    )


@pytest.mark.slow
def test_scaled_torques_give_scaled_parameters(motion):
    robot, data = motion
    twice = replace(data, joints=data.joints | {"tau_motor": 2.0 * data.joints["tau_motor"]})
    one, other = (identify(robot, each, threads=1) for each in (data, twice))
    assert plain(one.json["parameters"]).keys() == plain(other.json["parameters"]).keys()
    assert rms(other) == pytest.approx(2.0 * rms(one), rel=1e-3)


@pytest.mark.slow
def test_a_moved_tracker_gives_the_same_diagnosis():
    robot = load_robot("ur10")
    random = np.random.default_rng(8)
    q = random.uniform(0.4 * limit(robot, "q_min"), 0.4 * limit(robot, "q_max"), (40, 6))
    data = measure_poses(VirtualRobot.of(robot), q, Sensors(position_m=2e-5), random)
    scaled = replace(data, position=data.position * 1.0)
    turn = Rotation.random(random_state=9).as_matrix()
    moved = replace(data, position=data.position @ turn.T + 1.0)
    one, other = (diagnose(robot, each, threads=1) for each in (scaled, moved))
    assert (one["verdict"], len(one["effects"])) == (other["verdict"], len(other["effects"]))
    assert rms(other) == pytest.approx(rms(one), rel=1e-3)
