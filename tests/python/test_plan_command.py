"""`exactarm plan` through the command line: files, keys, options, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest

from exactarm.cli import main
from exactarm.files.table import read_table


def run(tmp_path, *words):
    code = main(["plan", *words, "--out", str(tmp_path / "out"), "--quiet"])
    result = tmp_path / "out" / "result.json"
    return code, json.loads(result.read_text()) if result.exists() else None


@pytest.mark.slow
def test_plan_writes_trajectory_result_report_and_plots(tmp_path):
    code, result = run(tmp_path, "racer-7-1.4", "line", "--rate", "250")
    assert code == 0
    assert set(result["solver"]) >= {"name", "status", "iterations", "seconds", "kkt_error"}
    assert set(result["tracking"]) == {"position_rms_m", "position_max_m", "joint_max_rad"}
    assert len(result["bandwidth_hz"]) == 6 and result["path"]["samples"] == 626
    columns = read_table(tmp_path / "out" / "trajectory.csv").columns
    assert len(columns["time_s"]) == 626 and columns["time_s"][1] == pytest.approx(0.004)
    assert np.abs(columns["q_1_rad"]
                  - columns["q_desired_1_rad"]).max() <= result["tracking"]["joint_max_rad"]
    assert (
        (tmp_path / "out" / "report.html").exists() and list((tmp_path / "out" / "plots").glob("spectrum.*"))
    )


@pytest.mark.slow
def test_options_replace_those_of_the_path_and_parquet_is_written(tmp_path):
    code, result = run(tmp_path, "racer-7-1.4", "spiral", "--rate", "100", "--duration", "4", "--nu", "1e-10",
                       "--gear-direction", "cw", "--solver", "ipopt", "--format", "parquet")
    assert code == 0 and result["path"]["samples"] == 401 and result["path"]["nu"] == 1e-10
    assert result["solver"]["name"] == "ipopt" and result["path"]["gear_direction"] == "cw"
    assert read_table(tmp_path / "out" / "trajectory.parquet").rows == 401


@pytest.mark.parametrize("words, code, text", [
    (("racer-7-1.4", "nowhere.toml"), 2, "nowhere.toml"),
    (("kr300", "line"), 2, "geometry"),
    (("racer-7-1.4", "line", "--rate", "-5"), 2, "--rate"),
    (("racer-7-1.4", "line", "--rate", "1"), 2, "samples"),
    (("racer-7-1.4", "line", "--rate", "1e6"), 2, "samples"),
    (("racer-7-1.4", "line", "--duration", "nan"), 2, "--duration"),
    (("racer-7-1.4", "line", "--start", "a,b"), 2, "--start"),
    (("racer-7-1.4", "line", "--start", "1,2"), 2, "start"),
    (("racer-7-1.4", "line", "--rate", "400", "--duration", "0.2"), 1, "shortest duration"),
    (("racer-7-1.4", "mm.toml"), 2, "mm.toml: key start_m: found [834, 0, 1000], expected three coordinates"),
])
def test_failures_end_with_their_code_and_one_line(tmp_path, monkeypatch, capsys, words, code, text):
    monkeypatch.chdir(tmp_path)
    line = "start_m = [834, 0, 1000]\nend_m = [834, 50, 1000]\n"
    Path("mm.toml").write_text(f'kind = "line"\nduration_s = 1.0\n{line}')
    found, result = run(tmp_path, *words)
    error = capsys.readouterr().err.strip().splitlines()
    assert found == code and result is None
    assert error[-1].startswith("exactarm: error:") and text in error[-1]


@pytest.mark.slow
def test_a_path_that_is_not_followed_is_told(tmp_path):
    """A weight of the input by which the flange misses by millimetres; by the default it is nanometres."""
    for nu, told in (("1e6", True), ("1e-14", False)):
        code, result = run(tmp_path / nu, "racer-7-1.4", "line", "--rate", "200", "--nu", nu)
        assert code == 0 and any("misses the path by up to" in line for line in result["warnings"]) == told
