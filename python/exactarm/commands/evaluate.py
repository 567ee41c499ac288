"""`exactarm evaluate`: the error of a robot file, as it is, on data it has not seen."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.chain.extrapolation import extrapolations
from exactarm.commands.arguments import add_files, add_fixture, add_robot, add_sessions
from exactarm.commands.call import (
    AnyData,
    AnyFixture,
    AnyRobot,
    AnyTable,
    asked,
    command,
    data_of,
    files_among,
    robot_of,
    table_option,
    threads_of,
)
from exactarm.commands.certified import FILE, with_uncertainty
from exactarm.commands.load_section import with_load_section
from exactarm.commands.memory import within_memory
from exactarm.commands.next_steps import to_improve
from exactarm.commands.outcome import Column
from exactarm.commands.output import PICTURES
from exactarm.commands.result import CommandResult
from exactarm.commands.steps import AT_POSES, CHECKING, JUDGING, READING, STEPS
from exactarm.commands.suspicions import suspicions
from exactarm.data.dataset import Dataset, read_planned_poses
from exactarm.data.kinds import kind_of
from exactarm.data.split import DEFAULT_SEED
from exactarm.design.joint_limits import beyond_limits
from exactarm.errors import InputError
from exactarm.files.memory_table import AnyFile
from exactarm.identify.evaluate import EVALUATORS, Evaluation
from exactarm.identify.planned import controller_angles
from exactarm.identify.pose_uncertainty import pose_uncertainty
from exactarm.progress import SILENT, Progress
from exactarm.report import Cell, Highlight, Highlights, Quantity, Report, Table, Warnings
from exactarm.report.numbers import quantities, quantity
from exactarm.report.plots.errors import error_histogram, error_per_pose
from exactarm.report.plots.style import figure_of_panel
from exactarm.robot.robot import Robot
from exactarm.verify.held_out import fitted_files

NAME = "evaluate"
FITTED = ("the robot was fitted to rows of {}, says its record: their error is that of a fit; expected data "
          "measured after it (of poses, `exactarm certify` judges the held-out rows alone)")
HELP = "the error of a robot file, as it is, on data it has not seen"
WRITES = (*PICTURES, "residuals.csv", FILE)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    add_files(parser)
    add_fixture(parser)
    add_sessions(parser)
    parser.add_argument("--at", metavar="POSES", type=Path,
                        help="poses (.csv, joint angles) at which the 95 %% ellipsoid of the error is to be "
                             "given")


@command
def evaluate(robot: AnyRobot, data: AnyData, *, seed: int = DEFAULT_SEED, threads: int | None = None,
             kind: str | None = None, fixture: AnyFixture = None, sessions: AnyTable | None = None,
             at: AnyTable | None = None, progress: Progress = SILENT) -> CommandResult:
    """The error of a robot as it is: only what belongs to the set-up (frames, contacts, sensor alignment) is
    fitted.

    at: a file or table of poses at which the 95 % ellipsoid of the target's error is given as well (data of
    kind poses). sessions: a file or table of what holds for whole sessions.

        >>> import exactarm as ea
        >>> result = ea.evaluate("ur10", ea.example("ur10/series_B"))
        >>> bool(result["error"]["mean"] > 0.5e-3)
        True
    """
    unplanned = AT_POSES if at is None else None
    progress.plan({name: share for name, share in STEPS["evaluate"].items() if name != unplanned})
    progress.stage(READING)
    declared = robot_of(robot)
    sessions, at = table_option(sessions, "sessions"), table_option(at, "at")
    rows = data_of(data, declared, kind, fixture, sessions)
    if rows.kind not in EVALUATORS:
        raise InputError(f"evaluate judges {', '.join(EVALUATORS)}; found {rows.kind}", file=rows.first_file)
    progress.stage(CHECKING)
    within_memory("evaluate", rows.kind, rows)
    with suspicions(declared, rows) as found:
        progress.stage(JUDGING)
        result = EVALUATORS[rows.kind](declared, rows, seed, threads_of(threads))
    if fitted := fitted_files(declared, rows):
        found = (*found, FITTED.format(", ".join(fitted)))
    rows = rows if result.data is None else result.data
    files = [source.path for source in rows.sources] or [""]
    columns: dict[str, Column] = {"file": [files[i] for i in rows.file_index], "row": rows.row,
                                  "session": rows.session}
    columns[f"error_{result.unit.replace('/', '_')}"] = result.error
    columns |= {name: result.residual[:, k] for k, name in enumerate(result.columns)}
    made = CommandResult(
        json={"error": result.overall.to_json(),
              "unit": result.unit,
              **distance_json(result.distances),
              **({} if result.tilt is None else {"tilt_error_rad": result.tilt}),
              **({} if result.pixels is None else {"reprojection_px": result.pixels}),
              "sessions": [{"session": session} | summary.to_json() for session, summary in result.sessions],
              "warnings": list(result.warnings)},
        report=_report(declared, rows, result), tables={"residuals.csv": columns},
        asked=asked("evaluate", robot, rows, seed,
                    {"kind": kind, "fixture": fixture, "sessions": sessions, "at": at}),
        inputs=files_among(fixture, sessions, at)).warned(found)
    if at is not None:
        progress.stage(AT_POSES)
        made = _certified(made, declared, rows, result, at, seed, threads_of(threads))
    return with_load_section(made, declared, rows)


def _certified(made: CommandResult, robot: Robot, rows: Dataset, result: Evaluation, at: AnyFile,
               seed: int, threads: int) -> CommandResult:
    if result.frames is None:
        raise InputError(f"--at needs poses, found {rows.kind}", file=rows.first_file)
    poses = read_planned_poses(at, robot)
    told = (*beyond_limits(robot, poses, "poses asked for"),
            *extrapolations(robot, controller_angles(robot, poses), "poses asked for"))
    found = pose_uncertainty(robot, result.frames, rows, result.residual, poses, seed, threads)
    return with_uncertainty(made, found, poses).warned(list(told))


def run(arguments: argparse.Namespace) -> CommandResult:
    return evaluate(arguments.robot, arguments.files, seed=arguments.seed, threads=arguments.threads,
                    kind=arguments.kind, fixture=arguments.fixture, sessions=arguments.sessions,
                    at=arguments.at, progress=arguments.progress)


def distance_json(distances: dict[str, float] | None) -> dict[str, Any]:
    """`distance_error_m` and each known distance, where the data have any."""
    if not distances:
        return {}
    return {"distance_error_m": float(np.mean(list(distances.values()))), "distances_m": distances}


def _report(robot: Robot, data: Dataset, result: Evaluation) -> Report:
    s, unit = result.overall, result.unit
    mean, most = quantities([s.mean, s.max], unit)
    verdict = (f"{robot.name}, as its file describes it, is off by {mean} on average and by {most} at most "
               f"({result.rows} rows; nothing of the robot was fitted, only the set-up).")
    if unit == "rad/s":
        verdict += " The rate is judged as it was read: what `gear` has behind its low-pass is smaller."
    known: tuple[Table, ...] = ()
    if result.distances:
        missed = float(np.mean(list(result.distances.values())))
        verdict += f" Known distances are missed by {quantity(missed, unit)} on average."
        known = (Table("Known distances", ("distance", "error"),
                       tuple((k, Quantity(v, unit)) for k, v in result.distances.items())),)
    if result.tilt is not None:
        verdict += f" The direction of gravity is missed by {quantity(result.tilt, 'rad')} on average."
    if result.pixels is not None:
        verdict += f" Corners in pictures are missed by {result.pixels:.3g} px (RMS)."
    name = kind_of(data.kind).error
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (str(session), e.n, *(Quantity(v, unit) for v in (e.mean, e.rms, e.max, e.std)))
        for session, e in result.sessions)
    none = np.ones(len(result.error), bool)
    of_a_row = (" A row's error is the RMS over its axes; the numbers above are over rows and axes."
                if result.by_axis else "")
    return Report(f"Evaluation of {robot.name}", verdict, (
        Highlights((Highlight("mean", Quantity(s.mean, unit)), Highlight("RMS", Quantity(s.rms, unit)),
                    Highlight("maximum", Quantity(s.max, unit)))),
        to_improve(kind_of(data.kind)),
        Table("By session",
              ("session", "values" if result.by_axis else "rows", "mean", "RMS", "maximum", "std. dev."),
              rows),
        *known,
        figure_of_panel("error_per_row", f"{name.capitalize()} of every row",
                        partial(error_per_pose, result.error, result.error, none, unit, name=name,
                                row=kind_of(data.kind).row), 3.6,
                        f"No row was used to fit the robot.{of_a_row}", f"{name} against the row"),
        figure_of_panel("error_histogram", f"Distribution of the {name}",
                        partial(error_histogram, result.error, result.error, unit, name=name, of="rows"), 3.0,
                        f"Number of rows by their error.{of_a_row}", f"histogram of the {name}"),
        Warnings(result.warnings)))
