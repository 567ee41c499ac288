"""Several reflectors of one plate on the tool are one pose."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import exactarm as ea
from exactarm.data.dataset import read_dataset
from exactarm.data.reflectors import plate_poses
from exactarm.errors import InputError
from exactarm.robot_file import load_robot

PLATE = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.05, 0.15, 0.0], [-0.1, 0.05, 0.04]])
ROWS = 40


def seen(count=3, noise=0.0, seed=0):
    """Points (N, k, 3), and poses of the plate that show them. Without noise nothing hangs on the seed."""
    rng = np.random.default_rng(seed)
    turn, place = Rotation.random(ROWS, rng).as_matrix(), rng.normal(0.0, 1.0, (ROWS, 3))
    points = place[:, None] + np.einsum("nij,kj->nki", turn, PLATE[:count])
    return points + rng.normal(0.0, noise, points.shape), place, turn


def written(folder, points, name="poses.csv", unit="mm", header=None):
    """A file of joint angles and reflectors."""
    q = np.random.default_rng(9).uniform(-1.0, 1.0, (len(points), 6))
    size = {"mm": 1e3, "m": 1.0}[unit]
    header = header or [f"{axis}{k + 1}_{unit}" for k in range(points.shape[1]) for axis in "xyz"]
    table = np.column_stack([q, size * points.reshape(len(points), -1)])
    path = folder / name
    np.savetxt(path, table, delimiter=",", comments="", fmt="%.9f",
               header=",".join([*[f"q_{i}_rad" for i in range(1, 7)], *header]))
    return str(path)


@pytest.mark.parametrize("count", [3, 4])
def test_the_target_is_the_first_and_the_plate_gives_the_axes(count):
    points, place, turn = seen(count)
    position, rotation = plate_poses(points, "poses.csv", "x1_mm")
    assert np.allclose(position, place, atol=1e-12) and np.allclose(rotation, turn, atol=1e-12)


def test_all_reflectors_tell_of_the_first():
    """Of N noises of variance s^2 a coordinate the first point has s^2 (1 / k + r'(tr(S) - S)^-1 r) by the
    rigid plate, S its second moment: here 0.68 s; 120 numbers tell it to 7 %."""
    points, place, _ = seen(4, 1e-4, 3)
    arms = PLATE - PLATE.mean(axis=0)
    moment = arms.T @ arms
    turned = np.linalg.inv(np.trace(moment) * np.eye(3) - moment)
    cross = np.cross(np.eye(3), arms[0])
    expected = 1e-4 * np.sqrt(1.0 / 4.0 + np.trace(cross @ turned @ cross.T) / 3.0)
    position, _ = plate_poses(points, "poses.csv", "x1_mm")
    assert expected < 0.75e-4
    assert np.std(position - place) == pytest.approx(expected, rel=0.2)


def test_the_axes_hang_on_no_row_and_no_file(tmp_path):
    points, _, turn = seen()
    files = [written(tmp_path, part, f"{k}.csv", unit)
             for k, (part, unit) in enumerate([(points[:15], "mm"), (points[15:], "m")])]
    data = read_dataset(files, load_robot("ur10"))
    assert np.allclose(data.rotation, turn, atol=1e-6) and data.kind == "poses" and not data.covariates


def test_one_reflector_is_a_position(tmp_path):
    points, place, _ = seen(1)
    data = read_dataset([written(tmp_path, points, header=["x_1_m", "y_1_m", "z_1_m"], unit="m")],
                        load_robot("ur10"))
    assert np.allclose(data.position, place) and data.rotation is None


@pytest.mark.slow
def test_a_calibration_is_the_same_as_with_the_pose(tmp_path):
    made = ea.simulate("racer-7-1.4", count=40, noise=2e-5, deviation=0.5, counts=0, orientation=True).data
    poses = [made.position, made.position + 0.2 * made.rotation[:, :, 0],
             made.position + 0.15 * made.rotation[:, :, 1]]
    columns = {f"theta_{i + 1}_rad": made.joints["theta"][:, i] for i in range(6)}
    columns |= {f"approach_{i + 1}": made.joints["approach"][:, i] for i in range(6)}
    columns |= {f"{axis}{k + 1}_m": part[:, j] for k, part in enumerate(poses)
                for j, axis in enumerate("xyz")}
    path = tmp_path / "reflectors.csv"
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", comments="", fmt="%.12g",
               header=",".join(columns))
    given = ea.calibrate("racer-7-1.4", made, use="pose").after["identification"].rms
    found = ea.calibrate("racer-7-1.4", path).after["identification"].rms
    assert found == pytest.approx(given, rel=1e-3)


@pytest.mark.parametrize(("change", "words"), [
    (lambda p: p[:, :2], "expected three of one plate"),
    (lambda p: p[:, [0, 1, 1]] + [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], "keep their distances"),
])
def test_reflectors_that_are_no_plate_are_refused(tmp_path, change, words):
    points, _, _ = seen()
    with pytest.raises(InputError, match=words):
        read_dataset([written(tmp_path, change(points))], load_robot("ur10"))


def test_reflectors_on_a_line_are_refused():
    points, _, _ = seen()
    points[:, 2] = 0.5 * (points[:, 0] + points[:, 1])
    with pytest.raises(InputError, match="on one line"):
        plate_poses(points, "poses.csv", "x1_mm")


@pytest.mark.parametrize("row", [0, 17])
def test_two_that_are_exchanged_in_a_row_are_told_with_the_row(tmp_path, row):
    points, _, _ = seen()
    points[row, [1, 2]] = points[row, [2, 1]]
    with pytest.raises(InputError, match="are two exchanged") as error:
        read_dataset([written(tmp_path, points)], load_robot("ur10"))
    assert error.value.row == row + 1


def test_a_missing_coordinate_and_a_pose_beside_them_are_refused(tmp_path):
    points, _, _ = seen()
    header = ["x1_m", "y1_m", "z1_m", "x2_m", "y2_m", "temperature", "x3_m", "y3_m", "z3_m"]
    with pytest.raises(InputError, match="expected it beside column x2_m"):
        read_dataset([written(tmp_path, points, header=header, unit="m")], load_robot("ur10"))
    header = ["x_m", "y_m", "z_m", "x2_m", "y2_m", "z2_m", "x3_m", "y3_m", "z3_m"]
    with pytest.raises(InputError, match="expected either"):
        read_dataset([written(tmp_path, points, header=header, unit="m")], load_robot("ur10"))


def test_a_row_that_shows_one_of_three_is_refused_with_the_layout_that_it_needs(tmp_path):
    points, *_ = seen(3)
    points[4, 1] = np.nan
    path = Path(written(tmp_path, points))
    path.write_text(path.read_text().replace("nan", ""))
    with pytest.raises(InputError, match="row 5, column x2_mm: empty cell.*`session` for each reflector"):
        read_dataset(path, load_robot("ur10"))
