"""Tables of targets, CSV or Parquet: `q_i` as a planner means them, or `x, y, z` with `qw, qx, qy, qz` of the
flange.

Poses are in the robot's base, of the flange or the --tool; with --frame device in the measuring device's
frame, of the target that it measures ([base], [tool] of the robot file). `q_i` beside a pose say which branch
is wanted; a pose without orientation keeps that of its `q_i`. `approach_i` (-1, 0, 1): from which side each
axis comes; without it the targets follow each other as joint motions, with `time_s` as a time series. Out:
the table with `q_i_rad`, the command that reaches the target, in place of `q_i` or behind the rest. Joint
angles that are not corrected stay; poses that are not have no command. Points in between of a time series are
rows of their own, with their time; all other columns must be the same in the rows before and behind, and are
so in them. `name`: words for --points. `payload_kg` with its centre: the load of a row. Other columns stay.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from exactarm.compensate.angles import from_vector
from exactarm.compensate.controller import ControllerChain
from exactarm.compensate.flange_poses import Poses
from exactarm.compensate.program import Motion, Notation, Program, SourceText, Target
from exactarm.compensate.setting import Setting
from exactarm.data.dataset import Dataset, read_named_targets
from exactarm.errors import InputError, row_name
from exactarm.files.csv_dialect import Dialect, dialect_of, header_start, split_header
from exactarm.files.memory_table import AnyFile, MemoryTable
from exactarm.files.whole_number import whole_number
from exactarm.robot.controller_frames import base_in_device, target_on_flange
from exactarm.robot.mdh_frames import relative
from exactarm.robot.robot import Placement, Robot

NAME, SUFFIXES = "table", (".csv", ".parquet", ".pq")


def load(path: AnyFile) -> SourceText:
    """The bytes of a table; a file that is none is refused by `read`."""
    if isinstance(path, MemoryTable):
        return SourceText(path, path.parquet)
    try:
        return SourceText(Path(path), Path(path).read_bytes())
    except OSError as error:
        raise InputError(
            f"cannot be read ({error.strerror}); expected a CSV or Parquet file", file=path
        ) from None


def read(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    (source,) = sources
    data, names = read_named_targets(source.path, setting.robot, setting.columns)
    if data.position is None and "q" not in data.joints:
        raise InputError("no targets: expected columns q_i, or x, y, z with qw, qx, qy, qz", file=source.path)
    q = _joint_angles(data, source)
    poses = None if data.position is None else _poses(data, q, setting, source)
    tool, base = _frames(setting)
    targets, motions = [], []
    approach, timed = (
        data.joints.get("approach"),
        data.time is not None and bool(np.all(np.diff(data.time) > 0.0)),
    )
    told = ()
    if data.time is not None and not timed and approach is None:
        late = int(np.argmax(np.diff(data.time) <= 0.0)) + 2
        told = (f"{source.path.name}: time_s does not rise at {row_name(source.path, late)}: the rows are "
                "taken as motions from point to point, not as a time series",)
    lines, rows, loads = (data.row + 1).tolist(), _Rows(source, setting), _loads(data)
    for i, line in enumerate(lines):
        name = names[i] if names else row_name(source.path, line - 1)
        if poses is None:
            targets.append(Target(name, 0, line, q[i], load=loads[i]))
        else:
            near = None if q is None else q[i]
            targets.append(Target(name, 0, line, (i,), is_pose=True, tool=tool, base=base, near=near,
                                  load=loads[i]))
        side = None if approach is None else tuple(np.nan_to_num(approach[i]))
        time = float(data.time[i]) if timed and side is None else None
        insert = partial(rows.between, i) if time is not None and i and poses is None else None
        motions.append(Motion("joint", i, line, time=time, approach=side, insert=insert))
    finish = partial(_finish, source, setting, q if poses is None else None)
    notation = Notation(joints=_as_they_are, poses=lambda rows: poses.rows(rows[:, 0].astype(int)))
    return Program(NAME, sources, tuple(targets), tuple(motions), notation, told, calculated=True,
                   finish=finish)


@dataclass(frozen=True)
class _Rows:
    """The rows of a table, to see what new ones between them would hold."""

    source: SourceText
    setting: Setting

    @cached_property
    def others(self) -> list[pa.ChunkedArray] | None:
        """The columns that are neither time nor joint angles; None if `time_s` is not there as it is."""
        table = _table(self.source)
        time = _time_column(table.column_names, self.setting)
        owners = _owners(table.column_names, self.setting, self.source)
        return None if time is None else [
            table.column(k) for k, owner in enumerate(owners) if owner is None and k != time]

    def between(self, row: int, points: list) -> tuple[int, list] | None:
        """Points before a row (from 0)."""
        others = self.others
        if others is None or any(column[row].as_py() != column[row - 1].as_py() for column in others):
            return None
        return row, points


def read_commands(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    """The commands of a table that was written: its columns q_i_rad as joint targets."""
    (source,) = sources
    table = _table(source)
    q = np.column_stack([table.column(_name(setting.robot, i)).to_numpy() for i in range(setting.robot.axes)])
    q = setting.robot.controller.joints(q)
    targets = tuple(Target(f"row {i}", 0, i + 1, row) for i, row in enumerate(q, start=1))
    return Program(NAME, sources, targets, (), Notation(joints=_as_they_are))


def _as_they_are(q: np.ndarray) -> np.ndarray:
    return q


def _loads(data: Dataset) -> list[tuple[float, tuple[float, float, float]] | None]:
    """What the flange carries in each row, by `payload_kg` with its centre."""
    load = data.load_on_flange
    if load is None:
        return [None] * len(data)
    mass, centre = load
    return [(kg, (x, y, z)) for kg, (x, y, z) in zip(mass.tolist(), centre.tolist())]


def _joint_angles(data: Dataset, source: SourceText) -> np.ndarray | None:
    q = data.joints.get("q")
    if q is not None and np.isnan(q).any():
        axis = int(np.argmax(np.isnan(q).any(axis=0))) + 1
        raise InputError(
            f"column missing; expected an angle for each of {q.shape[1]} axes",
            file=source.path,
            column=f"q_{axis}_rad",
        )
    return q


def _poses(data: Dataset, q: np.ndarray | None, setting: Setting, source: SourceText) -> Poses:
    rotations = data.rotation
    if rotations is None:
        if q is None:
            raise InputError(
                "column missing; expected the orientation beside x, y, z, or q_i whose orientation is kept",
                file=source.path,
                column="qw",
            )
        tool, base = _frames(setting)
        rotations = base.rotation.T @ ControllerChain.of(setting.robot).poses(q).rotation @ tool.rotation
    return Poses(data.position, rotations)


def _frames(setting: Setting) -> tuple[Placement, Placement]:
    """Tool in the flange and base in the controller's base frame."""
    given = setting.tool("")
    tool = Placement() if given is None else placement(given)
    if not setting.device:
        return tool, Placement()
    robot, own = setting.robot, setting.robot.controller
    return (target_on_flange(robot.tool, own) if given is None else tool,
            relative(base_in_device(robot.base, own), Placement()))


