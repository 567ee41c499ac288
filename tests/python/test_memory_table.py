"""Tables in memory are read as the files with the same columns are."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import exactarm as ea
from exactarm.commands.certify import _followed
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError

ROWS = 40
COLUMNS = {f"q_{i}_deg": np.linspace(-50.0, 50.0, ROWS) * (-1) ** i + i for i in range(1, 7)}
COLUMNS |= {f"{name}_mm": 400.0 + np.arange(ROWS) * k for k, name in enumerate("xyz", start=1)}


@pytest.mark.parametrize("of", [dict, pd.DataFrame, pa.table], ids=["dict", "DataFrame", "Arrow"])
def test_is_read_as_its_file_is(of, tmp_path):
    pd.DataFrame(COLUMNS).to_csv(tmp_path / "poses.csv", index=False)
    file, table = ea.read(tmp_path / "poses.csv", "ur10"), ea.read(of(COLUMNS), "ur10")
    assert np.array_equal(table.position, file.position)
    assert np.array_equal(table.joints["q"], file.joints["q"])
    source = table.sources[0]
    assert source.path == "table 1 in memory" and source.rows == ROWS and len(source.sha256) == 64
    again = ea.read(of(COLUMNS | {"x_mm": COLUMNS["x_mm"] + 1e-9}), "ur10")
    assert again.sources[0].sha256 != source.sha256


def test_stands_in_a_list_beside_a_file(tmp_path):
    pd.DataFrame(COLUMNS).to_csv(tmp_path / "poses.csv", index=False)
    other = {name: values + 0.5 for name, values in COLUMNS.items()}
    data = ea.read([tmp_path / "poses.csv", pd.DataFrame(other)], "ur10")
    assert len(data) == 2 * ROWS and {s.path for s in data.sources} == {
        str(tmp_path / "poses.csv"), "table 2 in memory"}


def test_a_command_says_what_it_read():
    frame = pd.read_parquet(ea.example("ur10/series_B")) if str(
        ea.example("ur10/series_B")).endswith(".parquet") else pd.read_csv(ea.example("ur10/series_B"))
    told, file = (ea.evaluate("ur10", data) for data in (frame, ea.example("ur10/series_B")))
    assert told.json["error"] == file.json["error"]
    assert told.asked.files[0].path == "table 1 in memory"
    assert told.asked.line == f"exactarm.evaluate('ur10', table_1, seed={DEFAULT_SEED})"


REFUSED = {
    "table 1 in memory, row 3, column x_mm: nan; expected a finite number":
        {"x_mm": np.where(np.arange(ROWS) == 2, np.nan, 1.0)},
    "table 1 in memory, row 2, column y_mm: 'wide'; expected a number": {"y_mm": [1.0, "wide"] + [2.0] * 38},
    "table 1 in memory, row 1, column y_mm: empty cell; expected a number": {"y_mm": [None] + ["2.0"] * 39},
    "table 1 in memory, column z_mm: 3 rows; expected 40 as in column q_1_deg": {"z_mm": [1.0, 2.0, 3.0]},
    "table 1 in memory, column z_mm: is no row of cells": {"z_mm": np.zeros((ROWS, 2))},
    "table 1 in memory: name 7 is no text": {7: np.zeros(ROWS)},
}


@pytest.mark.parametrize("said", REFUSED)
def test_is_refused_as_a_file_is(said):
    with pytest.raises(InputError, match=said):
        ea.read(COLUMNS | REFUSED[said], "ur10")


def test_a_name_given_twice_is_refused():
    frame = pd.DataFrame(COLUMNS)
    with pytest.raises(InputError, match="column x_mm: name given twice"):
        ea.read(pd.concat([frame, frame[["x_mm"]]], axis=1), "ur10")


def test_no_rows_are_refused():
    with pytest.raises(InputError, match="table 1 in memory: no data rows"):
        ea.read(pd.DataFrame(COLUMNS).head(0), "ur10")


def test_a_column_name_does_not_hide_a_table():
    frame = pd.DataFrame(COLUMNS | {"name": np.arange(ROWS)})
    assert ea.read(frame, "ur10").covariates["name"][-1] == ROWS - 1


def test_lists_within_lists_are_refused():
    with pytest.raises(InputError, match="data given as list; expected files, tables"):
        ea.read([[pd.DataFrame(COLUMNS)]], "ur10")


def test_a_followed_path_in_memory_is_one_table():
    arm = ea.load_robot("ur10")
    time = {"time_s": 0.01 * np.arange(ROWS)}
    path = _followed(pd.DataFrame(time | COLUMNS), arm)
    assert len(path) == 1 and len(path[0]) == ROWS
