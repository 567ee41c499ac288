"""Evaluate: the robot as its file says; only what belongs to the set-up is fitted."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm import cli
from exactarm.chain import Layout
from exactarm.commands.evaluate import FITTED
from exactarm.data.dataset import Dataset, write_dataset
from exactarm.effects.gear_harmonics import GearHarmonics
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.errors import InputError
from exactarm.identify.evaluate import evaluate_poses
from exactarm.robot.robot import Placement
from exactarm.robot.writer import write_robot
from exactarm.robot_file import load_robot
from set_ups import at_random_place, joints_in_limits, measured, true_robot
from six_axis import six_axis

NOISE_M = 1e-4


@pytest.fixture(scope="module")
def arm():
    return six_axis(springs=True, placed=False)


@pytest.fixture
def rng():
    return np.random.default_rng(90)


def test_true_robot_leaves_the_noise_less_what_the_frames_take(arm, rng):
    """Mean square of 3 sigma^2 (1 - 9 / 3N) over N = 200 rows, within four standard errors."""
    data = measured(arm, [at_random_place(arm, rng)], [joints_in_limits(arm, 200, rng)], NOISE_M, rng)
    result = evaluate_poses(arm, data)
    expected = 3.0 * NOISE_M**2 * (1.0 - 9.0 / 600.0)
    assert result.overall.rms**2 == pytest.approx(expected, rel=4.0 * np.sqrt(2.0 / 591.0))
    assert result.unit == "m" and result.overall.n == 200


def test_wrong_parameter_is_not_fitted_away(arm, rng):
    """A link 2 mm too long stays an error; base and tool absorb a part, never most of it."""
    longer = arm.with_joint(1, a=arm.joints[1].a + 2e-3)
    q = joints_in_limits(arm, 100, rng)
    data = measured(arm, [at_random_place(longer, rng)], [q], 0.0, rng)
    assert 0.4e-3 < evaluate_poses(arm, data).overall.rms < 2e-3
    assert evaluate_poses(longer, replace(data)).overall.rms < 1e-9


def test_each_session_has_its_own_frames(arm, rng):
    places = [at_random_place(arm, rng) for _ in range(3)]
    q = [joints_in_limits(arm, count, rng) for count in (20, 30, 40)]
    data = measured(arm, places, q, 0.0, rng)
    result = evaluate_poses(arm, data)
    assert [session for session, _ in result.sessions] == [1, 2, 3]
    assert [summary.n for _, summary in result.sessions] == [20, 30, 40]
    assert result.overall.max < 1e-9
    one_frame = evaluate_poses(arm, data.select(data.session == 2))
    assert one_frame.overall.rms == pytest.approx(result.sessions[1][1].rms, abs=1e-10)


def test_all_rows_are_judged_whatever_their_set(arm, rng):
    data = measured(arm, [true_robot(arm, rng)], [joints_in_limits(arm, 40, rng)], NOISE_M, rng)
    marked = replace(data, identification=np.arange(40) < 10)
    assert evaluate_poses(arm, marked).overall == evaluate_poses(arm, data).overall
    assert evaluate_poses(arm, data).overall.n == 40


def test_effects_of_the_file_act_and_are_held(arm, rng):
    soft = JointCompliance(2, (2e-5, 0.0))
    carrying = replace(arm, effects=(soft,))
    data = measured(
        arm, [at_random_place(arm, rng)], [joints_in_limits(arm, 60, rng)], 0.0, rng,
        layout=Layout.of((soft,), estimate=False),
    )
    assert evaluate_poses(carrying, data).overall.rms < 1e-9 < 1e-4 < evaluate_poses(arm, data).overall.rms
    doubled = replace(arm, effects=(soft.with_values((4e-5, 0.0)),))
    assert evaluate_poses(doubled, data).overall.rms > 1e-4


def test_frames_of_the_file_do_not_matter(arm, rng):
    data = measured(arm, [true_robot(arm, rng)], [joints_in_limits(arm, 40, rng)], NOISE_M, rng)
    elsewhere = replace(arm, base=Placement(position=np.array([5.0, -3.0, 1.0])),
                        tool=Placement(position=np.array([0.4, 0.0, 0.3])))
    assert evaluate_poses(elsewhere,
                          data).overall.rms == pytest.approx(evaluate_poses(arm, data).overall.rms, rel=1e-6)


def test_residual_is_measured_minus_predicted(arm, rng):
    """Its length is the error; a shift of one row of many by 1 mm shows there, along the shift."""
    data = measured(arm, [at_random_place(arm, rng)], [joints_in_limits(arm, 300, rng)], 0.0, rng)
    position = data.position.copy()
    position[17] += [0.0, 0.0, 1e-3]
    result = evaluate_poses(arm, replace(data, position=position))
    np.testing.assert_allclose(np.linalg.norm(result.residual, axis=1), result.error, rtol=1e-12)
    assert np.argmax(result.error) == 17 and result.residual[17, 2] > 0.9e-3


def test_robot_without_geometry_is_refused(rng):
    drives = load_robot("kr300")
    if drives.has_geometry:
        drives = replace(drives, has_geometry=False)
    data = Dataset.of_arrays("poses", {"q": rng.normal(size=(10, drives.axes))},
                             position=rng.normal(size=(10, 3)))
    with pytest.raises(InputError, match="expected a declared geometry"):
        evaluate_poses(drives, data)


# -- the command -------------------------------------------------------------------------------------
def test_command_writes_error_sessions_and_residuals(arm, rng, tmp_path):
    truth = true_robot(arm, rng)
    places = [at_random_place(truth, rng) for _ in range(2)]
    data = measured(arm, places, [joints_in_limits(arm, count, rng) for count in (15, 25)], NOISE_M, rng)
    write_robot(tmp_path / "robot.toml", arm)
    write_dataset(tmp_path / "poses.csv", data, arm)
    out = tmp_path / "out"
    assert cli.main(["evaluate", str(tmp_path / "robot.toml"), str(tmp_path / "poses.csv"), "--out", str(out),
                     "--quiet"]) == 0
    result = json.loads((out / "result.json").read_text())
    direct = evaluate_poses(arm, data)
    assert (
        result["error"]["n"] == 40 and result["error"]["rms"] == pytest.approx(direct.overall.rms, rel=1e-6)
    )
    assert [(s["session"], s["n"]) for s in result["sessions"]] == [(1, 15), (2, 25)]
    with open(out / "residuals.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 40
    np.testing.assert_allclose([float(row["error_m"]) for row in rows], direct.error, rtol=1e-6)


def test_command_refuses_data_without_positions(arm, tmp_path, capsys):
    write_robot(tmp_path / "robot.toml", arm)
    header = ",".join(f"theta_{i}_rad" for i in range(1, 7))
    (tmp_path / "poses.csv").write_text(header + "\n" + ",".join("0.1" for _ in range(6)) + "\n")
    code = cli.main(["evaluate", str(tmp_path / "robot.toml"), str(tmp_path / "poses.csv"), "--out",
                     str(tmp_path / "o"), "--quiet"])
    lines = capsys.readouterr().err.strip().splitlines()
    assert code == 2 and len(lines) == 1 and "poses.csv" in lines[0]
    assert not (tmp_path / "o" / "result.json").exists()


def test_a_curve_used_beyond_its_angles_is_told(arm, rng):
    """Half of the rows lie beyond: told with axis, angles and count, in evaluation and plan; within its
    angles, nothing."""
    q = joints_in_limits(arm, 60, rng)
    middle = float(np.median(q[:, 1])) - arm.offsets[1]
    curve = GearHarmonics(2, (1.0, 1e-5, 2e-5), (), 1e-4, (-np.pi + middle, middle))
    known = replace(arm, effects=(curve,))
    data = measured(known, [at_random_place(known, rng)], [q], 0.0, rng)
    (told,) = evaluate_poses(known, data).warnings
    assert "gear_harmonics of axis 2" in told and "30 of 60 rows" in told
    everywhere = replace(arm, effects=(replace(curve, seen=(-np.pi, np.pi)),))
    assert evaluate_poses(everywhere, data).warnings == ()


@pytest.mark.slow
def test_rows_that_the_robot_was_fitted_to_are_told():
    """`evaluate` is for data that the robot has not seen; it said nothing of others."""
    data = ea.read("ur10", "ur10/series_B")
    made = ea.calibrate("ur10", data, compliance=(), threads=1).robot
    told = [line for line in ea.evaluate(made, data, threads=1).warnings if "was fitted to" in line]
    assert told == [FITTED.format("series_B.csv")]
    assert not [line for line in ea.evaluate("ur10", data, threads=1).warnings if "was fitted to" in line]
    new = ea.evaluate(made, ea.read("ur10", "ur10/series_C"), threads=1)
    assert not [line for line in new.warnings if "was fitted to" in line]
