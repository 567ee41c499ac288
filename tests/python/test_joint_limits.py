"""Joint angles that are to be driven: what lies beyond an axis' limits is said by row and axis, by every
command that reads such angles."""

import json
from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.cli import main
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.design.joint_limits import ROUNDED, beyond_limits, violations
from exactarm.robot_file import load_robot

ARM = load_robot("ur10")
HIGH = np.array([joint.q_max for joint in ARM.joints])


def poses(*rows):
    return Dataset.of_arrays(POSES.name, {"q": np.array(rows, float)})


def test_rows_and_axes_beyond_are_named_and_the_others_counted():
    beyond = HIGH + [0.0, 0.5, 0.0, 0.0, 0.0, 0.0]
    (said,) = beyond_limits(ARM, poses(0.0 * HIGH, beyond, HIGH, *[beyond] * 4), "poses asked for")
    assert said.startswith("5 of 7 poses asked for lie beyond the limits of ")
    assert f"row 2, axis 2 at {beyond[1]:.6g} rad, expected {ARM.joints[1].q_min:.6g} to" in said
    assert said.count("axis 2") == 3 and said.endswith("and 2 more")


def test_at_its_limit_an_axis_is_within_and_what_is_not_known_is_not_judged():
    assert beyond_limits(ARM, poses(HIGH, HIGH + 0.9 * ROUNDED, np.full(6, np.nan)), "rows") == ()
    assert len(list(violations(ARM, HIGH[None] + 2.0 * ROUNDED))) == 6


def test_an_axis_without_limits_turns_as_far_as_it_likes():
    free = replace(ARM, joints=tuple(replace(joint, q_min=None, q_max=None) for joint in ARM.joints))
    assert beyond_limits(free, poses(1e3 * HIGH), "rows") == ()


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Measured poses, and joint angles to drive to of which the second lies beyond."""
    folder = tmp_path_factory.mktemp("limits")
    ea.simulate("ur10", count=30, noise=1e-5).save(folder / "made")
    heads = ",".join(f"q_{i}_rad" for i in range(1, 7))
    (folder / "asked.csv").write_text(f"{heads}\n1,1,1,1,1,1\n1,1,1,1,1,7.5\n2,1,-1,1,2,1\n2,-1,1,2,1,1\n")
    return folder


@pytest.mark.parametrize("words", [
    ["evaluate", "ur10", "made/measured.csv", "--at", "asked.csv"],
    ["simulate", "ur10", "asked.csv"],
    ["identifiable", "ur10", "asked.csv"],
])
def test_commands_that_read_angles_to_drive_to_warn(files, tmp_path, words):
    words = [str(files / word) if word.endswith(".csv") else word for word in words]
    assert main([*words, "--out", str(tmp_path), "--quiet"]) == 0
    said = json.loads((tmp_path / "result.json").read_text())["warnings"]
    (found,) = [line for line in said if "beyond the limits" in line]
    assert "row 2 of asked.csv, axis 6 at 7.5 rad" in found and found.startswith("1 of 4 ")
