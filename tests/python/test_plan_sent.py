"""A plan as a controller takes it: the angles that it reports while the motors follow the plan."""

import re
from dataclasses import replace

import numpy as np
import pandas
import pytest
import yaml

import exactarm as ea
from exactarm.errors import InputError


@pytest.mark.slow
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


@pytest.mark.slow
def test_points_for_krl_lie_on_the_plan_in_degrees(tmp_path):
    """At most 200, the last one in the plan's time; the comment is right about the spline through them."""
    from scipy.interpolate import CubicSpline

    robot = ea.load_robot("racer-7-1.4").with_joint(1, controller_offset=0.01, controller_ratio=80.0)
    ea.plan(robot, "line", rate_hz=100, send="krl", threads=1).save(tmp_path / "out")
    text = (tmp_path / "out" / "trajectory.src").read_text()
    table = pandas.read_csv(tmp_path / "out/trajectory.csv")
    theta = table[[f"theta_{i + 1}_rad" for i in range(6)]].to_numpy()
    sent = np.degrees(theta / robot.controller_ratios + robot.controller_offsets)
    points = np.array([[float(word.split()[1]) for word in row.split(",")]
                       for row in re.findall(r"S?PTP \{(.*?)\}", text)])
    assert 100 < len(points) <= 200
    away = np.abs(points[:, None] - sent[None]).max(axis=2)
    assert away.min(axis=1).max() < 1e-6
    kept = away.argmin(axis=1)
    assert kept[0] == 0 and kept[-1] == len(sent) - 1 and np.all(np.diff(kept) > 0)
    told = float(re.search(r"is off the plan by (\S+) deg", text)[1])
    off = np.abs(CubicSpline(table["time_s"][kept], sent[kept])(table["time_s"]) - sent).max()
    assert told == pytest.approx(off, rel=0.1)
    parts = [float(part) for part in re.findall(r"PART = (\S+)", text)]
    assert len(parts) == len(points) - 2 and sum(parts) < 100.0
    assert float(re.search(r"END = (\S+)", text)[1]) == pytest.approx(table["time_s"].iloc[-1])


@pytest.mark.slow
def test_a_table_holds_what_the_controller_shows_in_degrees_and_in_pulses(tmp_path):
    robot = ea.load_robot("racer-7-1.4").with_joint(1, controller_offset=0.01, controller_ratio=80.0)
    pulses = (1e5, 1e5, -2e5, 3e4, 3e4, 3e4)
    robot = replace(robot, controller=replace(robot.controller, coupling=((3, 2, 1.0),),
                                              pulses_per_rad=pulses))
    for kind in ("csv", "pulses"):
        result = ea.plan(robot, "line", rate_hz=100, send=kind, threads=1)
        result.save(tmp_path / kind)
    assert "They stand in sent_pulses.csv" in result.summary()
    theta = pandas.read_csv(tmp_path / "csv/trajectory.csv")
    q = (theta[[f"theta_{i + 1}_rad" for i in range(6)]] / robot.controller_ratios
         + robot.controller_offsets).to_numpy()
    q[:, 2] -= q[:, 1]  # J3 is counted from the horizon
    sent = pandas.read_csv(tmp_path / "csv/sent.csv")
    assert sent.columns.tolist() == ["time_s", *(f"q_{i + 1}_deg" for i in range(6))]
    np.testing.assert_allclose(sent["time_s"], theta["time_s"], atol=1e-12)
    np.testing.assert_allclose(np.radians(sent.to_numpy()[:, 1:]), q, atol=1e-10)
    counts = pandas.read_csv(tmp_path / "pulses/sent_pulses.csv").to_numpy()[:, 1:]
    np.testing.assert_array_equal(counts, np.round(q * pulses))
    with pytest.raises(InputError, match="pulses_per_rad"):
        ea.plan("racer-7-1.4", "line", rate_hz=100, send="pulses", threads=1)
