"""A diagnosis says which rows of the files its residuals are, and which of them it has left out."""

from types import SimpleNamespace

import numpy as np
import pytest

import exactarm as ea
from exactarm.commands.diagnose_report import report_of
from exactarm.data.dataset import write_dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.view import axes_not_logged
from set_ups import joints_in_limits, measured, true_robot
from six_axis import six_axis


@pytest.mark.slow
def test_rows_left_out_are_found_in_the_file(tmp_path):
    random, arm = np.random.default_rng(1), six_axis(placed=False)
    data = measured(arm, [true_robot(arm, random)], [joints_in_limits(arm, 80, random)], 3e-5, random)
    wrong = np.flatnonzero(data.split(1))[[7, 30]]
    data.position[wrong] += 5e-3
    write_dataset(tmp_path / "poses.csv", data, arm)
    made = ea.diagnose(arm, tmp_path / "poses.csv")
    table = made.to_dataframe("residuals")
    assert list(table.columns[:4]) == ["file", "row", "session", "set"] and len(table) == 80
    assert sorted(table.row) == list(range(1, 81)) and table.file[0].endswith("poses.csv")
    assert set(table.row[table.error_after.isna()]) == set(wrong + 1)

    result = diagnose(arm, ea.read(tmp_path / "poses.csv", arm), seed=1)
    report = report_of(arm, [result], "", [])
    (causes,) = (section for section in report.sections if getattr(section, "heading", "") == "Causes found")
    assert all(f"row {row + 1} of poses.csv" in causes.note for row in wrong)
    drawn = {figure.name: figure.caption for figure in report.figures}
    assert all("left out as outliers are not drawn" in drawn[name] for name in ("arm", "error_per_row"))


def test_axes_of_whose_angle_a_log_says_nothing_are_known():
    """A gear run of some axes: loads are those of the pose with the other motors at 0."""
    columns = lambda *logged: np.where(np.isin(np.arange(4), logged), np.zeros((5, 1)), np.nan)
    log = SimpleNamespace(joints={"theta": columns(1), "q": columns(1, 3)})
    assert list(axes_not_logged(log)) == [0, 2]
    assert list(axes_not_logged(SimpleNamespace(joints={"theta": columns(0, 1, 2, 3)}))) == []
