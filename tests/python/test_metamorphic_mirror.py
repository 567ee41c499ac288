"""A robot and its mirror image, and noise of another size: the answer is the mirror image, and intervals grow
with the noise. For poses and for gears; files in another order and two threads give a gear the same bits."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.commands.calibrate import calibrate
from exactarm.commands.gear import gear
from exactarm.commands.plain import plain
from exactarm.data.dataset import Dataset, read_dataset
from exactarm.files.examples import data_path, example
from exactarm.robot.robot import Robot
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, measure_gear_runs, measure_poses
from exactarm.simulate.profiles import limit

MIRROR = np.array([1.0, -1.0, 1.0])  # at the plane of x and z, in the base and in every frame of a link
TURNED = ("alpha_", "q_offset_")  # parameters that change their sign in the mirror


def mirrored_robot(robot: Robot) -> Robot:
    """M Rot_z(q) M = Rot_z(-q), M Rot_x(alpha) M = Rot_x(-alpha); lengths and Rot_y(beta) stay."""
    turned = lambda low, high: (None if high is None else -high, None if low is None else -low)
    joints = []
    for joint in robot.joints:
        low, high = turned(joint.q_min, joint.q_max)
        offset = None if joint.controller_offset is None else -joint.controller_offset
        joints.append(replace(joint, alpha=-joint.alpha, zero=-joint.zero, q_offset=-joint.q_offset,
                              controller_offset=offset, q_min=low, q_max=high))
    links = robot.links and tuple(
        replace(link, centre_of_mass=link.centre_of_mass * MIRROR,
                inertia=link.inertia * np.outer(MIRROR, MIRROR))
        for link in robot.links
    )
    tool = replace(robot.tool, position=robot.tool.position * MIRROR)
    return replace(robot, joints=tuple(joints), links=links, tool=tool)


def mirrored(data: Dataset) -> Dataset:
    """Angles turn round, positions are reflected; a rate of turn is an axial vector."""
    changes = {"joints": {name: -values for name, values in data.joints.items()}}
    if data.position is not None:
        changes["position"] = data.position * MIRROR
    if data.rotation is not None:
        changes["rotation"] = data.rotation * np.outer(MIRROR, MIRROR)
    if data.gyro is not None:
        changes["gyro"] = -data.gyro * MIRROR
    return replace(data, **changes)


def estimates(result) -> dict[str, dict]:
    return {name: entry for name, entry in plain(result.json["parameters"]).items()
            if not name.startswith("session")}


def width(entry: dict) -> float:
    return entry["ci95"][1] - entry["ci95"][0]


def poses(noise_m: float) -> Dataset:
    robot, random = load_robot("ur10"), np.random.default_rng(3)
    q = random.uniform(0.4 * limit(robot, "q_min"), 0.4 * limit(robot, "q_max"), (60, 6))
    data = measure_poses(VirtualRobot.of(robot), q, Sensors(position_m=noise_m, counts=0), random)
    return replace(data, identification=np.arange(60) % 3 > 0)


def runs(noise_rad_s: float) -> Dataset:
    robot, random = load_robot("racer-7-1.4"), np.random.default_rng(5)
    data = measure_gear_runs(VirtualRobot.of(robot), [0], [0.6], 2, Sensors(gyro_rad_s=noise_rad_s, counts=0),
                             random, 250.0)
    return replace(data, identification=data.run <= 2)


@pytest.mark.slow
def test_the_mirror_image_of_an_arm_has_the_mirror_image_of_its_errors():
    robot = load_robot("ur10")
    data = read_dataset(data_path("ur10/series_B.csv"), robot)
    data = data.select(np.arange(0, len(data), 12))
    data = replace(data, identification=np.arange(len(data)) % 3 > 0)
    one = calibrate(robot, data, threads=1)
    other = calibrate(mirrored_robot(robot), mirrored(data), threads=1)
    names = [name for name in estimates(one) if not name.startswith("tool")]
    assert set(estimates(one)) == set(estimates(other)) and len(names) > 15
    for name in names:
        here, there = estimates(one)[name], estimates(other)[name]
        sign = -1.0 if name.startswith(TURNED) else 1.0
        assert there["value"] == pytest.approx(sign * here["value"], abs=1e-3 * width(here)), name
    after = [plain(each.json)["after"]["validation"]["rms"] for each in (one, other)]
    assert after[1] == pytest.approx(after[0], rel=1e-6)


@pytest.mark.slow
def test_intervals_of_a_calibration_grow_with_the_noise():
    robot = load_robot("ur10")
    one, other = (estimates(calibrate(robot, poses(noise), threads=1)) for noise in (2e-5, 6e-5))
    assert set(one) == set(other)
    inside = [name for name in one if width(one[name]) > 0.0]  # at its bound a parameter has no interval yet
    assert len(inside) >= len(one) - 1 > 15
    np.testing.assert_allclose([width(other[name]) / width(one[name]) for name in inside], 3.0, rtol=0.05)


@pytest.mark.slow
def test_the_mirror_image_of_a_gear_turns_the_other_way():
    robot, data = load_robot("racer-7-1.4"), runs(1e-3)
    one = plain(gear(robot, data, threads=1).json)["gears"]
    other = plain(gear(mirrored_robot(robot), mirrored(data), threads=1).json)["gears"]
    there = {entry["direction"]: entry for entry in other}
    assert len(one) == 2
    for here in one:
        image = there["ccw" if here["direction"] == "cw" else "cw"]
        assert image["ratio"]["value"] == pytest.approx(here["ratio"]["value"],
                                                        abs=1e-3 * width(here["ratio"]))
        assert len(image["harmonics"]) == len(here["harmonics"]) > 0
        for a, b in zip(here["harmonics"], image["harmonics"]):
            assert b["a"]["value"] == pytest.approx(a["a"]["value"], abs=1e-2 * width(a["a"]))
            assert b["b"]["value"] == pytest.approx(-a["b"]["value"], abs=1e-2 * width(a["b"]))


@pytest.mark.slow
def test_intervals_of_a_gear_grow_with_the_noise():
    robot = load_robot("racer-7-1.4")
    one, other = (plain(gear(robot, runs(noise), threads=1).json)["gears"] for noise in (3e-4, 9e-4))
    for small, large in zip(one, other):
        assert width(large["ratio"]) == pytest.approx(3.0 * width(small["ratio"]), rel=0.1)


def test_threads_mean_nothing_to_a_gear():
    robot = load_robot("kr300")
    files = [example("kr300/run_A"), example("kr300/run_B")]
    data = read_dataset(files, robot, "gear_run").select(np.arange(0, 5002, 4))
    assert gear(robot, data, threads=1) == gear(robot, data, threads=2)