def placement(numbers) -> Placement:
    """Of a tool: x, y, z in m and a rotation vector in rad."""
    return Placement(from_vector(np.array(numbers[3:6])), np.array(numbers[:3]))


# -- out ---------------------------------------------------------------------------------------------
def _finish(
    source: SourceText, setting: Setting, q: np.ndarray | None, contents: list[bytes], commands: np.ndarray,
    inserted: list[tuple[int, list]]
) -> list[bytes]:
    """q (N, n): joint targets, which stay as they are where they are not corrected."""
    if q is not None:
        commands = np.where(np.isnan(commands), q, commands)
    write = _write_parquet if _is_parquet(source) else _write_csv
    return [write(source, setting, _written(setting.reported(commands), inserted, setting))]


@dataclass(frozen=True)
class _Written:
    """The M rows of the new table: commands (M, n), the row (from 0) of the old one that each is, or is a
    copy of, and the time of those that are new; NaN: its own."""

    commands: np.ndarray
    row: np.ndarray
    time: np.ndarray


def _written(commands: np.ndarray, inserted: list[tuple[int, list]], setting: Setting) -> _Written:
    own = np.full(len(commands), np.nan)
    if not inserted:
        return _Written(commands, np.arange(len(commands)), own)
    at = np.concatenate([np.full(len(points), row) for row, points in inserted])
    new = [(time, setting.reported(q)) for _, points in inserted for time, q, _ in points]
    rows = np.insert(np.arange(len(commands)), at, at)
    return _Written(np.insert(commands, at, [q for _, q in new], axis=0), rows,
                    np.insert(own, at, [time for time, _ in new]))


def _time_column(names: list[str], setting: Setting) -> int | None:
    found = [k for k, name in enumerate(names) if setting.columns.get(name.strip(), name.strip()) == "time_s"]
    return found[0] if len(found) == 1 else None


def _table(source: SourceText) -> pa.Table:
    return _parquet(source) if _is_parquet(source) else _csv(source)


def _is_parquet(source: SourceText) -> bool:
    return isinstance(source.path, MemoryTable) or source.path.suffix.lower() in (".parquet", ".pq")


def _name(robot: Robot, index: int) -> str:
    return f"q_{index + 1}_{'m' if robot.joints[index].type == 'prismatic' else 'rad'}"


