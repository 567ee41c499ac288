"""Headers in capitals, and cells parted by blanks: the line says what would be read."""

import pytest

from spoiled_rows import HEADER, POSE, assert_refused


@pytest.mark.parametrize("header, row, words", [
    (HEADER.upper(), POSE, "column Q_1_RAD: is no quantity of a joint; did you mean q_1_rad"),
    ("TAU_1_NM", "3.0", "did you mean tau_1_Nm"),
    (HEADER.replace(",", " "), POSE.replace(",", " "), "row 1: cells parted by blanks; expected commas"),
])
def test_what_would_be_read_is_said(tmp_path, header, row, words):
    assert_refused(tmp_path / "poses.csv", f"{header}\n{row}\n", words)
