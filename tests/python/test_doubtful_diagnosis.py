"""A diagnosis that cannot decide says so, plans what would, and does not sell what held-out rows do not
confirm."""

import json
from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.chain import Layout, predict_poses
from exactarm.commands.design_for import read_experiments
from exactarm.data.dataset import Dataset
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.robot.robot import Placement


@pytest.fixture(scope="module")
def narrow():
    """A faint spring of axis 2, measured where that axis hardly turns: base and joint give way alike."""
    robot = replace(ea.load_robot("ur10"), tool=Placement(position=np.array([0.05, 0.0, 0.1])))
    rng = np.random.default_rng(2)
    q = rng.uniform(-1.2, 1.2, (120, 6))
    q[:, 1] = rng.uniform(-0.95, -0.6, 120)
    poses = Dataset.of_arrays("poses", {"q": q})
    truth = Layout.of((JointCompliance(2, (3e-6, 0.0)),), estimate=False)
    position = predict_poses(robot, truth, poses, tangents=False).position + rng.normal(0.0, 5e-5, (120, 3))
    return robot, ea.diagnose(robot, replace(poses, position=position), threads=1)


@pytest.mark.slow
def test_the_doubt_is_said_and_an_experiment_planned(narrow, tmp_path):
    robot, result = narrow
    names = {result["effects"][0]["effect"],
             *(a["effect"] for a in result["alternatives"] if a["cannot_be_told_apart"])}
    assert "joint_compliance" in names and len(names) > 1
    best = result["experiments"][0]
    assert (
        best["bits"] > 0.5 * best["open_bits"]
        and f"{best['bits']:.2f} of {best['open_bits']:.2f} bits" in result["next_experiment"]
    )
    result.save(tmp_path / "doubtful")
    planned = read_experiments(tmp_path / "doubtful" / "result.json", robot)
    assert len(planned) == len(json.loads((tmp_path / "doubtful" / "result.json").read_text())["experiments"])


@pytest.mark.slow
def test_a_cause_that_held_out_rows_do_not_confirm_is_not_recommended(narrow):
    _, result = narrow
    rises = result["after"]["validation"]["rms"] > result["before"]["validation"]["rms"]
    text = result._repr_html_() + str(result.report)
    assert rises and "keep your robot file" in text and "Use `robot.toml`" not in text
