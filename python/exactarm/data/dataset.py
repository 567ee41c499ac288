"""Measured data in memory: what CSV or Parquet files hold, in SI units, one row a sample.

    read_dataset(files, robot) -> Dataset         write_dataset(file, dataset)

Several files become one data set. Without a column `session` (`run`, `visit`) each file has its own
numbers; with it, equal sessions and visits in different files mean the same thing, and runs are numbered
anew so that they stay distinct. All files must hold the same quantities. They are read in the order of their
names (day2 before day10), however they are given.
N rows, n axes of the robot; angles in rad, lengths in m, time in s, torque in Nm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from exactarm.data.column_checks import check_size, check_values, check_vectors
from exactarm.data.columns import (
    ACCEL,
    CONTACTS,
    GYRO,
    PARTNER,
    PAYLOAD,
    PAYLOAD_CENTRE,
    PICTURE,
    PIXEL,
    POSITION,
    QUATERNION,
    ROTATION_VECTOR,
    TILT,
    Column,
    may_be_empty,
    parse_column,
    renamed,
)
from exactarm.data.copied_rows import without_copies
from exactarm.data.euler import TURNS, with_orientation
from exactarm.data.fixture import Fixture
from exactarm.data.held_samples import without_frozen, without_held
from exactarm.data.kinds import POSES, data_kinds, kind_of
from exactarm.data.kinds.base import check_joints, is_a_series
from exactarm.data.reflectors import with_target
from exactarm.data.row_marks import RowMarks
from exactarm.data.rows import NO_CONTACT, Rows, Source, by_name
from exactarm.data.sensor_rows import with_sensors
from exactarm.data.split import pose_split, run_split, split_rule
from exactarm.errors import InputError
from exactarm.files.memory_table import AnyFile, MemoryTable
from exactarm.files.table import Table, column_names, read_table, write_table
from exactarm.robot.robot import Robot

AnyFiles = AnyFile | Sequence[AnyFile]
_EPOCH_S = 1e8  # three years: nobody measures so long
ROBOT_SUFFIXES = (".toml", ".urdf", ".xacro")
QUATERNION_NORM_TOLERANCE = 0.01  # three decimals per component pass, a wrong column does not


@dataclass(frozen=True, eq=False, repr=False)
class Dataset(Rows):
    """Rows, and how they are divided into those that identify and those that judge."""

    def __repr__(self) -> str:
        """One line: how many rows of what, from where."""
        files = ", ".join(Path(source.path).name for source in self.sources)
        what = kind_of(self.kind).name.replace("_", " ")
        return f"<Dataset: {len(self)} rows, {what}, {self.axes} axes{f'; {files}' if files else ''}>"

    def split(self, seed: int, fraction: float = 0.7) -> np.ndarray:
        """(N,) bool: the rows to identify with; `split_rule` says in words how they were chosen."""
        if self.identification is not None:
            return self.identification
        split = pose_split if kind_of(self.kind).at_rest else run_split
        return split(self, np.random.default_rng(seed), fraction)

    def split_rule(self, fraction: float = 0.7) -> str:
        """One sentence: how `split` chooses."""
        return split_rule(self, fraction)


def read_dataset(paths: AnyFiles, robot: Robot,
                 kind: str | None = None, fixture: Fixture = Fixture(),
                 columns: Mapping[str, str] | None = None) -> Dataset:
    """One data set from files measured on `robot`. `kind` overrides what the columns say. columns: the files'
    names -> ours, as {"J1": "q_1_deg"}. The order in which several are given means nothing: they are read in
    that of their names. Raises InputError."""
    paths = _in_order(paths)
    if not paths:
        raise InputError("no data file given; expected at least one CSV or Parquet file")
    for path in paths:
        if Path(str(path)).suffix.lower() in ROBOT_SUFFIXES:
            raise InputError("a robot file among the data; expected one robot and what was measured on it; "
                             "an arm that it touches is declared in the fixture file: [partner] robot, and "
                             "columns partner_q_i", file=str(path))
    files = [_read_file(path, robot, columns) for path in paths]
    _check_files(files)
    dataset = replace(_join(files, robot), fixture=fixture)
    dataset = without_frozen(without_held(replace(dataset, **data_kinds(dataset, robot, kind))))
    return without_copies(dataset)


def _in_order(paths: AnyFiles) -> list[AnyFile]:
    return [paths] if isinstance(paths, (str, Path, MemoryTable)) else sorted(paths, key=by_name)


def _since_the_start(time: np.ndarray) -> np.ndarray:
    """Of a clock that counts from 1970 or so: a float of 1.8e9 s knows no less than 0.24 us, which rates
    of fast logs feel."""
    return time - np.floor(time.min()) if time.size and time.min() > _EPOCH_S else time


def read_planned_poses(paths: AnyFiles, robot: Robot) -> Dataset:
    """Poses that need not have been measured: a design, commands. As `read_dataset`, without x, y, z."""
    dataset = read_targets(paths, robot)
    check_joints(dataset, robot)
    return dataset


def read_targets(paths: AnyFiles, robot: Robot,
                 columns: Mapping[str, str] | None = None) -> Dataset:
    """Poses that are to be reached: joint angles, or x, y, z, or both. columns: as in `read_dataset`."""
    files = [_read_file(path, robot, columns) for path in _in_order(paths)]
    _check_files(files)
    return replace(_join(files, robot), kind=POSES.name, kinds=(POSES.name,))


def read_named_targets(path: AnyFile, robot: Robot,
                       columns: Mapping[str, str] | None = None) -> tuple[Dataset, list[str]]:
    """`read_targets` of one file, and its column `name`; empty where it has none. Other columns of words are
    left out."""
    try:
        file = _read_file(path, robot, columns, ("name",))
    except InputError:
        ours = renamed(column_names(path), columns or {}, str(path))
        words = [name for name in ours if parse_column(name, str(path)).quantity == "covariate"
                 and name not in (PAYLOAD, *PAYLOAD_CENTRE)]
        file = _read_file(path, robot, columns, ("name", *words))
    _check_files([file])
    data = replace(_join([file], robot), kind=POSES.name, kinds=(POSES.name,))
    return data, file.text.get("name", [])


def read_joint_log(path: AnyFile, robot: Robot, columns: Mapping[str, str] | None = None,
                   text: Sequence[str] = ()) -> tuple[Dataset, dict[str, list[str]]]:
    """Joint angles without measured positions, and the columns of text named in `text`, by our names."""
    file = _read_file(path, robot, columns, text)
    data = replace(_join([file], robot), kind=POSES.name, kinds=(POSES.name,))
    if data.position is not None:
        raise InputError("holds x, y, z already; expected joint angles alone", file=path, column="x")
    if not {"q", "theta"} & data.joints.keys():
        raise InputError("no joint angles; expected columns q_i or theta_i", file=path)
    check_joints(data, robot)
    return data, file.text


def write_dataset(path: str | Path, dataset: Dataset, robot: Robot) -> None:
    """Write `dataset` to a CSV or Parquet file that `read_dataset` reads back; whole or not at all."""
    write_table(path, dataset_columns(dataset, robot))


def dataset_columns(dataset: Dataset, robot: Robot) -> dict[str, np.ndarray]:
    """The columns of a file that holds `dataset`, by their names."""
    columns: dict[str, np.ndarray] = {}
    if dataset.time is not None:
        columns["time_s"] = dataset.time
    columns |= {"session": dataset.session, "run": dataset.run}
    if dataset.visit is not None:
        columns["visit"] = dataset.visit
    if dataset.identification is not None:
        columns["set"] = np.where(dataset.identification, "identification", "validation")
    units = {"theta": "rad", "q": "rad", "theta_dot": "rad_s", "q_dot": "rad_s", "current": "A"}
    units |= {"tau": "Nm", "tau_motor": "Nm"}
    written = _with_gears_only(dataset, robot)
    reported = {name: robot.controller.reported(written[name]) for name in _of_controller(
        replace(dataset, joints=written), robot)}
    for quantity, values in (written | reported).items():
        for index in np.flatnonzero(~np.isnan(values).all(axis=0)):
            line = robot.joints[index].type == "prismatic"
            unit = {"q": "m", "tau": "N"}.get(quantity, units.get(quantity)) if line else units.get(quantity)
            column = values[:, index].astype(int) if quantity == "approach" else values[:, index]
            columns[f"{quantity}_{index + 1}" + (f"_{unit}" if unit else "")] = column
    if dataset.position is not None:
        columns |= {f"{name}_m": dataset.position[:, i] for i, name in enumerate(POSITION)}
    if dataset.rotation is not None:
        quaternion = Rotation.from_matrix(dataset.rotation).as_quat()[:, [3, 0, 1, 2]]
        columns |= {name: quaternion[:, i] for i, name in enumerate(QUATERNION)}
    if dataset.gyro is not None:
        columns |= {f"{name}_rad_s": dataset.gyro[:, i] for i, name in enumerate(GYRO)}
    columns |= {name: dataset.contacts[name] for name in CONTACTS if name in dataset.contacts}
    if dataset.tilt is not None:
        columns |= {f"{name}_rad": dataset.tilt[:, i] for i, name in enumerate(TILT)}
    if dataset.accel is not None:
        columns |= {f"{name}_m_s2": dataset.accel[:, i] for i, name in enumerate(ACCEL)}
    if dataset.pixel is not None:
        columns |= {name: getattr(dataset, name) for name in PICTURE}
        columns |= {f"{name}_px": dataset.pixel[:, i] for i, name in enumerate(PIXEL)}
    if dataset.partner is not None:
        columns |= {f"{PARTNER}_{k + 1}_rad": angles for k, angles in enumerate(dataset.partner.T)}
    if dataset.length is not None:
        columns["length_m"] = dataset.length
    return columns | dataset.covariates


def _with_gears_only(dataset: Dataset, robot: Robot) -> dict[str, np.ndarray]:
    """The joints' columns with the controller's angle in place of a motor angle where no gear is declared."""
    joints, bare = dict(dataset.joints), np.array([joint.ratio is None for joint in robot.joints])
    for motor, link, offset in (("theta", "q", robot.controller_offsets), ("theta_dot", "q_dot", 0.0)):
        if motor in joints and bare.any():
            known = joints.get(link, np.full_like(joints[motor], np.nan))
            joints[link] = np.where(bare & np.isnan(known), joints[motor] + offset, known)
            joints[motor] = np.where(bare, np.nan, joints[motor])
    return joints


# -- one file ----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class _File:
    """One file in SI units: quantity or covariate -> {axis or None: numbers}."""

    path: str
    table: Table
    columns: dict[tuple[str, int | None] | str, Column]
    values: dict[tuple[str, int | None] | str, np.ndarray]
    text: dict[str, list[str]]

    def get(self, quantity: str) -> np.ndarray | None:
        return self.values.get((quantity, None))

    @property
    def marks(self) -> RowMarks:
        place = [numbers for name in POSITION if (numbers := self.get(name)) is not None]
        return RowMarks.of(np.stack(place, 1) if len(place) == len(POSITION) else None)


def _read_file(source: AnyFile, robot: Robot, given: Mapping[str, str] | None = None,
               text: Sequence[str] = ()) -> _File:
    prismatic = frozenset(i for i, joint in enumerate(robot.joints, start=1) if joint.type == "prismatic")
    words = {*text, *(theirs for theirs, ours in (given or {}).items() if ours in text)}
    path = str(source)
    table = read_table(source if isinstance(source, MemoryTable) else path, ("set", *words), may_be_empty)
    kept: dict[str, list[str]] = {}
    columns: dict[tuple[str, int | None] | str, Column] = {}
    values: dict[tuple[str, int | None] | str, np.ndarray] = {}
    ours = renamed(list(table.columns), given or {}, path)
    for name, (told, numbers) in zip(ours, table.columns.items(), strict=True):
        if name in text:
            kept[name] = [str(word).strip() for word in numbers]
            continue
        try:
            column = parse_column(name, path, prismatic)
        except InputError as error:
            raise InputError(error.message, file=path,
                             column=told if told == name else f"{told} ({name})") from None
        if column.key in columns:
            message = f"the same quantity as column {columns[column.key].name}; expected it once"
            raise InputError(message, file=path, column=name)
        if column.axis is not None and column.axis > robot.axes and column.quantity != PARTNER:
            message = f"robot {robot.name} has {robot.axes} axes; expected an axis from 1 to {robot.axes}"
            raise InputError(message, file=path, column=name)
        check_values(path, column, numbers)
        columns[column.key] = column
        values[column.key] = numbers if column.factor == 1.0 else numbers * column.factor
        check_size(path, column, values[column.key])
    columns, values = with_target(path, *with_orientation(path, columns, values))
    check_vectors(path, columns)
    return _File(path, table, columns, values, kept)


# -- all files ---------------------------------------------------------------------------------------
def _check_files(files: Sequence[_File]) -> None:
    """No file twice; a quantity that only some files have could not be used, nor dropped without a word."""
    numbering: set[tuple[str, int | None] | str] = {("session", None), ("run", None), ("visit", None)}
    numbering |= {(turn, None) for turn in TURNS}  # beside a quaternion, which all files have
    partner = {key for file in files for key in file.columns if key[0] == PARTNER}
    if partner or any((name, None) in file.columns for file in files
                      for name in (*CONTACTS, TILT[0], ACCEL[0], PIXEL[0])):
        # files of contacts beside each other, or beside a tracker's: what a file has not, its rows have not
        numbering |= partner | {(name, None) for name in (
            *CONTACTS, "length", *POSITION, *QUATERNION, *ROTATION_VECTOR, *TILT, *ACCEL, *PIXEL, *PICTURE)}
    seen: dict[str, str] = {}
    for file in files:
        if other := seen.get(file.table.sha256):
            raise InputError(f"the same content as {other}; expected each file once", file=file.path)
        seen[file.table.sha256] = file.path
    for file in files[1:]:
        for here, there in ((file, files[0]), (files[0], file)):
            missing = [key for key in there.columns if key not in here.columns and key not in numbering]
            if missing:
                message = f"column missing; expected it as in {there.path}"
                raise InputError(message, file=here.path, column=there.columns[missing[0]].name)


def _join(files: Sequence[_File], robot: Robot) -> Dataset:
    one = len(files) == 1
    rows = [file.table.rows for file in files]
    held = lambda file, key: file.values[key] if key in file.values else np.full(file.table.rows, np.nan)
    stack = lambda key: files[0].values[key] if one else np.concatenate([held(file, key) for file in files])
    first = {key: column for file in files[::-1] for key, column in file.columns.items()}
    joints: dict[str, np.ndarray] = {}
    partner: dict[int, np.ndarray] = {}
    for quantity, axis in ((key[0], key[1])
                           for key in first if isinstance(key, tuple) and key[1] is not None):
        if quantity == PARTNER:
            partner[axis] = stack((quantity, axis))
            continue
        if quantity not in joints:
            joints[quantity] = np.full((sum(rows), robot.axes), np.nan)
        joints[quantity][:, axis - 1] = stack((quantity, axis))
    vector = lambda names: np.stack([stack((name, None)) for name in names],
                                    1) if (names[0], None) in first else None
    mark = lambda name: np.nan_to_num(stack((name, None)), nan=NO_CONTACT).astype(int)
    visit = _shared_numbers(files, "visit") if any(file.get("visit") is not None for file in files) else None
    data = Dataset(
        kind="", kinds=(), axes=robot.axes, joints=joints, session=_shared_numbers(files, "session"),
        run=_distinct_runs(files), file_index=np.repeat(np.arange(len(files)), rows),
        row=np.concatenate([np.arange(1, count + 1) for count in rows]),
        time=_since_the_start(stack(("time", None))) if ("time", None) in first else None,
        position=vector(POSITION), rotation=_rotation(files, vector), rotation_vector=vector(ROTATION_VECTOR),
        turns=vector(TURNS) if all((TURNS[0], None) in file.columns for file in files) else None,
        gyro=vector(GYRO), visit=visit,
        identification=stack(("set", None)) == "identification" if ("set", None) in first else None,
        contacts={name: mark(name) for name in CONTACTS if (name, None) in first},
        length=stack(("length", None)) if ("length", None) in first else None,
        covariates={key: stack(key) for key in first if isinstance(key, str)}, flange=robot.controller.flange,
        sources=tuple(Source(file.path, file.table.sha256, file.table.rows, file.marks) for file in files),
        tilt=vector(TILT), accel=vector(ACCEL), pixel=vector(PIXEL), partner=_side_by_side(partner),
        **{name: mark(name) for name in PICTURE if (PIXEL[0], None) in first})
    angles = {name: data.joints[name] for name in _of_controller(data, robot)}
    joints = {name: robot.controller.joints(values) for name, values in angles.items()}
    return with_sensors(replace(data, joints=data.joints | joints).with_way())


def _side_by_side(columns: Mapping[int, np.ndarray]) -> np.ndarray | None:
    """(N, most) of columns by axis from 1, NaN for an axis that has none; None without any."""
    if not columns:
        return None
    empty = np.full_like(next(iter(columns.values())), np.nan)
    return np.stack([columns.get(axis, empty) for axis in range(1, max(columns) + 1)], axis=1)


def _of_controller(data: Dataset, robot: Robot) -> tuple[str, ...]:
    """Quantities that a controller reports whose axes are coupled; beside motor angles, in a motion, q_i is
    what an encoder behind the gear measures."""
    if not robot.controller.coupling or ("theta" in data.joints and is_a_series(data)):
        return ()
    return tuple(name for name in ("q", "q_dot") if name in data.joints)


def _rotation(files: Sequence[_File],
              vector: Callable[[tuple[str, ...]], np.ndarray | None]) -> np.ndarray | None:
    if (vectors := vector(ROTATION_VECTOR)) is not None:
        return Rotation.from_rotvec(np.nan_to_num(vectors)).as_matrix()
    if (quaternions := vector(QUATERNION)) is None:
        return None
    quaternions = np.where(np.isnan(quaternions), [1.0, 0.0, 0.0, 0.0], quaternions)
    norms = np.linalg.norm(quaternions, axis=1)
    bad = np.flatnonzero(np.abs(norms - 1.0) > QUATERNION_NORM_TOLERANCE)
    if bad.size:
        starts = np.cumsum([0] + [file.table.rows for file in files])
        index = int(np.searchsorted(starts, bad[0], side="right")) - 1
        message = f"quaternion of norm {norms[bad[0]]:.4g}; expected 1"
        raise InputError(message, file=files[index].path, row=int(bad[0] - starts[index]) + 1, column="qw")
    return Rotation.from_quat(quaternions[:, [1, 2, 3, 0]]).as_matrix()


def _shared_numbers(files: Sequence[_File], quantity: str) -> np.ndarray:
    """Numbers that mean the same in every file that has the column; a file without it gets one of its own."""
    used = [numbers.astype(int) for file in files if (numbers := file.get(quantity)) is not None]
    free = max((int(numbers.max()) for numbers in used), default=0)
    out = []
    for file in files:
        numbers = file.get(quantity)
        if numbers is not None:
            out.append(numbers.astype(int))
            continue
        free += 1
        out.append(np.full(file.table.rows, free))
    return np.concatenate(out)


def _distinct_runs(files: Sequence[_File]) -> np.ndarray:
    """The files' own numbers where no two files share one, else 1, 2, ... in order of appearance."""
    held = ((file.table.rows, file.get("run")) for file in files)
    numbers = [np.ones(rows, dtype=int) if run is None else run.astype(int) for rows, run in held]
    distinct = [np.unique(run) for run in numbers]
    if len(np.unique(np.concatenate(distinct))) == sum(map(len, distinct)):
        return np.concatenate(numbers)
    out, count = [], 0
    for run in numbers:
        _, first, inverse = np.unique(run, return_index=True, return_inverse=True)
        out.append(count + 1 + np.argsort(np.argsort(first))[inverse])
        count += len(first)
    return np.concatenate(out)
