"""Tables in memory are read as the files with the same columns are."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import exactarm as ea
from exactarm.commands.certify import _followed
from exactarm.data.dataset import Dataset
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
    "table 1 in memory, row index 2, column x_mm: nan; expected a finite number":
        {"x_mm": np.where(np.arange(ROWS) == 2, np.nan, 1.0)},
    "table 1 in memory, row index 1, column y_mm: 'wide'; expected a number":
        {"y_mm": [1.0, "wide"] + [2.0] * 38},
    "table 1 in memory, row index 0, column y_mm: empty cell; expected a number":
        {"y_mm": [None] + ["2.0"] * 39},
    "table 1 in memory, column z_mm: 3 rows; expected 40 as in column q_1_deg": {"z_mm": [1.0, 2.0, 3.0]},
    "table 1 in memory, column z_mm: is no row of cells": {"z_mm": np.zeros((ROWS, 2))},
    "table 1 in memory: name 7 is no text": {7: np.zeros(ROWS)},
}


@pytest.mark.parametrize("said", REFUSED)
def test_is_refused_as_a_file_is(said):
    with pytest.raises(InputError, match=said):
        ea.read(COLUMNS | REFUSED[said], "ur10")


NAMED = {"after every second": np.arange(ROWS) * 2 + 100, "by name": [f"p{k}" for k in range(ROWS)]}


@pytest.mark.parametrize("index, told", [(None, "6"), *zip(NAMED.values(), ("112", "'p6'"))],
                         ids=["none", *NAMED])
def test_a_row_is_named_by_the_index_of_the_frame(index, told):
    """As `frame.loc` finds it, wherever the row is refused."""
    wrong = pd.DataFrame(COLUMNS | {"x_mm": np.where(np.arange(ROWS) == 6, np.nan, 1.0)}, index=index)
    place = f"table 1 in memory, row index {told}"
    with pytest.raises(InputError, match=f"{place}, column x_mm: nan"):
        ea.read(wrong, "ur10")
    joints = pd.DataFrame({name: values for name, values in COLUMNS.items() if name.startswith("q")}, index)
    far = joints.assign(q_2_deg=np.where(np.arange(ROWS) == 6, 400.0, 1.0))
    with pytest.raises(InputError, match=f"{place}: axis 2 .*limit"):
        ea.compensate("ur10", far)
    kept = ea.compensate("ur10", far, keep_refused=True)
    assert kept.to_dataframe("compensation.csv").query("name.str.contains('index')").shape[0] == ROWS
    assert f"row index {told}" in kept.summary() and "line 8" not in kept.summary()
    log = joints.assign(name=["twice" if k in (2, 6) else f"n{k}" for k in range(ROWS)])
    points = {"name": log.name.to_numpy()} | {f"{axis} [mm]": COLUMNS[f"{axis}_mm"] for axis in "xyz"}
    with pytest.raises(InputError, match=f"table joints in memory, row index {told}, column name: 'twice' "):
        ea.merge("ur10", log, {**points, "name": [f"n{k}" for k in range(ROWS)]})
    with pytest.raises(InputError, match=f"table points in memory, row index {told}: point 'twice' is on "
                                         "row index .* too"):
        ea.merge("ur10", joints.assign(name=[f"n{k}" for k in range(ROWS)]), pd.DataFrame(points, index))


def test_rows_of_a_file_keep_their_numbers(tmp_path):
    pd.DataFrame(COLUMNS | {"x_mm": np.where(np.arange(ROWS) == 6, np.nan, 1.0)}).to_csv(
        tmp_path / "poses.csv", na_rep="nan", index=False)
    with pytest.raises(InputError, match="poses.csv, row 7, column x_mm"):
        ea.read(tmp_path / "poses.csv", "ur10")


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
    poses = Dataset.of_arrays("poses", {"q": np.zeros((1, 6))})
    path = _followed(pd.DataFrame(time | COLUMNS), arm, poses)
    assert len(path) == 1 and len(path[0]) == ROWS


@pytest.fixture(scope="module")
def measured():
    """Poses of a virtual arm: joint angles and measured positions, with names and without."""
    table = ea.simulate("ur10", count=30, noise=1e-5, counts=0, visits=1, frames="declared").to_dataframe()
    keep = [f"q_{i}_rad" for i in range(1, 7)]
    return table[[*keep, "x_m", "y_m", "z_m"]], table[keep].assign(name=[f"p{i}" for i in range(len(table))])


def points_of(measured):
    poses, named = measured
    return pd.DataFrame({"name": named.name} | {f"{axis} [mm]": 1e3 * poses[f"{axis}_m"] for axis in "xyz"})


TABLES = {  # (function of tables, the tables), and the call as it is told
    "simulate('ur10', table_1, measure='poses'": (
        lambda q: ea.simulate("ur10", q, measure="poses"), lambda m: [m[1].drop(columns="name")]),
    "identifiable('ur10', table_1": (lambda poses: ea.identifiable("ur10", poses), lambda m: [m[0]]),
    "identifiable('ur10', [table_1, table_2]": (
        lambda one, two: ea.identifiable("ur10", [one, two]), lambda m: [m[0][:15], m[0][15:]]),
    "evaluate('ur10', table_1, sessions=table_sessions, at=table_at": (
        lambda poses, sessions, at: ea.evaluate("ur10", poses, sessions=sessions, at=at),
        lambda m: [m[0], pd.DataFrame({"session": [1], "payload_kg": [2.0]}), m[0][:5]]),
    "merge('ur10', table_joints, table_points": (
        lambda joints, points: ea.merge("ur10", joints, points), lambda m: [m[1], points_of(m)]),
}


@pytest.mark.parametrize("told", TABLES)
@pytest.mark.slow
def test_a_command_gives_what_it_gives_with_files(told, measured, tmp_path):
    call, tables = TABLES[told][0], TABLES[told][1](measured)
    paths = [tmp_path / f"table{i}.csv" for i in range(len(tables))]
    for path, table in zip(paths, tables):
        table.to_csv(path, index=False)
    one, other = call(*tables), call(*paths)
    assert one.asked.line == f"exactarm.{told}, seed={DEFAULT_SEED})"
    assert dict(one) == dict(other)
    for name in one.tables:
        mine, files = (result.to_dataframe(name) for result in (one, other))
        pd.testing.assert_frame_equal(mine.drop(columns="file", errors="ignore"),
                                      files.drop(columns="file", errors="ignore"), check_exact=True)
    one.save(tmp_path / "out")
    assert "in memory" in (tmp_path / "out/result.json").read_text()


def test_targets_are_corrected_and_come_back_as_a_table(measured, tmp_path):
    arm = ea.load_robot("ur10").with_controller_frames.with_joint(1, a=-0.63)
    frames, targets = measured[0], measured[1].assign(speed=np.arange(30))
    targets.to_csv(tmp_path / "targets.csv", index=False)
    frames.to_csv(tmp_path / "frames.csv", index=False)
    one = ea.compensate(arm, targets, frames=frames, keep_refused=True)
    other = ea.compensate(arm, tmp_path / "targets.csv", frames=tmp_path / "frames.csv", keep_refused=True)
    assert one.asked.line.endswith(f"(robot, table_1, frames=table_frames, keep_refused=True, "
                                   f"seed={DEFAULT_SEED})")
    written = one.to_dataframe("table_1")
    other.save(tmp_path / "out")
    pd.testing.assert_frame_equal(written, pd.read_csv(tmp_path / "out/targets.csv"), rtol=1e-15)
    assert (written[[f"q_{i}_rad" for i in range(1, 7)]] != targets[[f"q_{i}_rad" for i in range(1, 7)]]).any(
        axis=None)
    one.save(tmp_path / "memory")
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "memory/table_1.parquet"), written)
    assert one["correction"] == other["correction"] and one["correction"]["n"] > 20


def test_rows_in_between_of_a_series_are_put_into_a_table():
    time = np.linspace(0.0, 1.0, 5)
    series = {"time_s": time} | {f"q_{i}_rad": 0.3 * i * time for i in range(1, 7)}
    arm = ea.load_robot("ur10").with_controller_frames.with_joint(1, a=-0.63)
    one = ea.compensate(arm, series, tolerance_mm=0.001, keep_refused=True).to_dataframe("table_1")
    assert len(one) > 5 and one.time_s.is_monotonic_increasing and set(time) <= set(one.time_s)


def test_a_certificate_names_the_path_in_memory():
    with pytest.raises(InputError, match="table path_1 in memory: no data rows"):
        ea.certify("ur10", "ur10/series_B", path=pd.DataFrame(COLUMNS).head(0))


def test_a_manifest_in_memory_is_run(tmp_path):
    jobs = {"name": ["a", "b"], "command": ["identifiable"] * 2, "robot": ["ur10"] * 2, "count": [20, 30]}
    pd.DataFrame(jobs).to_csv(tmp_path / "jobs.csv", index=False)
    made = ea.batch(pd.DataFrame(jobs), tmp_path / "memory")
    assert made["done"] == 2 and made.asked.line.startswith("exactarm.batch(table_manifest, ")
    assert ea.batch(tmp_path / "jobs.csv", tmp_path / "memory")["kept"] == 2
    with pytest.raises(InputError, match="table manifest in memory, row index 0, column command: 'calibrte'"):
        ea.batch({"command": ["calibrte"], "robot": ["ur10"]}, tmp_path / "wrong")
    with pytest.raises(InputError, match="manifest with int; expected a file, a table, or a mapping a row"):
        ea.batch([1], tmp_path / "wrong")


NO_TABLE = {
    "a path file": lambda table: ea.plan("ur10", table),
    "path files, line or spiral": lambda table: ea.study("racer-7-1.4", table),
    "a draft with entries": lambda table: ea.accept(table),
    "a robot, its file": lambda table: ea.calibrate(table, "ur10/series_B"),
    "a fixture or its file": lambda table: ea.identifiable("ur10", fixture=table),
    "result.json of `exactarm diagnose`": lambda table: ea.design("ur10", diagnosis=table),
    "a robot, its file or": lambda table: ea.compensate("ur10", COLUMNS, nominal=table),
    "what a certificate says of arm": lambda table: ea.certify("ur10", "ur10/series_B", about=table),
    "a path file (.toml)": lambda table: ea.simulate("racer-7-1.4", compare=table),
    "a URDF or xacro": lambda table: ea.export("ur10", source=table, format="urdf"),
}


@pytest.mark.parametrize("expected", NO_TABLE)
def test_where_no_table_is_meant_one_is_refused_in_a_line(expected):
    with pytest.raises(InputError) as refused:
        NO_TABLE[expected](pd.DataFrame(COLUMNS))
    said = str(refused.value)
    assert "DataFrame" in said and f"; expected {expected}" in said and "\n" not in said


def test_a_column_that_was_made_the_index_is_read_all_the_same():
    sessions = np.repeat([1, 2], ROWS // 2)
    plain = pd.DataFrame(COLUMNS | {"session": sessions})
    assert np.array_equal(ea.read(plain.set_index("session"), "ur10").session, sessions)
    assert np.array_equal(ea.read(plain.rename_axis("row"), "ur10").session, sessions)
    lacking = plain.assign(x_mm=np.where(np.arange(ROWS) == 3, np.nan, plain["x_mm"])).set_index("session")
    with pytest.raises(InputError, match="row index 1"):  # its own name of that row, as loc has it
        ea.read(lacking, "ur10")
