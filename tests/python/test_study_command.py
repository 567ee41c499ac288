"""`exactarm study` through the command line: the trade that the source's figures show, files, refusals."""

import csv
import json

import pytest

from exactarm.cli import main


@pytest.mark.slow
def test_a_smaller_weight_follows_better_and_asks_for_more_bandwidth(tmp_path):
    words = ["study", "racer-7-1.4", "line", "--rate", "100", "--nu", "1e-8,1e-13", "--out", str(tmp_path),
             "--quiet"]
    assert main(words) == 0
    cases = json.loads((tmp_path / "result.json").read_text())["cases"]
    assert [(case["input"], case["nu"]) for case in cases] == [
        ("acceleration", 1e-13), ("acceleration", 1e-8), ("jerk", pytest.approx(1e-17))]
    tight, loose, jerk = cases
    for where in ("knots", "between"):
        assert tight[where]["rms"] < 0.1 * loose[where]["rms"]
    # On the same model the virtual robot goes where the plan says; the two share no transcription.
    assert tight["knots"]["rms"] == pytest.approx(tight["tracking"]["position_rms_m"], rel=0.5, abs=1e-8)
    assert max(filter(None, tight["bandwidth_hz"])) >= max(filter(None, loose["bandwidth_hz"]))
    assert len(jerk["ringing_rad_s2"]) == 6 and jerk["tracking"]["position_rms_m"] < 1e-4
    rows = list(csv.DictReader((tmp_path / "study.csv").read_text().splitlines()))
    assert len(rows) == 3 and float(rows[1]["knots_rms_m"]) == loose["knots"]["rms"]
    drawn = {path.stem for path in (tmp_path / "plots").glob("*.svg")}
    assert {"tradeoff", "weight_line", "spectrum_line", "error_line", "axis_line", "speed_line",
            "errors_line", "motion_line",
            "space_line", "jerk_line"} == drawn
    assert sum(path.stat().st_size for path in tmp_path.rglob("*")) < 4e6


@pytest.mark.parametrize("words, text", [
    (["ur10", "line"], "spring"),
    (["racer-7-1.4", "line", "--nu", "1e-14"], "--nu"),
    (["racer-7-1.4", "line", "--nu", "1e-14,-1"], "--nu"),
    (["racer-7-1.4", "line", "--nu", "a,b"], "--nu"),
    (["racer-7-1.4", "line", "line"], "same name"),
    (["racer-7-1.4", "line", "--rate", "2"], "--rate"),
    (["racer-7-1.4", "line", "--rate", "1e9"], "--rate 1e+09: expected at most 2000000 samples"),
])
def test_what_cannot_be_studied_is_refused_in_one_line(tmp_path, capsys, words, text):
    assert main(["study", *words, "--out", str(tmp_path / "out"), "--quiet"]) == 2
    assert text in capsys.readouterr().err.strip().splitlines()[-1]
