"""Commands identifiable and design through the command line: files, keys, refusals, and that they fit
together."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.cli import main
from exactarm.robot.robot import Placement
from exactarm.robot_file import load_robot

TARGET = "0.05,0,0.1"


def run(tmp_path, *words):
    """(exit code, result.json or None)."""
    code = main([*words, "--out", str(tmp_path), "--quiet"])
    result = tmp_path / "result.json"
    return code, json.loads(result.read_text()) if result.exists() else None


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_identifiable_writes_lists_reasons_and_collisions(tmp_path):
    code, result = run(tmp_path, "identifiable", "racer-7-1.4", "--tool", TARGET, "--count", "200")
    assert code == 0 and set(result["observability"]) == {"O1", "O2", "O3", "O4", "O5"}
    assert {"d_2_m", "ratio_6"} <= set(result["identifiable"])
    dropped = {entry["parameter"]: entry for entry in result["dropped"]}
    assert (
        "base frame" in dropped["d_1_m"]["why"]
        and dropped["d_6_m"]["collides_with"] == ["session_1.tool_z_m"]
    )
    assert result["absent"][0]["why"] == "d_3_m and d_2_m move the tool alike: axes 2 and 3 are parallel"
    assert "beta_2_rad" in result["identifiable"] and result["gaps"] == []
    vanishing = sum(value < 1e-9 for value in result["singular_values"])
    assert vanishing == len(result["dropped"])
    rows = rows_of(tmp_path / "parameters.csv")
    assert [row["parameter"] for row in rows if row["identifiable"] == "yes"] == result["identifiable"]
    assert all(bool(row["why"]) == (row["identifiable"] == "no") for row in rows)
    assert (tmp_path / "report.html").exists() and (tmp_path / "plots" / "singular_values.svg").exists()


def test_identifiable_is_deterministic_and_follows_the_seed(tmp_path):
    words = ("identifiable", "ur10", "--count", "100")
    results = [run(tmp_path / name, *words, *more)[1]
               for name, more in (("a", ()), ("b", ()), ("c", ("--seed", "9")))]
    assert results[0]["singular_values"] == results[1]["singular_values"] != results[2]["singular_values"]
    assert results[0]["identifiable"] == results[2]["identifiable"]


def test_identifiable_without_frames(tmp_path):
    _, result = run(tmp_path, "identifiable", "racer-7-1.4", "--frames", "none", "--count", "200")
    assert {"d_1_m", "d_6_m", "q_offset_1_rad"} <= set(result["identifiable"])
    assert not any(name.startswith("session") for name in result["identifiable"])


@pytest.mark.slow
def test_designed_poses_are_read_back_by_identifiable(tmp_path):
    words = ("racer-7-1.4", "--tool", "-0.05,0,0.1", "--box", "-1.2,1.2,-1,1,0.1,2")
    code, result = run(tmp_path, "design", *words, "--count", "20", "--validation", "4")
    assert code == 0 and all(result[name] > 0.0 for name in ("O1", "O2", "O3", "O4", "O5"))
    assert result["O1"] > result["start"]["O1"]
    rows = rows_of(tmp_path / "poses.csv")
    assert [row["set"] for row in rows] == ["identification"] * 20 + ["validation"] * 4
    robot = load_robot("racer-7-1.4")
    for row in rows:
        for i, joint in enumerate(robot.joints, 1):
            q, theta = float(row[f"q_{i}_rad"]), float(row[f"theta_{i}_rad"])
            assert joint.q_min < q < joint.q_max
            assert theta == pytest.approx((q - joint.q_offset) * joint.ratio, abs=1e-6)
    code, seen = run(tmp_path / "seen", "identifiable", "racer-7-1.4", str(tmp_path / "poses.csv"), "--tool",
                     "-0.05,0,0.1")
    assert code == 0 and seen["poses"] == 24 and seen["identifiable"] == result["identifiable"]


@pytest.mark.slow
def test_a_target_on_the_last_axis_is_pointed_out(tmp_path, capsys):
    for command in ("design", "identifiable"):
        main([command, "racer-7-1.4", "--count", "30", "--out", str(tmp_path / command)])
        text = " ".join(capsys.readouterr().out.split())
        hidden = "alpha_5_rad, q_offset_5_rad, q_offset_6_rad, ratio_6"
        assert f"which hides {hidden}: mount it beside that axis" in text


@pytest.mark.slow
def test_a_robot_without_gears_gets_no_motor_angles(tmp_path):
    run(tmp_path, "design", "ur10", "--count", "12", "--validation", "0")
    header = list(rows_of(tmp_path / "poses.csv")[0])
    assert header == ["set"] + [f"q_{i}_rad" for i in range(1, 7)]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("design", "racer-7-1.4", "--count", "5"), "expected at least"),
        (("design", "racer-7-1.4", "--validation", "-1"), "--validation -1: expected 0 or more"),
        (("design", "ur10", "--contact", "socket", "--apart-mm", "5000"), "--apart-mm 5000: expected"),
        (("design", "ur10", "--contact", "camera", "--near-mm", "900", "--far-mm", "300"),
         "--near-mm 900, --far-mm 300: expected 1 to 100000, the nearer one smaller"),
        (("design", "racer-7-1.4", "--box", "0,1,0,1"), "expected 6 numbers"),
        (("design", "racer-7-1.4", "--box", "1,0,0,1,0,1"), "xmin 1 is not below xmax 0"),
        (("design", "racer-7-1.4", "--tool", "a,b,c"), "expected 3 numbers"),
        (("identifiable", "racer-7-1.4", "--noise", "0"), "above 0"),
        (("identifiable", "racer-7-1.4", "--count", "0"), "expected 1 or more"),
        (("identifiable", "kr300"), "geometry"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(tmp_path, capsys, words, expected):
    code, result = run(tmp_path, *words)
    message = capsys.readouterr().err
    assert code == 2 and result is None and expected in message and len(message.strip().splitlines()) == 1


def test_a_box_out_of_reach_is_a_failed_computation(tmp_path, capsys):
    code, _ = run(tmp_path, "design", "racer-7-1.4", "--box", "5,6,5,6,5,6")
    assert code == 1 and "beyond the reach" in capsys.readouterr().err


def test_measured_poses_use_their_own_frames(tmp_path):
    rng = np.random.default_rng(3)
    path = tmp_path / "measured.csv"
    q = rng.uniform(-1.5, 1.5, (40, 6))
    robot = replace(load_robot("ur10"), base=Placement(position=np.array([2.0, 1.0, 0.5])),
                    tool=Placement(position=np.array([0.04, 0.02, 0.1])))
    position, _ = _core.forward_kinematics(robot.core, q)
    header = ",".join([f"q_{i}_rad" for i in range(1, 7)] + ["x_m", "y_m", "z_m"])
    np.savetxt(path, np.hstack([q, position]), delimiter=",", header=header, comments="")
    absorbed = {"d_1_m", "d_6_m", "a_6_m", "alpha_6_rad", "q_offset_1_rad", "q_offset_6_rad"}
    for noise, exact in (("1e-6", True), ("1e-2", False)):
        code, result = run(tmp_path / noise, "identifiable", "ur10", str(path), "--noise", noise)
        assert code == 0 and result["poses"] == 40
        dropped = {entry["parameter"]: entry for entry in result["dropped"]}
        assert {name for name, entry in dropped.items() if entry["exact"]} == absorbed
        assert (set(dropped) == absorbed) == exact
    assert "lost in the noise" in dropped["joint_compliance_2.linear_rad_per_Nm"]["why"]
