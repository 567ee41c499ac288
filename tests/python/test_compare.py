"""What a plan is worth: rigid motions and the planned one on the same true robot, by two engines, at and
between the knots."""

import csv
import json

import numpy as np
import pytest

from exactarm.cli import main
from exactarm.commands.compare import BETWEEN

PATH = """kind = "line"
start_m = [0.834, 0.0, 1.0]
end_m = [0.834, 0.2, 1.05]
duration_s = 1.0
rate_hz = 250
"""


def compare(tmp_path, *words):
    (tmp_path / "short.toml").write_text(PATH)
    out = tmp_path / "out"
    code = main(["simulate", "racer-7-1.4", "--compare", str(tmp_path / "short.toml"), "--out", str(out),
                 *words])
    return code, out


@pytest.mark.slow
def test_a_plan_is_worth_three_orders_of_magnitude_on_both_engines(tmp_path, capsys):
    code, out = compare(tmp_path)
    assert code == 0
    result = json.loads((out / "result.json").read_text())
    found = {(row["method"], row["engine"]): row for row in result["tracking"]}
    assert len(found) == 6
    for engine in ("own", "pinocchio"):
        for where in ("knots", "between"):
            error = {method: found[method, engine][where]["rms"]
                     for method in ("nominal", "identified", "exactarm")}
            assert error["exactarm"] < 2e-6 and 1e-4 < error["identified"] and 1e-4 < error["nominal"] < 1e-2
    assert found["nominal",
                 "own"]["knots"]["n"] == 251 and found["nominal",
                                                       "own"]["between"]["n"] == (BETWEEN - 1) * 250
    assert max(result["engines_differ_m"].values()) < 1e-7
    with open(out / "compare.csv", newline="") as file:
        rows = [[float(value) for value in row] for row in list(csv.reader(file))[1:]]
    table = np.array(rows)
    assert table.shape == (BETWEEN * 250 + 1, 7)
    assert np.sqrt(np.mean(table[::BETWEEN, 1] ** 2)) == pytest.approx(
        found["nominal", "own"]["knots"]["rms"]
    )
    assert "micrometres" in capsys.readouterr().out


@pytest.mark.slow
def test_without_deviation_only_deflection_and_gears_part_the_rigid_motions_from_the_plan(tmp_path):
    code, out = compare(tmp_path, "--deviation", "0", "--engine", "own", "--gear-direction", "cw")
    assert code == 0
    error = {row["method"]: row["knots"]["rms"]
             for row in json.loads((out / "result.json").read_text())["tracking"]}
    assert error["nominal"] == pytest.approx(error["identified"], rel=1e-6)
    assert error["exactarm"] < 2e-6


@pytest.mark.slow
def test_a_hidden_effect_is_on_the_robot_alone_and_silences_the_independent_engine(tmp_path):
    code, out = compare(tmp_path, "--effect",
                        "payload mass_kg=3 moment_x_kg_m=0 moment_y_kg_m=0 moment_z_kg_m=0.3", "--damping",
                        "1e-3")
    assert code == 0
    result = json.loads((out / "result.json").read_text())
    assert (
        {row["engine"] for row in result["tracking"]} == {"own"}
        and "effects" in result["independent_engine_silent"]
    )
    plan = next(row for row in result["tracking"] if row["method"] == "exactarm")
    assert plan["knots"]["rms"] > 1e-5
    assert "payload" in (out / "truth.toml").read_text()


@pytest.mark.parametrize("words, expected", [
    (["--measure", "poses"], "--measure"), (["--quasi-static"], "--quasi-static"),
    (["--deviation", "-1"], "--deviation"),
    (["--engine", "pinocchio", "--damping", "0.001"], "--engine pinocchio"),
])  # fmt: skip
def test_what_cannot_be_compared_is_refused(tmp_path, capsys, words, expected):
    code, out = compare(tmp_path, *words)
    assert code == 2 and expected in capsys.readouterr().err
    assert not (out / "result.json").exists()


def test_a_robot_without_springs_is_refused(tmp_path, capsys):
    assert main(["simulate", "ur10", "--compare", "line", "--out", str(tmp_path)]) == 2
    assert "spring" in capsys.readouterr().err
