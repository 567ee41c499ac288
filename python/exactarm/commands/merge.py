"""`exactarm merge`: points of a measuring program and a log of joint angles become one table of poses."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.commands.arguments import add_map, add_robot
from exactarm.commands.call import AnyRobot, AnyTable, asked, command, path_word, robot_of, table_of
from exactarm.commands.outcome import Column
from exactarm.commands.publish import sources
from exactarm.commands.result import CommandResult
from exactarm.data.dataset import Dataset, dataset_columns, read_dataset, read_joint_log
from exactarm.data.kinds import POSES
from exactarm.data.point_text import UNITS, Points, header_names, read_points
from exactarm.data.rows import Source
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError, line_name, row_name
from exactarm.files.memory_table import AnyFile
from exactarm.files.table import column_names, write_table
from exactarm.first_aid.first_aid import first_aid
from exactarm.report import Highlight, Highlights, Quantity, Report, Table, Text, Warnings
from exactarm.robot.robot import Robot

NAME = "merge"
HELP = "points of a tracker's program as text and a log of joint angles become one table of poses"
UNUSED_OPTIONS = ("seed", "threads")  # nothing in it is random
FILE = "poses.csv"
WRITES = (FILE,)
LISTED = 10  # names in one sentence


@dataclass(frozen=True)
class _Merged:
    """Rows of the log and points that belong together, and the names that have no counterpart."""

    rows: np.ndarray
    points: np.ndarray
    by: str
    without_point: tuple[str, ...] = ()
    without_angles: tuple[str, ...] = ()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    parser.add_argument("joints", metavar="JOINTS", type=Path,
                        help="log of joint angles (.csv, .parquet): q_i or theta_i, column `name`")
    parser.add_argument("points", metavar="POINTS", type=Path, help="exported points (text)")
    parser.add_argument("--by", choices=("name", "row"),
                        help="what belongs together (default: name where the log has such a column)")
    parser.add_argument("--unit", choices=tuple(UNITS), help="of x, y, z where the file has none")
    parser.add_argument("--layout", metavar="NAMES",
                        help="columns of points without header, as group,name,x,y,z (-: not wanted)")
    parser.add_argument("--group", metavar="NAME", action="append", default=[],
                        help="take the points of this group alone; may be given again")
    add_map(parser, "columns")


@command
def merge(robot: AnyRobot, joints: AnyTable, points: AnyTable, *, by: str | None = None,
          unit: str | None = None, layout: str | None = None, group: Sequence[str] = (),
          columns: Mapping[str, str] | None = None, seed: int = DEFAULT_SEED) -> CommandResult:
    """One table of poses from a tracker's points (text, or a table with names, x, y, z) and a log of joint
    angles, by the names of the points or row by row; `.data` holds it for the next command. Nothing in it is
    random: `seed` is recorded."""
    arm, wanted = robot_of(robot), [group] if isinstance(group, str) else list(group)
    joints, points = table_of(joints, "joints"), table_of(points, "points")
    if by not in (None, "name", "row"):
        raise InputError(f"by {by!r}; expected name or row")
    if unit is not None and unit not in UNITS:
        raise InputError(f"--unit {unit}; expected one of {', '.join(UNITS)}")
    theirs, logged = _maps(joints, points, columns or {}, layout)
    found = read_points(points, unit, layout, theirs)
    told, found = found.told, found.of_groups(wanted, points)
    log, text = read_joint_log(joints, arm, logged, ("name", "group"))
    merged = _by_name(log, text, found, joints, points) if by == "name" or (by is None and "name" in text) \
        else _by_row(log, found, joints, points)
    table = _table(arm, log, found, merged)
    data = _checked(table, arm, joints, points)
    options = {"by": by, "unit": unit, "layout": layout, "group": wanted, "columns": columns}
    call = asked("merge", robot, None, seed, options,
                 {"by": None, "unit": None, "layout": None, "group": [], "columns": None})
    files = sources((joints, points))
    line = call.line.replace(", ", f", {path_word(joints)}, {path_word(points)}, ", 1)
    warnings = (*_warnings(merged), *data.notes, *(first_aid(arm, data) if arm.has_geometry else ()))
    return CommandResult(json=_json(merged, told, warnings),
                         report=_report(arm, data, merged, told, warnings), tables={FILE: table}, data=data,
                         asked=replace(call, line=line, files=(*call.files, *files)))


def run(arguments: argparse.Namespace) -> CommandResult:
    return merge(
        arguments.robot, arguments.joints, arguments.points, by=arguments.by, unit=arguments.unit,
        layout=arguments.layout, group=arguments.group, columns=dict(arguments.columns), seed=arguments.seed)


def _maps(joints: AnyFile, points: AnyFile, given: Mapping[str, str],
          layout: str | None) -> tuple[dict[str, str], dict[str, str]]:
    """Those of the file of points, those of the log."""
    headed = header_names(points) if layout is None else []
    known = column_names(joints) if given else []
    unknown = next((name for name in given if name not in headed and name not in known), None)
    if unknown is not None:
        raise InputError(f"--map {unknown}={given[unknown]}: no such column in {joints} ({', '.join(known)}) "
                         f"nor in {points} ({', '.join(headed) or 'no header'})")
    return ({name: ours for name, ours in given.items() if name in headed},
            {name: ours for name, ours in given.items() if name in known})


# -- what belongs together ---------------------------------------------------------------------------------
def _by_row(log: Dataset, found: Points, joints: AnyFile, points: AnyFile) -> _Merged:
    if len(log) != len(found.names):
        raise InputError(
            f"{len(found.names)} points, but {joints} has {len(log)} rows; expected as many, or a column "
            "`name` in both to tell which belong together", file=points)
    rows = np.arange(len(log))
    return _Merged(rows, rows, "row")


def _by_name(log: Dataset, text: Mapping[str, list[str]], found: Points, joints: AnyFile,
             points: AnyFile) -> _Merged:
    if "name" not in text:
        raise InputError("column missing; expected the names of the points", file=joints, column="name")
    if not any(found.names):
        raise InputError("the points have no names; expected --by row", file=points)
    grouped = "group" in text
    keys = list(zip(text["group"], text["name"])) if grouped else [("", name) for name in text["name"]]
    places: dict[tuple[str, str], int] = {}
    for i, (group, name) in enumerate(zip(found.groups, found.names)):
        key = (group if grouped else "", name)
        if key in places:
            other = places[key]
            apart = found.groups[other] != group
            raise InputError(
                f"point {name!r} is on {line_name(points, found.lines[other])} too"
                + (f", in group {found.groups[other]}; expected --group, or a column `group` in {joints}"
                   if apart else "; expected each name once"),
                file=points, line=int(found.lines[i]))
        places[key] = i
    seen: dict[tuple[str, str], int] = {}
    for row, key in enumerate(keys):
        if key in seen:
            first = row_name(joints, seen[key] + 1)
            raise InputError(f"{key[1]!r} is in {first} too; expected each name once", file=joints,
                             row=row + 1, column="name")
        seen[key] = row
    rows = [row for row, key in enumerate(keys) if key in places]
    if not rows:
        raise InputError(f"none of the names of {joints} (as {keys[0][1]!r}) is a point's (as "
                         f"{found.names[0]!r})", file=points)
    return _Merged(np.array(rows), np.array([places[keys[row]] for row in rows]), "name",
                   tuple(key[1] for key in keys if key not in places),
                   tuple(name for group, name in zip(found.groups, found.names)
                         if (group if grouped else "", name) not in seen))


def _table(arm: Robot, log: Dataset, found: Points, merged: _Merged) -> dict[str, Column]:
    kept = log.select(merged.rows)
    table: dict[str, Column] = dict(dataset_columns(kept, arm))
    table |= {f"{axis}_m": found.position[merged.points, i] for i, axis in enumerate("xyz")}
    return table | {name: values[merged.points] for name, values in found.extras.items()}


def _checked(table: Mapping[str, Column], arm: Robot, joints: AnyFile, points: AnyFile) -> Dataset:
    """The table as every other command will read it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / FILE
        write_table(path, {name: np.asarray(values) for name, values in table.items()})
        try:
            data = read_dataset(path, arm, POSES.name)
        except InputError as error:
            raise InputError(f"the merged table: {error.message}", file=points, row=error.row,
                             column=error.column) from error
    return replace(data, sources=(Source(f"{joints} and {points}", data.sources[0].sha256, len(data)),))


