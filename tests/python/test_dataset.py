"""The reader: every valid table comes back as it was written, every single fault is refused by its name."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from exactarm.data.dataset import Dataset, read_dataset, write_dataset
from exactarm.errors import InputError
from exactarm.files.table import write_table
from exactarm.robot.robot import Joint, Robot
from exactarm.robot_file import load_robot

AXES = 3
GEARED = Robot("geared", tuple(Joint(ratio=50.0) for _ in range(AXES)))
DIRECT = Robot("direct", tuple(Joint() for _ in range(AXES)))

many = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
# within what a device measures (columns.MOST), for every quantity
numbers = st.floats(-1e4, 1e4, allow_nan=False)


def poses(rows: int = 8, seed: int = 1) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    table = {f"q_{i}_rad": random.normal(size=rows) for i in (1, 2, 3)}
    return table | {f"{name}_m": random.normal(size=rows) for name in "xyz"}


def motion(rows: int = 20, seed: int = 2) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    table = {"time_s": 0.01 * np.arange(rows)} | {f"theta_{i}_rad": random.normal(size=rows)
                                                  for i in (1, 2, 3)}
    return table | {f"tau_{i}_Nm": random.normal(size=rows) for i in (1, 2, 3)}


def write(path, table):
    write_table(path, table)
    return path


def refusal(path, robot=DIRECT, **options) -> InputError:
    with pytest.raises(InputError) as caught:
        read_dataset(path, robot, **options)
    assert "\n" not in str(caught.value)
    return caught.value


# -- round trip --------------------------------------------------------------------------------------
@st.composite
def datasets(draw) -> Dataset:
    rows = draw(st.integers(3, 12))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    column = lambda: np.array(draw(st.lists(numbers, min_size=rows, max_size=rows)))
    joints = {"q": np.stack([column() for _ in range(AXES)], 1)}
    optional = {"position": random.normal(size=(rows, 3)) * 10.0 ** draw(st.integers(-6, 5))}
    if draw(st.booleans()):
        optional["rotation"] = Rotation.random(rows, random_state=draw(st.integers(0, 2**31))).as_matrix()
    if draw(st.booleans()):
        joints["approach"] = random.integers(-1, 2, (rows, AXES)).astype(float)
    if draw(st.booleans()):
        joints["tau"] = random.normal(size=(rows, AXES)) * np.array([1.0, np.nan, 1.0])
    if draw(st.booleans()):
        optional["visit"] = random.integers(0, 5, rows)
    if draw(st.booleans()):
        optional["identification"] = random.random(rows) < 0.5
    if draw(st.booleans()):
        optional["covariates"] = {"temperature_degC": column(), "payload kg": column()}
    optional["session"], optional["run"] = random.integers(1, 4, rows), random.integers(1, 4, rows)
    return Dataset.of_arrays("poses", joints, **optional)


@many
@given(dataset=datasets(), ending=st.sampled_from([".csv", ".parquet"]))
@pytest.mark.slow
def test_what_is_written_comes_back(tmp_path, dataset, ending):
    path = tmp_path / f"data{ending}"
    write_dataset(path, dataset, DIRECT)
    back = read_dataset(path, DIRECT)
    assert back.kinds == ("poses",) and back.sources[0].rows == len(dataset)
    assert back.joints.keys() == dataset.joints.keys()
    for name, values in dataset.joints.items():
        np.testing.assert_array_equal(back.joints[name], values)
    for name in ("position", "session", "run", "visit", "identification"):
        np.testing.assert_array_equal(getattr(back, name), getattr(dataset, name))
    assert back.covariates.keys() == dataset.covariates.keys()
    for name, values in dataset.covariates.items():
        np.testing.assert_array_equal(back.covariates[name], values)
    if dataset.rotation is None:
        assert back.rotation is None
    else:
        np.testing.assert_allclose(back.rotation, dataset.rotation, atol=1e-15)


def test_units_become_si(tmp_path):
    table = {"q_1_deg": [180.0], "q_2_rad": [1.0], "q_3_deg": [-90.0], "x_mm": [1.0], "y_m": [2.0],
             "z_mm": [3000.0]}
    table |= {"rx_deg": [0.0], "ry_deg": [0.0], "rz_deg": [90.0]}
    data = read_dataset(write(tmp_path / "a.csv", table), DIRECT)
    np.testing.assert_allclose(data.joints["q"], [[np.pi, 1.0, -np.pi / 2]], rtol=1e-15)
    np.testing.assert_allclose(data.position, [[0.001, 2.0, 3.0]], rtol=1e-15)
    np.testing.assert_allclose(data.rotation[0] @ [1, 0, 0], [0, 1, 0], atol=1e-15)


def test_prismatic_axis_reads_a_length(tmp_path):
    robot = Robot("gantry", (Joint(type="prismatic"), Joint(), Joint()))
    table = poses()
    table["q_1_mm"] = table.pop("q_1_rad")
    data = read_dataset(write(tmp_path / "a.csv", table), robot)
    np.testing.assert_allclose(data.joints["q"][:, 0], 1e-3 * table["q_1_mm"])
    assert refusal(write(tmp_path / "b.csv", poses()), robot).column == "q_1_rad"


# -- kinds -------------------------------------------------------------------------------------------
def series(**columns) -> dict[str, np.ndarray]:
    return motion() | {name: np.zeros(20) for name in columns.get("more", ())}


@pytest.mark.parametrize(
    "table, kinds",
    [
        (poses(), ("poses",)),
        (poses() | {"time_s": np.arange(8) * 30.0}, ("poses",)),
        (poses() | {"time_s": np.arange(8)[::-1] * 0.01}, ("poses",)),
        (poses() | {"time_s": np.arange(8) * 0.01}, ("tracked_motion",)),
        (poses() | {"time_s": np.arange(8) * 0.01, "visit": np.arange(8)}, ("poses",)),
        (motion(), ("motion",)),
        (series(more=["q_2_rad"]), ("gear_run", "motion")),
        (series(more=["gyro_x_deg_s", "gyro_y_deg_s", "gyro_z_deg_s"]), ("gear_run", "motion")),
        (series(more=["x_mm", "y_mm", "z_mm"]), ("motion", "tracked_motion")),
    ],
)
def test_kind_follows_from_the_columns(tmp_path, table, kinds):
    data = read_dataset(write(tmp_path / "a.csv", table), GEARED if "theta_1_rad" in table else DIRECT)
    assert data.kinds == kinds and data.kind == kinds[0]


def test_kind_given_overrides(tmp_path):
    path = write(tmp_path / "a.csv", poses() | {"time_s": np.arange(8) * 0.01})
    assert read_dataset(path, DIRECT, kind="poses").kinds == ("poses",)
    assert "tau" in str(refusal(path, kind="motion"))
    assert "expected one of" in str(refusal(path, kind="pose"))


# -- refusals ----------------------------------------------------------------------------------------
@many
@given(
    column=st.sampled_from([*poses()]),
    row=st.integers(1, 8),
    cell=st.sampled_from(["", " ", "abc", "1,5", "nan", "inf", "-Infinity", "1_0", "0x1", "--1", "NA",
                          "1.0.0", "1e300"]),
)
def test_any_bad_cell_is_refused_by_file_row_and_column(tmp_path, column, row, cell):
    path = write(tmp_path / "a.csv", poses())
    lines = path.read_text().splitlines()
    cells = lines[row].split(",")
    cells[[*poses()].index(column)] = f'"{cell}"' if "," in cell else cell
    lines[row] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    error = refusal(path)
    assert (error.file, error.row, error.column) == (str(path), row, column)
    assert "number" in error.message


@many
@given(row=st.integers(1, 8), change=st.sampled_from([-2, -1, 1, 3]))
def test_a_row_of_another_length_is_refused(tmp_path, row, change):
    path = write(tmp_path / "a.csv", poses())
    lines = path.read_text().splitlines()
    lines[row] = ",".join((lines[row].split(",") + ["1"] * 3)[: 6 + change])
    path.write_text("\n".join(lines))
    error = refusal(path)
    assert error.row == row and "expected 6" in error.message and str(path) in str(error)


@pytest.mark.parametrize("column", [*poses()])
def test_a_missing_column_is_refused(tmp_path, column):
    table = poses()
    del table[column]
    error = refusal(write(tmp_path / "a.csv", table))
    assert column.split("_")[0] in error.column and "expected" in error.message


RENAMED = [
    ("q_1_rad", "q_1_grad", "unknown unit 'grad'; expected q_1_rad or q_1_deg"),
    ("q_1_rad", "q_1", "no unit; expected q_1_rad or q_1_deg"),
    ("q_1_rad", "q_rad", "no axis number; expected a name like q_1_rad"),
    ("q_1_rad", "q_0_rad", "axes counted from 1"),
    ("q_1_rad", "q_4_rad", "robot direct has 3 axes"),
    ("q_1_rad", "q_2_rad", "expected each column once"),
    ("q_1_rad", "q_2_deg", "the same quantity"),
    ("q_1_rad", "theta_1_rad", "no gear ratio for axis 1"),
    ("q_1_rad", "", "column 1 has no name"),
    ("x_m", "x_cm", "unknown unit 'cm'; expected x_m or x_mm"),
    ("x_m", "x_mm", None),
    ("x_m", "position", "expected it beside column y_m"),
]


@pytest.mark.parametrize("old, new, words", RENAMED)
def test_a_name_that_does_not_fit_is_refused(tmp_path, old, new, words):
    path = write(tmp_path / "a.csv", poses())
    path.write_text(re.sub(rf"(^|,){old}(,|\n)", rf"\g<1>{new}\g<2>", path.read_text(), count=1))
    if words is None:
        assert read_dataset(path, DIRECT).kind == "poses"
    else:
        assert words in str(refusal(path)) and str(path) in str(refusal(path))


@pytest.mark.parametrize(
    "content, words",
    [
        ("", "is empty"),
        ("\n\n", "is empty"),
        ("q_1_rad,x_m\n", "no data rows"),
        ("q_1_rad,x_m", "no data rows"),
        ("1.0,2.0\n3.0,4.0\n", "first row is numbers"),
        ("\0\1\2", "no text"),
    ],
)
def test_a_file_that_is_no_table_is_refused(tmp_path, content, words):
    path = tmp_path / "a.csv"
    path.write_text(content)
    assert words in str(refusal(path)) and str(path) in str(refusal(path))


def test_a_path_that_cannot_be_read_is_refused(tmp_path):
    assert "no such file" in str(refusal(tmp_path / "nothing.csv"))
    assert "directory" in str(refusal(tmp_path))
    (tmp_path / "a.parquet").write_text("no parquet")
    assert "no Parquet file" in str(refusal(tmp_path / "a.parquet"))
    (tmp_path / "b.csv").write_bytes(b"q_1_rad,x_m\n1,2\n1,\xff\n")
    error = refusal(tmp_path / "b.csv")
    assert error.row == 2 and "UTF-8" in error.message


def test_what_other_programs_write_is_read(tmp_path):
    path = write(tmp_path / "a.csv", poses())
    plain = read_dataset(path, DIRECT)
    text = path.read_text()
    header, rest = text.split("\n", 1)
    spaced = ", ".join(f'"{name}"' if name == "q_2_rad" else name
                       for name in header.split(",")).replace(' "', '"')
    variants = {
        "bom": b"\xef\xbb\xbf" + text.encode(),
        "windows": text.replace("\n", "\r\n").encode(),
        "spaces": f"{spaced}\n{rest}".replace(",", " ,").encode(),
        "no last line end": text.rstrip("\n").encode(),
        "blank lines": f"{header}\n\n{rest}\n\n".encode(),
    }
    for name, content in variants.items():
        path.write_bytes(content)
        data = read_dataset(path, DIRECT)
        np.testing.assert_array_equal(data.position, plain.position, err_msg=name)
        np.testing.assert_array_equal(data.joints["q"], plain.joints["q"], err_msg=name)


def test_parquet_columns_of_text_and_holes_are_refused(tmp_path):
    table = poses() | {"note": ["a"] * 8}
    assert refusal(write(tmp_path / "a.parquet", table)).column == "note"
    table = poses() | {"q_2_rad": np.array([0.0, np.nan] + [1.0] * 6)}
    error = refusal(write(tmp_path / "b.parquet", table))
    assert (error.row, error.column) == (2, "q_2_rad")


@pytest.mark.parametrize(
    "name, values, words",
    [
        ("set", ["identification"] * 7 + ["test"], "identification or validation"),
        ("approach_2", [0, 1, -1, 0, 0, 0, 0, 2], "-1, 0 or 1"),
        ("session", [1] * 7 + [1.5], "whole number"),
        ("visit", [1] * 7 + [0.1], "whole number"),
        ("run", [1] * 7 + [1e29], "whole number"),
    ],
)
def test_a_mark_that_is_none_is_refused(tmp_path, name, values, words):
    error = refusal(write(tmp_path / "a.csv", poses() | {name: np.array(values)}))
    assert (error.row, error.column) == (8, name) and words in error.message


def test_orientation_must_be_one_and_whole(tmp_path):
    quaternion = {"qw": np.ones(8), "qx": np.zeros(8), "qy": np.zeros(8), "qz": np.zeros(8)}
    assert read_dataset(write(tmp_path / "a.csv", poses() | quaternion), DIRECT).rotation.shape == (8, 3, 3)
    half = poses() | {"qw": np.ones(8)}
    assert refusal(write(tmp_path / "b.csv", half)).column == "qx"
    both = poses() | quaternion | {f"{name}_rad": np.zeros(8) for name in ("rx", "ry", "rz")}
    assert "one of the two" in str(refusal(write(tmp_path / "c.csv", both)))
    quaternion["qw"] = np.array([1.0] * 4 + [2.0] + [1.0] * 3)
    error = refusal(write(tmp_path / "d.csv", poses() | quaternion))
    assert error.row == 5 and "norm 2" in error.message


def test_time_of_a_series_must_rise_within_each_run(tmp_path):
    table = motion()
    table["time_s"][12] = table["time_s"][11]
    error = refusal(write(tmp_path / "a.csv", table), GEARED)
    assert (error.row, error.column) == (13, "time_s")
    table = motion() | {"run": np.repeat([1, 2], 10)}
    table["time_s"][10:] -= table["time_s"][10]
    assert read_dataset(write(tmp_path / "b.csv", table), GEARED).kinds == ("motion",)
    del table["time_s"]
    assert refusal(write(tmp_path / "c.csv", table), GEARED).column == "time_s"


def test_robot_without_geometry_takes_no_poses(tmp_path):
    robot = Robot("drives", DIRECT.joints, has_geometry=False)
    assert "no geometry" in str(refusal(write(tmp_path / "a.csv", poses()), robot))


# -- several files -----------------------------------------------------------------------------------
def test_files_without_session_get_their_own(tmp_path):
    paths = [write(tmp_path / f"{i}.csv", poses(seed=i)) for i in (1, 2)]
    data = read_dataset(paths, DIRECT)
    np.testing.assert_array_equal(data.session, np.repeat([1, 2], 8))
    np.testing.assert_array_equal(data.run, np.repeat([1, 2], 8))
    np.testing.assert_array_equal(data.row, np.tile(np.arange(1, 9), 2))
    assert [source.path for source in data.sources] == [str(path) for path in paths]


def test_equal_sessions_are_shared_and_runs_stay_distinct(tmp_path):
    marks = {"session": np.full(20, 7), "run": np.repeat([3, 1], 10)}
    paths = [write(tmp_path / f"{i}.csv", motion(seed=i) | marks) for i in (1, 2)]
    data = read_dataset(paths, GEARED)
    assert set(data.session) == {7}
    np.testing.assert_array_equal(data.run, np.repeat([1, 2, 3, 4], 10))


def test_files_with_other_columns_are_refused(tmp_path):
    one, other = write(tmp_path / "1.csv", poses()), write(tmp_path / "2.csv",
                                                           poses() | {"load_kg": np.ones(8)})
    for paths in ([one, other], [other, one]):
        error = refusal(paths)
        assert error.column == "load_kg" and error.file == str(one)


def test_a_file_given_twice_is_refused(tmp_path):
    one, copy = write(tmp_path / "1.csv", poses()), write(tmp_path / "2.csv", poses())
    for paths in ([one, one], [one, copy]):
        assert "expected each file once" in str(refusal(paths))


# -- selection and split -----------------------------------------------------------------------------
def test_select_takes_rows_of_everything(tmp_path):
    data = read_dataset(write(tmp_path / "a.csv", poses() | {"load_kg": np.arange(8.0)}), DIRECT)
    some = data.select(data.covariates["load_kg"] > 4)
    assert len(some) == 3 and some.position.shape == (3, 3)
    np.testing.assert_array_equal(some.row, [6, 7, 8])
    np.testing.assert_array_equal(some.joints["q"], data.joints["q"][5:])


def test_split_follows_the_column_set(tmp_path):
    chosen = np.where(np.arange(8) % 3 == 0, "identification", "validation")
    data = read_dataset(write(tmp_path / "a.csv", poses() | {"set": chosen}), DIRECT)
    np.testing.assert_array_equal(data.split(1), chosen == "identification")
    assert "`set`" in data.split_rule()


def test_a_motor_angle_of_an_axis_without_a_gear_is_written_as_its_joint_angle(tmp_path):
    robot = Robot("two", (Joint(q_offset=0.5), Joint(ratio=100.0)))
    data = Dataset.of_arrays("poses", {"theta": np.array([[0.1, 20.0], [0.2, 30.0]])},
                             position=np.zeros((2, 3)))
    write_dataset(tmp_path / "poses.csv", data, robot)
    back = read_dataset(tmp_path / "poses.csv", robot)
    np.testing.assert_allclose(back.joints["q"][:, 0], [0.6, 0.7])
    np.testing.assert_allclose(back.joints["theta"][:, 1], [20.0, 30.0])


def test_columns_of_other_names_are_told_how_to_get_ours(tmp_path):
    """A log as a controller writes it: all its columns were covariates, and nothing said what to do."""
    (tmp_path / "log.csv").write_text("J1 (deg),J2 (deg),X [mm],Y [mm],Z [mm]\n1,2,3,4,5\n")
    with pytest.raises(InputError, match=r"J1 \(deg\), J2 \(deg\), X \[mm\], ... stand for is told by --map"):
        read_dataset(tmp_path / "log.csv", load_robot("ur10"))
