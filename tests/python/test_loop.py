"""The circle on a virtual robot: with the cause in the model, the arm misses by less."""

import json

import pytest

from exactarm.cli import main


@pytest.mark.slow
def test_the_loop_closes(tmp_path):
    words = ["loop", "racer-7-1.4", "--effect",
             "gear_eccentricity joint=2 first_cos_rad=3e-4 first_sin_rad=1e-4",
             "--count", "120", "--out", str(tmp_path), "--quiet", "--threads", "1"]
    assert main(words) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    drawn, calibrated, diagnosed = (entry["tracking"]["rms"] for entry in result["rounds"])
    # A calibration that bends the geometry to a hidden cause need not help on a path; the diagnosis has to.
    assert diagnosed < 0.5 * min(drawn, calibrated)
    assert [(e["effect"], e["joint"]) for e in result["effects"]][0] == ("gear_eccentricity", 2)
    page = (tmp_path / "report.html").read_text()
    assert "What was hidden, and what was found" in page and page.count("gear eccentricity of axis 2") >= 2


def test_the_loop_wants_a_hidden_cause(tmp_path, capsys):
    assert main(["loop", "racer-7-1.4", "--out", str(tmp_path)]) == 2
    assert "--effect" in capsys.readouterr().err
