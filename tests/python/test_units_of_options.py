"""Numbers of the command line in another unit than the option's, or beyond what they can be, refused with the
option and what is expected; points in another unit, told where they are merged."""

import numpy as np
import pandas as pd
import pytest

import exactarm as ea
from exactarm import cli

SIMULATE = ["simulate", "racer-7-1.4"]
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
    ([*SIMULATE, "--noise", "50"], "--noise 50: expected a standard deviation in m, at most 0.02"),
    ([*SIMULATE, "--noise", "0.05"], "--noise 0.05: expected a standard deviation in m"),
    ([*SIMULATE, "--noise", "50", "--measure", "gear"], "--noise 50: expected a standard deviation in rad/s"),
    ([*SIMULATE, "--wrong-rows", "2"], "--wrong-rows 2: expected a share from 0 to 1"),
    ([*SIMULATE, "--wrong-rows", "nan"], "--wrong-rows nan: expected a share"),
    ([*SIMULATE, "--temperature", "-300", "20"], "--temperature -300: expected degrees Celsius, -100 to 200"),
    ([*SIMULATE, "--temperature", "20", "293"], "--temperature 293: expected degrees Celsius"),
    ([*SIMULATE, "--deviation", "inf"], "--deviation inf: expected 0 or more"),
    ([*SIMULATE, "--effect", "backlash joint=2 width_rad=1e-4 width_rad=2e-4"], "width_rad is given twice"),
    ([*SIMULATE, "--effect", "backlash joint=2 width_rad=0.3"],
     "width_rad=0.3; expected a number from 0 to 0.01"),
    ([*SIMULATE, "--effect", "coulomb_friction joint=2 torque_Nm=-3"], "expected a number from 0 to inf"),
    ([*SIMULATE, "--effect", "backlash joint=2 width_rad=nan"], "width_rad=nan; expected a number"),
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


@pytest.mark.parametrize("words, said", [
    (["--seconds", "0.001"], "--seconds 0.001, --rate 500: 0 samples; expected 8 or more"),
    (["--rate", "0.1"], "--seconds 10, --rate 0.1: 1 samples; expected 8 or more"),
])
def test_motions_of_a_few_samples_are_refused(tmp_path, capsys, words, said):
    """Of none it was a fault."""
    assert cli.main([*SIMULATE, "--measure", "motion", *words, "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"exactarm: error: {said}\n"
