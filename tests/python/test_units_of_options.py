"""Numbers of the command line in another unit than the option's, refused with the option and what is
expected; points in another unit, told where they are merged."""

import numpy as np
import pandas as pd
import pytest

import exactarm as ea
from exactarm import cli

DESIGN = ["design", "racer-7-1.4", "--count", "12", "--validation", "4"]


@pytest.mark.parametrize("words, said", [
    ([*DESIGN, "--tool", "0,0,150"], "--tool 0,0,150: 150 m from the flange of an arm that reaches"),
    (["identifiable", "racer-7-1.4", "--tool", "0,80,150"], "--tool 0,80,150: 170 m from the flange"),
    ([*DESIGN, "--station", "3000,0,1000"], "--station 3000,0,1000: 3162 m from the robot; expected metres"),
    ([*DESIGN, "--noise-mm", "0.00005"], "--noise-mm 5e-05: expected mm, 0.0001 to 100"),
    (["identifiable", "racer-7-1.4", "--noise", "0.05"],
     "--noise 0.05: expected a standard deviation in m, above 0, at most"),
    (["loop", "racer-7-1.4", "--effect", "gear_ratio joint=2 scale=3e-4", "--noise", "0.03"],
     "--noise 0.03: expected a standard deviation in m, above 0, at most"),
])
def test_a_number_in_another_unit_is_refused(words, said, tmp_path, capsys):
    assert cli.main([*words, "--out", str(tmp_path / "out"), "--quiet"]) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1 and not (tmp_path / "out/result.json").exists()


@pytest.mark.parametrize("unit, words", [
    ("mm", ""), ("m", "millimetres labelled as metres"),
])
def test_points_merged_in_another_unit_are_told(unit, words, tmp_path):
    rows = pd.read_csv(ea.example("ur10/series_B"))[::50]
    names = [f"p{i}" for i in range(len(rows))]
    log = rows[[f"q_{i}_rad" for i in range(1, 7)]].assign(name=names)
    log.to_csv(tmp_path / "log.csv", index=False)
    np.savetxt(tmp_path / "points.txt", np.column_stack([names, rows[["x_mm", "y_mm", "z_mm"]]]), "%s")
    merged = ea.merge("ur10", tmp_path / "log.csv", tmp_path / "points.txt", unit=unit)
    found = [line for line in merged["warnings"] if "labelled as" in line]
    assert len(found) == bool(words) and all(words in line for line in found)
