"""What is done to targets, weights, pictures and noise must come back in the answers of the commands that
judge no errors: identifiable, design, simulate, compensate, study, corners. `loop` and `demo` are these and
the others in a row."""

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import exactarm as ea
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.robot_file import load_robot
from test_metamorphic_commands import REVERSED, axis_reversed

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from robustness.samples import BOARD, samples

ORDER = np.random.default_rng(3).permutation(24)


@cache
def targets() -> pd.DataFrame:
    q = np.random.default_rng(12).uniform(-0.6, 0.6, (24, 6)) + [0.3, -1.2, 1.0, 0.2, 0.9, 0.0]
    return pd.DataFrame(q, columns=[f"q_{i}_rad" for i in range(1, 7)])


def in_degrees(table: pd.DataFrame) -> pd.DataFrame:
    return np.degrees(table).rename(columns=lambda name: name.replace("_rad", "_deg"))


def reversed_axis(robot):
    """The arm and its targets with an axis that counts the other way."""
    other, data = axis_reversed(robot, Dataset.of_arrays(POSES.name, {"q": targets().to_numpy()}))
    if frames := list(robot.controller.frames):  # of a calibrated arm, as its controller has them
        frames[REVERSED] = replace(frames[REVERSED], sign=-frames[REVERSED].sign)
        other = replace(other, controller=replace(robot.controller, frames=tuple(frames)))
    return other, pd.DataFrame(data.joints["q"], columns=targets().columns)


# -- identifiable ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("law, times", [("order", 1.0), ("units", 1.0), ("axis", 1.0),
                                        ("doubled", np.sqrt(0.5)), ("noise", 3.0)])
def test_what_poses_can_show_follows(law, times):
    robot, table, noise = load_robot("ur10"), targets(), 3e-5 if law == "noise" else 1e-5
    changed = {"order": (robot, table.iloc[ORDER]), "units": (robot, in_degrees(table)),
               "axis": reversed_axis(robot), "doubled": (robot, pd.concat([table, table]))}
    one = ea.identifiable(robot, table, noise=1e-5).tables["parameters.csv"]
    other = ea.identifiable(*changed.get(law, (robot, table)), noise=noise).tables["parameters.csv"]
    assert list(other["parameter"]) == list(one["parameter"])
    assert list(other["identifiable"]) == list(one["identifiable"])
    expected = times * np.asarray(one["standard_deviation"], float)
    assert np.asarray(other["standard_deviation"], float) == pytest.approx(expected, rel=1e-6, nan_ok=True)
    assert np.isfinite(expected).sum() > 20


# -- design ------------------------------------------------------------------------------------------------
@pytest.mark.slow
def test_poses_of_a_design_are_those_of_any_noise_and_show_causes_in_its_measure():
    one, other = (ea.design("racer-7-1.4", count=12, validation=4, noise_mm=mm) for mm in (0.05, 0.1))
    for name, column in one.tables["poses.csv"].items():
        np.testing.assert_array_equal(other.tables["poses.csv"][name], column)
    assert {name: one[name] for name in ("O1", "O5")} == {name: other[name] for name in ("O1", "O5")}
    told = [np.asarray(found.tables["isolability.csv"]["seen"], float) for found in (one, other)]
    assert told[0].max() > 5.0 and told[1] == pytest.approx(0.5 * told[0], rel=1e-3, abs=0.01)


@pytest.mark.slow
def test_a_design_counts_with_its_axes():
    """The drawn poses differ, as their limits do; what the best of them show does not."""
    robot = load_robot("racer-7-1.4")
    one, other = (ea.design(arm, count=40, validation=4)["O1"] for arm in (robot, reversed_axis(robot)[0]))
    assert other == pytest.approx(one, rel=0.05)


# -- simulate ----------------------------------------------------------------------------------------------
def measured(table: pd.DataFrame, noise: float = 0.0) -> np.ndarray:
    return ea.simulate("ur10", table, measure="poses", frames="declared", noise=noise, counts=0).data.position


def test_simulated_poses_follow_their_targets():
    table, exact = targets(), measured(targets())
    np.testing.assert_allclose(measured(table.iloc[ORDER]), exact[ORDER], atol=1e-12)
    np.testing.assert_allclose(measured(in_degrees(table)), exact, atol=1e-12)
    one, three = (measured(table, noise) - exact for noise in (1e-5, 3e-5))
    np.testing.assert_allclose(three, 3.0 * one, atol=1e-12)
    assert np.std(one) == pytest.approx(1e-5, rel=0.3)


# -- compensate --------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def calibrated():
    robot = load_robot("ur10")
    data = ea.read(ea.example("ur10/series_B"), robot)
    return ea.calibrate(robot, data.select(np.arange(0, len(data), 20))).robot


def corrected(robot, table: pd.DataFrame) -> np.ndarray:
    found = ea.compensate(robot, table).tables["table_1.parquet"]
    return np.column_stack([found[f"q_{i}_rad"] for i in range(1, 7)])


def test_corrections_follow_their_targets(calibrated):
    table, one = targets(), corrected(calibrated, targets())
    assert np.abs(one - table.to_numpy()).max() > 1e-4
    np.testing.assert_allclose(corrected(calibrated, table.iloc[ORDER]), one[ORDER], atol=1e-9)
    np.testing.assert_allclose(corrected(calibrated, in_degrees(table)), one, atol=1e-9)
    twice = corrected(calibrated, pd.concat([table, table], ignore_index=True))
    np.testing.assert_allclose(twice, np.concatenate([one, one]), atol=1e-9)


def test_an_axis_that_counts_the_other_way_has_the_opposite_correction(calibrated):
    one, (robot, table) = corrected(calibrated, targets()), reversed_axis(calibrated)
    signs = np.where(np.arange(6) == REVERSED, -1.0, 1.0)
    np.testing.assert_allclose(corrected(robot, table), signs * one, atol=1e-9)


# -- study -------------------------------------------------------------------------------------------------
@pytest.mark.slow
def test_weights_in_another_order_and_paths_in_another_order_are_the_same_study():
    def cases(paths, nu):
        found = ea.study("racer-7-1.4", paths, nu=nu, rate_hz=40)["cases"]
        return {(case["path"], case["input"], case["nu"]): case["tracking"] for case in found}

    one = cases(["line", "spiral"], [1e-12, 1e-9])
    assert cases(["spiral", "line"], [1e-9, 1e-12]) == one and len(one) >= 4


# -- corners -----------------------------------------------------------------------------------------------
@pytest.mark.slow
def test_pictures_in_another_order_have_the_same_corners(tmp_path):
    content = samples()["board.png"]
    for name in ("a.png", "b.png"):
        (tmp_path / name).write_bytes(content)
    (tmp_path / "board.toml").write_text(BOARD)
    q = targets()[:2]

    def seen(order):
        pictures = [tmp_path / ("a.png", "b.png")[k] for k in order]
        found = ea.corners("ur10", q.iloc[list(order)], pictures, fixture=tmp_path / "board.toml").data
        return {(round(float(row[0]), 9), int(corner)): tuple(pixel) for row, corner, pixel in zip(
            found.joints["q"], found.corner, found.pixel)}

    assert seen((0, 1)) == seen((1, 0)) != {}
