"""Certified error: ellipsoids that hold 95 % of fresh errors, wider where less is known, and what refuses to
be one."""

import json
from dataclasses import replace

import numpy as np
import pytest

from exactarm import cli
from exactarm.chain import predict_poses
from exactarm.data.dataset import write_dataset
from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.identify.evaluate import evaluate_poses
from exactarm.identify.planned import controller_angles
from exactarm.identify.pose_uncertainty import conformal_quantile, model_uncertainty, pose_uncertainty
from exactarm.robot.covariance import ParameterCovariance
from exactarm.robot_file import load_robot, read_robot, write_robot
from set_ups import measured, true_robot

NOISE_M, NARROW, WIDE = 1e-4, 0.6, 2.0  # rad: half range of the angles that were calibrated with, and beyond


def series(true, rng, count, half):
    return measured(load_robot("ur10"), [true], [rng.uniform(-half, half, (count, 6))], NOISE_M, rng)


@pytest.fixture(scope="module")
def arm():
    """The true arm, its calibration on 60 poses, and the generator."""
    rng = np.random.default_rng(11)
    robot = load_robot("ur10")
    true = true_robot(robot, rng, 0.5)
    found = calibrate(robot, series(true, rng, 60, NARROW), CalibrationOptions(seed=1))
    return true, found.robot, rng


def share_inside(robot, data, fresh):
    """Share of the errors at fresh poses within the ellipsoids that `data` made."""
    evaluation = evaluate_poses(robot, data)
    found = pose_uncertainty(robot, evaluation.frames, data, evaluation.residual, fresh, 1)
    error = fresh.position - found.position
    score = np.einsum("ni,ni->n", error, np.linalg.solve(found.covariance, error[:, :, None])[:, :, 0])
    return np.mean(score <= 7.8147), found


@pytest.mark.parametrize("half", [NARROW, WIDE])
@pytest.mark.slow
def test_the_ellipsoids_hold_95_percent_of_fresh_rows(arm, half):
    true, robot, rng = arm
    share, found = share_inside(robot, series(true, rng, 1500, half), series(true, rng, 3000, half))
    assert 0.93 <= share <= 0.97
    assert 0.93 <= found.coverage <= 0.97 and found.rows == 1500 and not found.own


@pytest.mark.slow
def test_few_rows_that_placed_their_own_frames_hold_as_many(arm):
    """Twenty rows of a set-up: what is left of them is smaller than what fresh rows err by (89 % inside).
    40 sets that scatter by 5 %: the mean is known to 0.9 %. Two of these below the expected 20/21; above, the
    frames' own covariance in S may hold a little more."""
    true, robot, _ = arm
    own = np.random.default_rng(14)  # the first tried; the shared one hangs on other tests
    shares = [share_inside(robot, series(true, own, 20, NARROW), series(true, own, 200, NARROW))[0]
              for _ in range(40)]
    assert 0.935 <= np.mean(shares) <= 0.985


def test_far_from_the_calibrated_poses_the_covariance_carries_it(arm):
    """Judged by rows near the calibrated poses alone, ellipsoids of poses far off hold the errors there
    too."""
    true, robot, rng = arm
    near, far = series(true, rng, 800, NARROW), series(true, rng, 2000, WIDE)
    share, found = share_inside(robot, near, far)
    inner = share_inside(robot, near, series(true, rng, 500, NARROW))[1]
    assert np.median(found.radius) > 1.5 * np.median(inner.radius)
    assert share > 0.90


def test_without_measured_rows_the_radius_still_holds_95_percent(arm):
    """A sphere around the ellipsoid holds more than the ellipsoid; both narrow and wide poses, and no ten
    times."""
    true, robot, rng = arm
    placed = evaluate_poses(robot, series(true, rng, 1500, WIDE)).frames
    for half in (NARROW, WIDE):
        fresh = series(true, rng, 2000, half)
        error = predict_poses(robot, placed, fresh).residual()[:, :3]
        radius = model_uncertainty(robot, controller_angles(robot, fresh))
        off = np.linalg.norm(error, axis=1)
        assert 0.93 <= np.mean(off <= radius)
        assert np.median(radius) < 2.0 * np.quantile(off, 0.95)


def test_without_a_covariance_there_is_no_radius_and_a_row_without_angles_has_none(arm):
    _, robot, _ = arm
    q = np.zeros((3, 6))
    q[1] = np.nan
    assert model_uncertainty(load_robot("ur10"), q) is None
    assert np.isfinite(model_uncertainty(robot, q)).tolist() == [True, False, True]


