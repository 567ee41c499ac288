"""A payload found in poses is reported with mass and centre of mass, each with its interval."""

import json

import numpy as np
import pytest

from exactarm import cli
from exactarm.chain import Layout
from exactarm.data.dataset import write_dataset
from exactarm.effects.payload import Payload
from exactarm.robot.writer import write_robot
from set_ups import joints_in_limits, measured, true_robot
from six_axis import six_axis


@pytest.mark.slow
def test_centre_of_mass_is_reported(tmp_path):
    rng = np.random.default_rng(31)
    robot = six_axis(springs=True, placed=False)
    hidden = Payload(None, (8.0, 0.4, -0.8, 1.2))
    data = measured(robot, [true_robot(robot, rng, 0.5)], [joints_in_limits(robot, 160, rng)], 3e-5, rng,
                    layout=Layout.of((hidden,), estimate=False), identification=np.arange(160) < 120)
    write_dataset(tmp_path / "poses.csv", data, robot)
    write_robot(tmp_path / "robot.toml", robot)
    code = cli.main(["diagnose", str(tmp_path / "robot.toml"), str(tmp_path / "poses.csv"), "--out",
                     str(tmp_path / "out"), "--quiet"])
    assert code == 0
    effect = json.loads((tmp_path / "out" / "result.json").read_text())["effects"][0]
    assert effect["effect"] == "payload"
    for name, truth in (("mass_kg", 8.0), ("com_x_m", 0.05), ("com_y_m", -0.1), ("com_z_m", 0.15)):
        low, high = effect["parameters"][name]["ci95"]
        half = 0.5 * (high - low)
        assert abs(effect["parameters"][name]["value"] - truth) < 2.0 * half, name
