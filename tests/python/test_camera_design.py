"""Designed pictures of a board: what is seen in them, what they tell beside random ones, words and files."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.cli import main
from exactarm.data.dataset import read_planned_poses
from exactarm.data.fixture import CameraSetup
from exactarm.design.camera_design import CORNER_PX, REPEATS_M, REPEATS_RAD, _block, design_pictures
from exactarm.design.closure_design import ClosureDesignOptions
from exactarm.design.pose_space import PoseSpace
from exactarm.errors import InputError
from exactarm.measurement.board_views import LEAST_SEEN, Views, corners_seen
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot

SETUP = CameraSetup(size=(1600, 1200), lens=(1400.0, 1400.0, 800.0, 600.0, 0.0, 0.0, 0.0, 0.0, 0.0))
UR10 = replace(load_robot("ur10"), tool=Placement(np.eye(3), np.array([0.05, 0.0, 0.06])))
FIXTURE = """[board]
squares = [9, 7]
square_mm = 25.0
[camera]
size_px = [1600, 1200]
focal_px = [1400.0, 1400.0]
on = "{on}"
"""


def test_the_information_of_a_picture_knows_that_the_arm_does_not_repeat():
    """J'C^{-1}J as written, with C as a matrix."""
    random = np.random.default_rng(4)
    motion, numbers, sigma = random.normal(size=(40, 6)), 12, CORNER_PX / 1400.0
    jacobian = motion @ random.normal(size=(6, numbers))  # what the arm and the frames do to it
    repeats = np.diag([REPEATS_M, REPEATS_M, REPEATS_RAD, REPEATS_M, REPEATS_RAD, REPEATS_RAD]) ** 2
    inverse = np.linalg.inv(sigma**2 * np.eye(40) + motion @ repeats @ motion.T)
    block = _block(jacobian, motion, sigma)
    np.testing.assert_allclose(block.T @ block, jacobian.T @ inverse @ jacobian, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("on_flange", [True, False])
def test_every_designed_pose_sees_the_board_within_the_limits(on_flange):
    setup, views = replace(SETUP, on_flange=on_flange), Views(0.4, 0.6, 0.5)
    options = ClosureDesignOptions(places=2, count=24)
    design = design_pictures(UR10, setup, options, views)
    assert len(design.q) == 24 and set(design.session) == {1, 2}
    assert PoseSpace.of(UR10).allowed(design.q).all()
    middle = 0.5 * setup.square * np.array([9.0, 7.0, 0.0])
    for number, camera in enumerate(design.cameras, 1):
        q = design.q[design.session == number]
        rows, inside = corners_seen(UR10, Layout.of(()), camera, q, np.zeros_like(q))
        assert np.bincount(rows.picture, inside).min() > LEAST_SEEN * setup.corners
        (mount, m), (world, w) = camera.frames()
        for pose in q:
            target = UR10.fk(pose, of="target")
            turn, place = target.rotation, target.position
            if on_flange:
                shown = (turn @ mount).T @ world
                seen = (turn @ mount).T @ (w + world @ middle - place - turn @ m)
            else:
                shown = world.T @ turn @ mount
                seen = world.T @ (place + turn @ (m + mount @ middle) - w)
            assert 0.4 - 1e-6 <= seen[2] <= 0.6 + 1e-6 and np.arccos(shown[2, 2]) <= 0.5 + 1e-6
    assert design.deviation[2] < 0.95 * design.deviation[1] < 0.5 * design.deviation[0]


@pytest.mark.slow
def test_the_command_proposes_places_and_poses(tmp_path):
    (tmp_path / "fixture.toml").write_text(FIXTURE.format(on="flange"))
    words = ["design", "ur10", "--contact", "camera", "--fixture", str(tmp_path / "fixture.toml"), "--at",
             "0.7,0,0", "--count", "15", "--tool", "0,0,0.06", "--box", "-2,2,-2,2,-1,2", "--quiet"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    made = json.loads((tmp_path / "out" / "result.json").read_text())
    assert made["deviation_m"]["design"] < made["deviation_m"]["random_poses"]
    page = re.sub("<[^>]+>", "", (tmp_path / "out" / "report.html").read_text())
    assert f"TOUCHED.csv --fixture {tmp_path / 'fixture.toml'} --out DIR" in page
    place = made["places"][0]["board"]
    middle = np.array(place["position_m"]) + np.array(place["rotation"]) @ [0.1125, 0.0875, 0.0]
    np.testing.assert_allclose(middle, [0.7, 0.0, 0.0], atol=1e-9)
    assert read_planned_poses(tmp_path / "out" / "poses.csv", load_robot("ur10")).joints["q"].shape == (15, 6)


@pytest.mark.parametrize(("more", "words"), [
    ([], "no board; expected --fixture"),
    (["--near-mm", "800"], "expected 1 to 100000, the nearer one smaller"),
    (["--tilt-deg", "95"], "expected degrees above 0, 80 at most"),
])
def test_what_no_picture_can_be_designed_with_is_refused(tmp_path, capsys, more, words):
    (tmp_path / "fixture.toml").write_text(FIXTURE.format(on="flange"))
    given = ["--fixture", str(tmp_path / "fixture.toml"), *more] if more else []
    assert main(["design", "ur10", "--contact", "camera", *given, "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.slow
def test_a_camera_without_size_or_focal_length_and_a_place_out_of_sight_are_refused():
    with pytest.raises(InputError, match="size_px or focal_px missing"):
        design_pictures(UR10, replace(SETUP, size=None), ClosureDesignOptions())
    with pytest.raises(InputError, match="--at, place 1: fewer than 12 poses"):
        design_pictures(UR10, SETUP, ClosureDesignOptions(places=1, count=5, at=((4.0, 0.0, 0.0),)))