@pytest.mark.slow
def test_plan_and_compensate_say_how_far_the_model_is_to_be_trusted(arm, tmp_path):
    _, robot, _ = arm
    write_robot(tmp_path / "arm.toml", robot)
    targets = tmp_path / "targets.csv"
    # of its own: the shared generator hangs on which tests ran before; elbow and wrist bent, for a
    # pose that is close to singular is refused
    own = np.random.default_rng(12)
    q = own.uniform(-NARROW, NARROW, (5, 6))
    q[:, [2, 4]] = own.uniform(0.5 * NARROW, NARROW, (5, 2))
    targets.write_text("".join(",".join(map(str, row)) + "\n"
                               for row in [[f"q_{i + 1}_rad" for i in range(6)], *q.tolist()]))
    coarse = replace(robot, covariance=replace(robot.covariance, noise_m=0.03))
    write_robot(tmp_path / "coarse.toml", coarse)
    for file, told in ((tmp_path / "coarse.toml", True), (tmp_path / "arm.toml", True), ("ur10", False)):
        out = tmp_path / f"out_{told}"
        assert cli.main(["compensate", str(file), str(targets), "--points", "calculated", "--start",
                         "0,0,0,0,0,0", "--out", str(out), "--quiet"]) == 0
        found = json.loads((out / "result.json").read_text())["model_uncertainty"]
        assert (found is not None) == told
        assert ("radius95_mm" in (out / "compensation.csv").read_text()) == told
        page = (out / "report.html").read_text()
        assert ("carries no covariance" in page) != told
        assert ("the arm may end up no better" in page) == (file == tmp_path / "coarse.toml")
    wanted = model_uncertainty(robot, q)
    found = json.loads((tmp_path / "out_True" / "result.json").read_text())["model_uncertainty"]
    assert np.isclose(found["radius95_max_m"], wanted.max(), rtol=0.1)  # the commands are not the targets


def test_a_quantile_needs_enough_rows():
    assert conformal_quantile(np.arange(1.0, 20.0)) == 19.0
    assert conformal_quantile(np.arange(1.0, 19.0)) == np.inf
    assert conformal_quantile(np.arange(1.0, 100.0)) == 95.0


def test_the_covariance_survives_the_robot_file(arm, tmp_path):
    write_robot(tmp_path / "robot.toml", arm[1])
    again = read_robot(tmp_path / "robot.toml").covariance
    assert again == arm[1].covariance and len(again.names) > 15
    low, high = np.array([arm[1].intervals[name] for name in again.names]).T
    sd = np.linalg.norm(again.matrix(), axis=1)
    inside = low != 0.0  # an interval that ends at the bound of a size without a negative sign is lopsided
    assert inside.sum() > 15 and np.allclose((0.5 * (high - low) / sd)[inside], 2.0, atol=0.1)


def test_rounding_leaves_a_covariance_one():
    rng = np.random.default_rng(2)
    root = rng.standard_normal((8, 3)) * 10.0 ** np.arange(-4, 4)[:, None]
    factor = ParameterCovariance.of(tuple("abcdefgh"), root @ root.T, 1e-4).matrix()
    assert np.allclose(factor @ factor.T, root @ root.T, rtol=1e-4, atol=1e-12)


@pytest.mark.slow
def test_evaluate_at_poses_writes_keys_table_and_picture(arm, tmp_path):
    true, robot, rng = arm
    write_robot(tmp_path / "robot.toml", robot)
    write_dataset(tmp_path / "new.csv", series(true, rng, 40, NARROW), robot)
    poses, out = tmp_path / "at.csv", tmp_path / "out"
    names = ",".join(f"q_{i}_rad" for i in range(1, 7))
    poses.write_text(f"{names}\n0.1,-0.2,0.3,0.1,0.2,0.3\n1,-1,1,1,1,1\n")
    files = [str(tmp_path / "robot.toml"), str(tmp_path / "new.csv")]
    assert cli.main(["evaluate", *files, "--at", str(poses), "--out", str(out)]) == 0
    result = json.loads((out / "result.json").read_text())
    first, second = result["uncertainty"]
    assert np.array(first["covariance_m2"]).shape == (3, 3)
    assert first["radius95_m"] == max(first["ellipsoid95_m"])
    assert second["radius95_m"] > first["radius95_m"]
    assert result["uncertainty_check"]["rows"] == 40 and result["uncertainty_check"]["parameter_covariance"]
    assert (out / "uncertainty.csv").is_file() and (out / "plots" / "uncertainty_per_pose.svg").is_file()


def test_too_few_rows_are_refused(arm, tmp_path, capsys):
    true, robot, rng = arm
    write_robot(tmp_path / "robot.toml", robot)
    write_dataset(tmp_path / "new.csv", series(true, rng, 12, NARROW), robot)
    files = [str(tmp_path / "robot.toml"), str(tmp_path / "new.csv")]
    assert cli.main(["evaluate", *files, "--at", files[1], "--out", str(tmp_path / "out")]) == 2
    assert "at least 19" in capsys.readouterr().err