def _owners(names: list[str], setting: Setting, source: SourceText) -> list[int | None]:
    """The axis (from 0) whose angle each column holds, None: none."""
    robot, owners = setting.robot, []
    new = {_name(robot, i) for i in range(robot.axes)}
    for name in map(str.strip, names):
        parts = setting.columns.get(name, name).split("_")
        axis = whole_number(parts[1]) if len(parts) == 3 and parts[0] == "q" else None
        mine = axis is not None and axis <= robot.axes
        if not mine and name in new:
            raise InputError(
                "is the name of a column of the result, and --map gives it another one; expected it as it is",
                file=source.path, column=name,
            )
        owners.append(axis - 1 if axis is not None and mine else None)
    return owners


def _dialect(source: SourceText) -> Dialect:
    """How the file parts its columns and writes its numbers."""
    header, _, body = source.content[header_start(source.content) :].partition(b"\n")
    return dialect_of(split_header(header.decode())[1], body)


def _csv(source: SourceText) -> pa.Table:
    dialect = _dialect(source)
    return pa.csv.read_csv(
        io.BytesIO(source.content[header_start(source.content) :]),
        parse_options=pa.csv.ParseOptions(delimiter=dialect.delimiter),
        convert_options=pa.csv.ConvertOptions(decimal_point=dialect.decimal),
    )


def _write_csv(source: SourceText, setting: Setting, new_rows: _Written) -> bytes:
    if b'"' in source.content:
        raise InputError("a cell in quotes; expected numbers without them", file=source.path)
    robot = setting.robot
    start, dialect = header_start(source.content), _dialect(source)
    lines = source.content[start:].splitlines(keepends=True)
    comma = dialect.delimiter.encode()
    numbers = _cells(new_rows.commands, dialect.decimal)
    times = iter(new_rows.time.tolist())
    left = np.bincount(new_rows.row, minlength=1).tolist()[::-1]  # how often each row is written
    out, owned, clock = [source.content[:start]], None, None
    # owned: (place in the line, axis) of each column that is written anew
    for line in lines:
        body = line.rstrip(b"\r\n")
        if owned is not None and not body.strip():
            out.append(line)
            continue
        cells = body.split(comma)
        if owned is None:
            names = [cell.decode() for cell in cells]
            owners = _owners(names, setting, source)
            owned = [(place, owner) for place, owner in enumerate(owners) if owner is not None]
            clock = _time_column(names, setting)
            new = [_name(robot, i).encode() for i in range(robot.axes)]
            many = [(new, np.nan)]
        else:
            many = [(next(numbers), next(times)) for _ in range(left.pop())]
        end = line[len(body) :]
        for k, (new, time) in enumerate(many, start=1):
            row = list(cells)
            if time == time and clock is not None:
                row[clock] = repr(time).replace(".", dialect.decimal).encode()
            for place, owner in owned:
                row[place] = new[owner]
            out.append(comma.join(row if owned else [*row, *new]) + (end or b"\n" * (k < len(many))))
    return b"".join(out)


def _cells(commands: np.ndarray, decimal: str) -> Iterator[list[bytes]]:
    """The cells of each row of joint angles (N, n), empty where there is none."""
    for row in commands.tolist():
        text = " ".join(map(repr, row)).replace("nan", "").replace(".", decimal)
        yield text.encode().split(b" ")


def _parquet(source: SourceText) -> pa.Table:
    return pa.parquet.read_table(pa.BufferReader(source.content))


def columns_of(content: bytes) -> dict[str, np.ndarray]:
    """Of a table that was written as Parquet."""
    table = pa.parquet.read_table(pa.BufferReader(content))
    return {name: table.column(name).to_numpy() for name in table.column_names}


def _write_parquet(source: SourceText, setting: Setting, new_rows: _Written) -> bytes:
    table, robot, commands = _parquet(source), setting.robot, new_rows.commands
    clock = _time_column(table.column_names, setting)
    if len(new_rows.row) > table.num_rows and clock is not None:
        table = table.take(new_rows.row)
        times = table.column(clock).to_numpy().astype(float)
        times = np.where(np.isnan(new_rows.time), times, new_rows.time)
        table = table.set_column(clock, table.column_names[clock], pa.array(times))
    for index, owner in enumerate(_owners(table.column_names, setting, source)):
        if owner is not None:
            table = table.set_column(index, _name(robot, owner), pa.array(commands[:, owner]))
    for owner in range(robot.axes):
        if _name(robot, owner) not in table.column_names:
            table = table.append_column(_name(robot, owner), pa.array(commands[:, owner]))
    sink = pa.BufferOutputStream()
    pa.parquet.write_table(table, sink)
    return sink.getvalue().to_pybytes()
