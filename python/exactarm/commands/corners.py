"""`exactarm corners`: pictures of a ChArUco board and a log of joint angles become one table of corners."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from exactarm.commands.arguments import add_fixture, add_map, add_robot
from exactarm.commands.call import (
    AnyFixture,
    AnyRobot,
    AnyTable,
    asked,
    command,
    files_among,
    fixture_of,
    path_word,
    robot_of,
    table_of,
)
from exactarm.commands.publish import sources
from exactarm.commands.result import CommandResult
from exactarm.commands.steps import PICTURES, STEPS
from exactarm.data.dataset import Dataset, dataset_columns, read_joint_log
from exactarm.data.fixture import CameraSetup
from exactarm.data.kinds import CLOSURES
from exactarm.data.rows import by_name
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import ComputationError, InputError
from exactarm.files.memory_table import AnyFile
from exactarm.measurement.board_detection import find_corners
from exactarm.progress import SILENT, Progress
from exactarm.report import Highlight, Highlights, Quantity, Report, Table, Warnings

NAME = "corners"
HELP = "pictures of a ChArUco board and a log of joint angles become one table of corners"
UNUSED_OPTIONS = ("seed", "threads")  # nothing in it is random
FILE = "corners.csv"
WRITES = (FILE,)
LEAST = 6  # corners: a picture with fewer tells nothing that calibrates


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    parser.add_argument("joints", metavar="JOINTS", type=Path,
                        help="log of joint angles (.csv, .parquet), one row a picture; a column `file` names "
                             "it, else in the order of the pictures' names")
    parser.add_argument("pictures", metavar="PICTURE", nargs="+", type=Path, help="pictures of the board")
    add_fixture(parser)
    add_map(parser, "columns")


@command
def corners(robot: AnyRobot, joints: AnyTable, pictures: Sequence[str | Path], *, fixture: AnyFixture,
            columns: dict[str, str] | None = None, seed: int = DEFAULT_SEED,
            progress: Progress = SILENT) -> CommandResult:
    """One table of corners from pictures of a ChArUco board and the joint angles of each (a file or a
    table); `.data` holds it for the next command. fixture: with [board], marker_mm and
    dictionary. Nothing in it is random."""
    arm, joints, known = robot_of(robot), table_of(joints, "joints"), fixture_of(fixture)
    if known is None or known.camera is None:
        raise InputError("no board; expected --fixture with [board]: squares, square_mm, marker_mm and "
                         "dictionary")
    log, text = read_joint_log(joints, arm, columns or {}, ("file",))
    files = _in_order_of(log, text.get("file"), pictures, joints)
    parts, seen = [], []
    progress.plan(STEPS["corners"])
    progress.stage(PICTURES, total=len(files))
    for row, file in enumerate(files):
        progress.step(min(row, 1), note=Path(file).name)
        numbers, pixels, size = find_corners(file, known.camera)
        _check_size(file, size, known.camera)
        seen.append(len(numbers))
        if len(numbers) >= LEAST:
            at = np.full(len(numbers), row)
            parts.append(replace(log.select(at), pixel=pixels, corner=numbers, picture=at,
                                 contacts={"camera": np.zeros(len(at), int)}))
    if not parts:
        raise ComputationError(f"no picture of {len(files)} shows {LEAST} corners of the board: are squares, "
                               "marker_mm and dictionary those of the printed board?")
    stack = lambda pick: np.concatenate([pick(part) for part in parts])
    data = Dataset.of_arrays(
        CLOSURES.name, {name: stack(lambda part, name=name: part.joints[name]) for name in log.joints},
        session=stack(lambda part: part.session), pixel=stack(lambda part: part.pixel),
        corner=stack(lambda part: part.corner), picture=stack(lambda part: part.picture),
        contacts={"camera": np.zeros(sum(map(len, parts)), int)}, fixture=known,
        covariates={name: stack(lambda part, name=name: part.covariates[name]) for name in log.covariates})
    bare = tuple(Path(file).name for file, count in zip(files, seen) if count < LEAST)
    options = {"fixture": fixture, "columns": columns}
    call = asked("corners", robot, None, seed, options, {"columns": None})
    line = call.line.replace(", ", f", {path_word(joints)}, {[str(file) for file in files]!r}, ", 1)
    return CommandResult(
        json={"file": FILE, "pictures": len(files), "without_board": list(bare), "corners": len(data),
              "warnings": list(_warnings(bare))},
        report=_report(arm.name, files, seen, bare), tables={FILE: dataset_columns(data, arm)}, data=data,
        inputs=files_among(fixture),
        asked=replace(call, line=line, files=(*call.files, *sources((joints, *files)))))


def run(arguments: argparse.Namespace) -> CommandResult:
    return corners(arguments.robot, arguments.joints, arguments.pictures, fixture=arguments.fixture,
                   columns=dict(arguments.columns), seed=arguments.seed, progress=arguments.progress)


def _in_order_of(log: Dataset, named: list[str] | None, pictures: Sequence[str | Path],
                 joints: AnyFile) -> list[str]:
    """The picture of each row of the log."""
    files = sorted((str(path) for path in pictures), key=by_name)
    if named is None:
        if len(files) != len(log):
            raise InputError(f"{len(files)} pictures, but {joints} has {len(log)} rows; expected as many, or "
                             "a column `file` with the name of each picture", file=str(joints))
        return files
    places = {Path(file).name: file for file in files}
    for row, name in enumerate(named, 1):
        if Path(name).name not in places:
            raise InputError(f"picture {name!r} is not among those given; expected one of "
                             f"{', '.join(list(places)[:5])}, ...", file=str(joints), row=row, column="file")
    return [places[Path(name).name] for name in named]


def _check_size(file: str, size: tuple[int, int], setup: CameraSetup) -> None:
    if setup.size is not None and size != setup.size:
        raise InputError(f"a picture of {size[0]} x {size[1]} px; expected {setup.size[0]} x {setup.size[1]} "
                         "as size_px of the fixture file says", file=file)


def _warnings(bare: Sequence[str]) -> tuple[str, ...]:
    if not bare:
        return ()
    more = f" and {len(bare) - 10} more" if len(bare) > 10 else ""
    return (f"pictures in which fewer than {LEAST} corners were found are left out: "
            f"{', '.join(bare[:10])}{more}",)


def _report(name: str, files: Sequence[str], seen: Sequence[int], bare: Sequence[str]) -> Report:
    rows = tuple((Path(file).name, Quantity(count, "", exact=True)) for file, count in zip(files, seen))
    used = len(files) - len(bare)
    return Report(
        f"Corners for {name}",
        f"{sum(n for n in seen if n >= LEAST)} corners in {used} of {len(files)} pictures are written to "
        f"{FILE}.",
        (Warnings(_warnings(bare)), Highlights((Highlight("pictures", Quantity(used, "", exact=True)),)),
         Table("Pictures", ("picture", "corners"), rows, "In the order of the rows of joint angles.")),
        "caution" if bare else "plain")
