"""Words of `compensate` that no cell can mean are refused by their option."""

import pytest

from exactarm import cli

TARGETS = "q_1_rad,q_2_rad,q_3_rad,q_4_rad,q_5_rad,q_6_rad\n0.8,-1.1,1.5,-0.3,1.0,-0.1\n"


@pytest.mark.parametrize("option, value, says", [
    ("--tool", "1,2,3,4,5,1e300", "expected 6 or 7 numbers with commas between them, none beyond 1e+06"),
    ("--start", "1e300,0,0,0,0,0", "expected 6 numbers"),
    ("--start", "nan,0,0,0,0,0", "expected 6 numbers"),
    ("--payload", "5000,0,0,80", "expected kg, and its centre in m, within 2 m of the flange"),
    ("--payload", "100000,0,0,0", "expected kg"),
])
def test_a_word_that_no_cell_can_mean_is_refused(tmp_path, capsys, option, value, says):
    (tmp_path / "targets.csv").write_text(TARGETS)
    words = ["compensate", "ur10", str(tmp_path / "targets.csv"), option, value]
    assert cli.main([*words, "--out", str(tmp_path / "out"), "--quiet"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"{option} {value}: " in said and says in said
    assert not (tmp_path / "out" / "result.json").exists()
