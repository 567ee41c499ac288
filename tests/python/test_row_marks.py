"""Rows are known again in another format, with other units, columns, line ends; a part of them, too."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exactarm.data.dataset import read_dataset
from exactarm.data.row_marks import ON_RECORD, RowMarks
from exactarm.files.table import write_table
from exactarm.robot_file import load_robot
from exactarm.verify.held_out import choose_rows

ARM = load_robot("ur10")
ROWS = 200


@pytest.fixture
def rows():
    rng = np.random.default_rng(3)
    q, place = rng.uniform(-2.0, 2.0, (ROWS, 6)), np.round(rng.uniform(-900.0, 900.0, (ROWS, 3)), 4)
    columns = {f"q_{i + 1}_rad": q[:, i] for i in range(6)}
    return columns | {f"{a}_mm": place[:, i] for i, a in enumerate("xyz")}


def text(columns, separator=",", newline="\n", decimal="."):
    lines = [separator.join(columns)] + [
        separator.join(repr(float(value)) for value in row) for row in zip(*columns.values())]
    return newline.join(lines).replace(".", decimal) + newline


def fitted(data):
    """The arm with a record of the data."""
    record = {"command": "calibrate", "seed": 4, "data": [source.entry for source in data.sources]}
    return replace(ARM, record=record)


def in_metres(columns):
    return {name.replace("_mm", "_m"): 1e-3 * v if "_mm" in name else v for name, v in columns.items()}


FORMS = {
    "crlf": lambda folder, rows: _write(folder / "b.csv", text(rows, newline="\r\n")),
    "parquet": lambda folder, rows: _table(folder / "b.parquet", rows),
    "metres": lambda folder, rows: _table(folder / "b.parquet", in_metres(rows)),
    "more columns": lambda folder, rows: _write(folder / "b.csv", text(
        {"note_1_Nm_x": np.arange(ROWS) * 1.0} | dict(reversed(rows.items())))),
    "decimal comma": lambda folder, rows: _write(folder / "b.csv", text(rows, ";", decimal=",")),
}


def _write(path: Path, content: str) -> Path:
    path.write_bytes(content.encode())
    return path


def _table(path: Path, columns) -> Path:
    write_table(path, columns)
    return path


@pytest.mark.parametrize("form", FORMS)
def test_the_same_rows_in_another_form_are_split_as_they_were_when_they_were_fitted(form, rows, tmp_path):
    data = read_dataset(_write(tmp_path / "a.csv", text(rows)), ARM)
    other = read_dataset(FORMS[form](tmp_path, rows), ARM)
    assert other.fingerprint != data.fingerprint
    found = choose_rows((fitted(data),), other)
    np.testing.assert_array_equal(found.judged, ~data.split(4))
    assert found.unseen and not found.warnings


@pytest.mark.parametrize("change", ["reversed", "a part", "among others"])
def test_fitted_rows_in_another_selection_are_not_called_unseen(change, rows, tmp_path):
    data = read_dataset(_write(tmp_path / "a.csv", text(rows)), ARM)
    rng = np.random.default_rng(5)
    changed = {
        "reversed": lambda v: v[::-1], "a part": lambda v: v[40:100],
        "among others": lambda v: np.append(v[:60], rng.uniform(-2.0, 2.0, 300)),
    }[change]
    other = read_dataset(_table(tmp_path / "b.parquet", {k: changed(v) for k, v in rows.items()}), ARM)
    found = choose_rows((fitted(data),), other)
    assert not found.unseen and "count as fitted" in found.warnings[0]


def test_poses_measured_again_are_other_rows(rows, tmp_path):
    """With a noise of 5 um a coordinate, the same poses are data that nothing was fitted to."""
    data = read_dataset(_write(tmp_path / "a.csv", text(rows)), ARM)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        again = {k: v + 5e-3 * rng.normal(size=ROWS) if "_mm" in k else v for k, v in rows.items()}
        path = tmp_path / f"{seed}.parquet"
        assert choose_rows((fitted(data),), read_dataset(_table(path, again), ARM)).unseen


def test_what_a_robot_file_keeps_is_short_and_damaged_marks_are_none():
    marks = RowMarks.of(np.random.default_rng(1).uniform(-1.0, 1.0, (5000, 3)))
    entry = marks.entry()
    assert len(entry["marks"]) == 8 * ON_RECORD and marks.same_rows(entry) and marks.some_rows(entry)
    for damaged in ("no numbers", 5, None, ""):
        assert not marks.some_rows({"marks": damaged})
    assert RowMarks.of(None).entry() == {} and not RowMarks().same_rows({"content": ""})
