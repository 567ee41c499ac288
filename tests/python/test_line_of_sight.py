"""What a tracker sees: against brute force, and in the poses that a design takes."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from exactarm import _core
from exactarm.cli import main
from exactarm.commands.planning_arguments import station_of
from exactarm.design.line_of_sight import Station, segment_distance
from exactarm.design.pose_space import PoseSpace
from exactarm.errors import InputError
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot

STATION = np.array([3.0, 0.5, 1.0])


@pytest.fixture(scope="module")
def robot():
    return replace(load_robot("ur10"), tool=Placement(position=np.array([0.05, 0.0, 0.1])))


def test_distance_of_segments_is_the_least_between_their_points():
    rng = np.random.default_rng(0)
    a, b, c, d = rng.normal(size=(4, 60, 3))
    b[:5] = a[:5] + 2.0 * (d[:5] - c[:5])  # parallel
    d[5:8] = c[5:8]  # a point
    share = np.linspace(0.0, 1.0, 401)[:, None, None]
    one, other = a + share * (b - a), c + share * (d - c)
    brute = np.array([np.min(np.linalg.norm(one[:, None, k] - other[None, :, k], axis=2)) for k in range(60)])
    found = segment_distance(a, b, c, d)
    assert np.all(found <= brute + 1e-12) and np.allclose(found, brute, atol=0.02)


def test_the_arm_does_not_stand_in_the_beam(robot):
    space = PoseSpace.of(robot, station=Station(STATION))
    q = space.draw(200, np.random.default_rng(1))
    seen, everywhere = space.target(q), PoseSpace.of(robot)
    origins, _ = _core.frame_poses(robot.core, q + robot.offsets)
    for k in range(2):
        gap = segment_distance(seen, np.broadcast_to(STATION, seen.shape), origins[:, k], origins[:, k + 1])
        assert gap.min() >= space.clearance - 1e-9
    hidden = everywhere.draw(400, np.random.default_rng(2))
    assert 0.02 < np.mean(~space.allowed(hidden)) < 0.9  # a part of the work space lies behind the column


def test_the_reflector_opens_towards_the_station(robot):
    station = Station(STATION, np.array([1.0, 0.0, 0.0]), np.radians(40.0))
    space = PoseSpace.of(robot, station=station)
    q = space.draw(100, np.random.default_rng(3))
    target, rotation = _core.forward_kinematics(space.robot.core, q + robot.offsets)
    back = STATION - target
    back /= np.linalg.norm(back, axis=1)[:, None]
    flange_x = rotation @ robot.tool.rotation.T @ np.array([1.0, 0.0, 0.0])
    assert np.sum(flange_x * back, axis=1).min() >= np.cos(np.radians(40.0)) - 1e-9


@pytest.mark.slow
def test_a_design_keeps_the_line_of_sight_and_writes_what_drives_there(tmp_path):
    words = ["design", "ur10", "--count", "40", "--validation", "5", "--tool", "0.05,0,0.1", "--station",
             "3,0.5,1",
             "--both-ways", "--program", "urscript", "--out", str(tmp_path), "--quiet", "--threads", "1"]
    assert main(words) == 0
    poses = pd.read_csv(tmp_path / "poses.csv")
    assert len(poses) == 90 and list(poses["approach_3"][:4]) == [-1, 1, -1, 1]
    assert (tmp_path / "measure.script").read_text().count("sleep") == 90
    robot = replace(load_robot("ur10"), tool=Placement(position=np.array([0.05, 0.0, 0.1])))
    q = poses[[f"q_{i}_rad" for i in range(1, 7)]].to_numpy()
    assert PoseSpace.of(robot, station=Station(STATION)).allowed(q).all()


@pytest.mark.parametrize("words", [(None, "1,0,0", 30.0), ("1,2", None, 30.0), ("3,0,1", "0,0,0", 30.0),
                                   ("3,0,1", "1,0,0", 0.0)])
def test_what_is_no_station_is_refused(words):
    with pytest.raises(InputError, match="--"):
        station_of(*words)