# -- what it says ------------------------------------------------------------------------------------------
def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more


def _warnings(merged: _Merged) -> tuple[str, ...]:
    out = []
    if merged.without_point:
        out.append(f"rows of the log without a point: {_listed(merged.without_point)}")
    if merged.without_angles:
        out.append(f"points without joint angles: {_listed(merged.without_angles)}")
    if merged.by == "row":
        out.append("merged row by row: a point that is missing and another that is doubled would not be seen "
                   "here; `calibrate` then finds a large error")
    return tuple(out)


def _json(merged: _Merged, told: Sequence[str], warnings: Sequence[str]) -> dict[str, Any]:
    return {"file": FILE, "rows": len(merged.rows), "by": merged.by, "read": list(told),
            "without_point": list(merged.without_point), "without_angles": list(merged.without_angles),
            "warnings": list(warnings)}


def _report(arm: Robot, data: Dataset, merged: _Merged, told: Sequence[str],
            warnings: tuple[str, ...]) -> Report:
    assert data.position is not None  # of poses
    spread = data.position.max(axis=0) - data.position.min(axis=0)
    lost = len(merged.without_point) + len(merged.without_angles)
    return Report(
        f"Poses of {arm.name}",
        f"{len(merged.rows)} poses are written to {FILE}, merged by {merged.by}"
        + (f"; {lost} have no counterpart." if lost else "."),
        (Warnings(warnings),
         Highlights((Highlight("poses", Quantity(len(merged.rows), "", exact=True)),)),
         Text("What was read", tuple(f"{line}." for line in told)),
         Table("Extent of the points", ("", "from the lowest to the highest"),
               tuple((axis, Quantity(float(value), "m")) for axis, value in zip("xyz", spread)),
               "In the frame in which they were exported. A wrong unit or two swapped columns show here.")),
        "caution" if lost else "plain")
