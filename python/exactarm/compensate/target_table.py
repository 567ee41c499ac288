"""Tables of targets, CSV or Parquet: `q_i` as a planner means them, or `x, y, z` with `qw, qx, qy, qz` of the
flange.

Poses are in the robot's base, of the flange or the --tool; with --frame device in the measuring device's
frame, of the target that it measures ([base], [tool] of the robot file). `q_i` beside a pose say which branch
is wanted; a pose without orientation keeps that of its `q_i`. `approach_i` (-1, 0, 1): from which side each
axis comes; without it the targets follow each other as joint motions, with `time_s` as a time series. Out:
the table with `q_i_rad`, the command that reaches the target, in
place of `q_i` or behind the rest.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from exactarm.compensate.angles import from_vector
from exactarm.compensate.controller import ControllerChain
from exactarm.compensate.program import Motion, Program, SourceText, Target
from exactarm.compensate.setting import Setting
from exactarm.controller_frames import base_in_device, target_on_flange
from exactarm.csv_dialect import Dialect, dialect_of, split_header
from exactarm.dataset import Dataset, read_targets
from exactarm.errors import InputError
from exactarm.mdh_frames import relative
from exactarm.robot import Placement, Robot
from exactarm.whole_number import whole_number

NAME, SUFFIXES = "table", (".csv", ".parquet", ".pq")


def load(path: str | Path) -> SourceText:
    """The bytes of a table; a file that is none is refused by `read`."""
    try:
        return SourceText(Path(path), Path(path).read_bytes())
    except OSError as error:
        raise InputError(
            f"cannot be read ({error.strerror}); expected a CSV or Parquet file", file=path
        ) from None


def read(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    (source,) = sources
    data = read_targets(source.path, setting.robot, setting.columns)
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
    lines = (data.row + 1).tolist()
    for i, line in enumerate(lines):
        name = f"row {line - 1}"
        if poses is None:
            targets.append(Target(name, 0, line, _nothing, q[i]))
        else:
            near = None if q is None else q[i]
            targets.append(Target(name, 0, line, _nothing, pose=poses[i], tool=tool, base=base, near=near))
        side = None if approach is None else tuple(np.nan_to_num(approach[i]))
        time = float(data.time[i]) if timed and side is None else None
        motions.append(Motion("joint", i, line, time=time, approach=side))
    finish = partial(_finish, source, setting)
    return Program(NAME, sources, tuple(targets), tuple(motions), calculated=True, finish=finish)


def read_commands(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    """The commands of a table that was written: its columns q_i_rad as joint targets."""
    (source,) = sources
    table = _parquet(source) if _is_parquet(source) else _csv(source)
    q = np.column_stack([table.column(_name(setting.robot, i)).to_numpy() for i in range(setting.robot.axes)])
    q = setting.robot.controller.joints(q)
    targets = tuple(Target(f"row {i}", 0, i + 1, _nothing, row) for i, row in enumerate(q, start=1))
    return Program(NAME, sources, targets, ())


def _nothing(*_) -> list:
    """The edits of one target: `_finish` writes the table as a whole."""
    return []


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


def _poses(data: Dataset, q: np.ndarray | None, setting: Setting, source: SourceText) -> list[Placement]:
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
    return [Placement(rotation, position) for rotation, position in zip(rotations, data.position)]


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
def _finish(source: SourceText, setting: Setting, contents: list[bytes], commands: np.ndarray) -> list[bytes]:
    write = _write_parquet if _is_parquet(source) else _write_csv
    return [write(source, setting, setting.reported(commands))]


def _is_parquet(source: SourceText) -> bool:
    return source.path.suffix.lower() in (".parquet", ".pq")


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
    header, _, body = source.content.removeprefix(b"\xef\xbb\xbf").partition(b"\n")
    return dialect_of(split_header(header.decode())[1], body)


def _csv(source: SourceText) -> pa.Table:
    dialect = _dialect(source)
    return pa.csv.read_csv(
        io.BytesIO(source.content), parse_options=pa.csv.ParseOptions(delimiter=dialect.delimiter),
        convert_options=pa.csv.ConvertOptions(decimal_point=dialect.decimal),
    )


def _write_csv(source: SourceText, setting: Setting, commands: np.ndarray) -> bytes:
    if b'"' in source.content:
        raise InputError("a cell in quotes; expected numbers without them", file=source.path)
    robot = setting.robot
    lines, dialect = source.content.splitlines(keepends=True), _dialect(source)
    comma = dialect.delimiter.encode()
    numbers = _cells(commands, dialect.decimal)
    out, owned = [], None  # owned: (place in the line, axis) of each column that is written anew
    for line in lines:
        body = line.rstrip(b"\r\n")
        if owned is not None and not body.strip():
            out.append(line)
            continue
        cells = body.split(comma)
        if owned is None:
            bom = b"\xef\xbb\xbf" if body.startswith(b"\xef\xbb\xbf") else b""
            owners = _owners([cell.removeprefix(bom).decode() for cell in cells], setting, source)
            owned = [(place, owner) for place, owner in enumerate(owners) if owner is not None]
            new = [_name(robot, i).encode() for i in range(robot.axes)]
            new[0] = (bom if owners[0] == 0 else b"") + new[0]
        else:
            new = next(numbers)
        for place, owner in owned:
            cells[place] = new[owner]
        out.append(comma.join(cells if owned else [*cells, *new]) + line[len(body) :])
    return b"".join(out)


def _cells(commands: np.ndarray, decimal: str) -> Iterator[list[bytes]]:
    """The cells of each row of joint angles (N, n), empty where there is none."""
    for row in commands.tolist():
        text = " ".join(map(repr, row)).replace("nan", "").replace(".", decimal)
        yield text.encode().split(b" ")


def _parquet(source: SourceText) -> pa.Table:
    return pa.parquet.read_table(pa.BufferReader(source.content))


def _write_parquet(source: SourceText, setting: Setting, commands: np.ndarray) -> bytes:
    table, robot = _parquet(source), setting.robot
    for index, owner in enumerate(_owners(table.column_names, setting, source)):
        if owner is not None:
            table = table.set_column(index, _name(robot, owner), pa.array(commands[:, owner]))
    for owner in range(robot.axes):
        if _name(robot, owner) not in table.column_names:
            table = table.append_column(_name(robot, owner), pa.array(commands[:, owner]))
    sink = pa.BufferOutputStream()
    pa.parquet.write_table(table, sink)
    return sink.getvalue().to_pybytes()
