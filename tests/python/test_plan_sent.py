"""A plan as a controller takes it: the angles that it reports while the motors follow the plan."""

import re

import numpy as np
import pandas
import pytest
import yaml

import exactarm as ea
from exactarm.errors import InputError


@pytest.mark.parametrize("send, name",
                         [("joint_trajectory", "trajectory.yaml"), ("servoj", "trajectory.script")])
def test_what_is_sent_turns_the_motors_as_planned(tmp_path, send, name):
    robot = ea.load_robot("racer-7-1.4").with_joint(1, controller_offset=0.01, controller_ratio=80.0)
    result = ea.plan(robot, "line", rate_hz=100, send=send, threads=1)
    result.save(tmp_path / "out")
    text, table = (tmp_path / "out" / name).read_text(), pandas.read_csv(tmp_path / "out/trajectory.csv")
    if send == "servoj":
        q = np.array([[float(word) for word in row.split(",")]
                      for row in re.findall(r"servoj\(\[(.*?)\]", text)])
    else:
        points = yaml.safe_load(text)["points"]
        q = np.array([point["positions"] for point in points])
        assert points[1]["time_from_start"] == {"sec": 0, "nanosec": 10_000_000}
    theta = table[[f"theta_{i + 1}_rad" for i in range(6)]].to_numpy()
    assert np.abs((q - robot.controller_offsets) * robot.controller_ratios - theta).max() < 1e-7


def test_an_unknown_controller_is_refused():
    with pytest.raises(InputError, match="joint_trajectory"):
        ea.plan("racer-7-1.4", "line", rate_hz=100, send="morse")
