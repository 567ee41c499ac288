"""`exactarm compensate`: robot programs with numbers that make the calibrated arm go where they say."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from glob import escape
from pathlib import Path
from typing import Any, Literal

import numpy as np

from exactarm.commands.arguments import add_files, add_map, add_robot, require_acting
from exactarm.commands.call import (
    AnyRobot,
    AnyTable,
    arguments_of,
    asked,
    changed_options,
    command,
    robot_of,
    table_option,
    tables_of,
    threads_of,
)
from exactarm.commands.compensate_report import compensation_table, report_of, summary_of
from exactarm.commands.model_trust import trust_json
from exactarm.commands.output import PICTURES
from exactarm.commands.planning_arguments import Numbers
from exactarm.commands.result import CommandResult
from exactarm.commands.steps import CORRECTING, FRAMES, STEPS, TRUSTED
from exactarm.compensate import target_table
from exactarm.compensate.collector import collector_at_rest
from exactarm.compensate.correction import correct
from exactarm.compensate.formats import Job, jobs
from exactarm.compensate.frames import cell_frames, with_nominal
from exactarm.compensate.law import CompensationModel
from exactarm.compensate.program import Program
from exactarm.compensate.setting import Setting, chosen_points, read_frames, read_numbers, unmatched
from exactarm.data.columns import MOST, PAYLOAD
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.files.file_bytes import real_path
from exactarm.files.memory_table import MemoryTable
from exactarm.first_aid.load_mistakes import FAR_M, too_heavy
from exactarm.identify.pose_uncertainty import model_uncertainty
from exactarm.progress import SILENT, Progress
from exactarm.robot.robot import Placement, Robot
from exactarm.robot_file import load_robot

NAME = "compensate"
HELP = "correct robot programs by the identified model: the same files, with other numbers"
UNUSED_OPTIONS = ("seed",)  # nothing in it is random
RESULTS = ("compensation.csv",)


def WRITES(arguments: argparse.Namespace) -> list[str]:  # of other commands a tuple
    """The programs keep their names."""
    return [*PICTURES, *RESULTS, *(escape(Path(file).name) for file in arguments.files)]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    add_map(parser, "columns")  # of tables; a program among the files has none
    add_files(parser,
              text="programs (.src with .dat, .mod, .ls, .script, .jbi, .yaml) or tables of targets (.csv, "
                   ".parquet)", measured=False)
    parser.add_argument(
        "--frames", metavar="nominal|identified|POINTS.csv", default="nominal",
        help="what stands for the controller's base and flange; reference points in the cell are best "
             "(default %(default)s)")
    parser.add_argument(
        "--points", metavar="calculated|taught|NAMES",
        help="which points were calculated and not taught: all, none, or names with commas between "
             "(XP1,XP2*)")
    parser.add_argument(
        "--tool", metavar="[NAME=]NUMBERS", action="append", default=[],
        help="a tool that the program does not hold, as its controller shows it; may be given several times")
    parser.add_argument(
        "--base", metavar="[NAME=]NUMBERS", action="append", default=[],
        help="a base, user frame or work object, as its controller shows it; may be given several times")
    parser.add_argument("--payload", metavar="KG,X,Y,Z",
                        help="the load at the flange: kg, and its centre in m in the flange frame")
    parser.add_argument(
        "--start", metavar="J1,J2,...", help="joint angles before the first motion, deg (m of a sliding axis)"
    )
    parser.add_argument("--nominal", metavar="ROBOT",
                        help="robot file with the frames of the controller, where ROBOT does not hold them")
    parser.add_argument("--frame", choices=("base", "device"), default="base",
                        help="frame of the poses in tables (default %(default)s)")
    parser.add_argument(
        "--session", metavar="N", type=int, help="with --frame device: the set-up whose device frame is meant"
    )
    parser.add_argument(
        "--tolerance-mm", metavar="MM", type=_tolerance,
        help="how far a straight motion may leave its line: points in between are put in, where the dialect "
             "allows it")
    parser.add_argument("--keep-refused", action="store_true",
                        help="leave targets that cannot be corrected as they are, instead of stopping")


def _tolerance(text: str) -> float:
    value = float(text)
    if not 0.0 < value < np.inf:
        raise argparse.ArgumentTypeError(f"{text}, expected a number above 0")
    return value


_tolerance.__name__ = "number of mm"


@command
def compensate(robot: AnyRobot, files: AnyTable | Sequence[AnyTable], *, frames: AnyTable = "nominal",
               points: str | None = None, tool: str | Sequence[str] | Numbers = (),
               base: str | Sequence[str] | Numbers = (), payload: Numbers | None = None,
               start: Numbers | None = None, nominal: str | Path | None = None,
               frame: Literal["base", "device"] = "base", session: int | None = None,
               tolerance_mm: float | None = None, keep_refused: bool = False,
               columns: Mapping[str, str] | None = None, seed: int = DEFAULT_SEED,
               threads: int | None = None, progress: Progress = SILENT) -> CommandResult:
    """Robot programs, or tables of targets, with numbers that make the calibrated arm go where they say.

    `result.save(folder)` writes the programs under their names, and a table in memory as table_1.parquet:
    `result.to_dataframe("table_1")`. frames: what stands for the controller's base and flange: "nominal",
    "identified", or reference points (a file or a table). points: which ones were calculated: "calculated",
    "taught", or names with commas between. tool, base: as the controller shows them, in mm and degrees, with
    "NAME=" before the numbers where there are several. payload: kg and its centre in m. start: joint angles
    before the first motion, in degrees. nominal: robot file with the frames of the controller. frame,
    session: of the poses in tables. tolerance_mm: how far a straight motion may leave its line. columns: the
    tables' names -> ours.
    """
    frames = table_option(frames, "frames") or "nominal"
    options = changed_options(compensate, locals())
    tables = tables_of(files, "robot programs or tables of targets")
    arguments = arguments_of(add_arguments, robot_of(robot), tables, options)
    vars(arguments).update(seed=seed, threads=threads_of(threads), progress=progress, out=None)
    return run(arguments).asked_as(asked("compensate", robot, tables, seed, options))


@collector_at_rest()
def run(arguments: argparse.Namespace) -> CommandResult:
    robot = robot_of(arguments.robot)
    if arguments.nominal is not None:
        robot = with_nominal(robot, load_robot(arguments.nominal))
    _check(robot, arguments)
    work = jobs(arguments.files)
    setting = _setting(robot, arguments)
    if not any(job.dialect is target_table for job in work):
        if setting.columns:
            raise InputError("--map names columns of tables; expected a table (.csv, .parquet) among the "
                             "files")
        require_acting(arguments, add_arguments, {"frame": "on a table (.csv, .parquet) among FILE"})
    for job in work:
        _require_frames(job, setting)
    arguments.progress.plan(STEPS["compensate"])
    arguments.progress.stage(FRAMES)
    frames = cell_frames(robot, arguments.frames, _tip(work[0], setting), arguments.threads)
    model = CompensationModel.of(robot, frames.base, frames.flange)
    if setting.load is not None:
        model = model.with_load(setting.load[0], np.array(setting.load[1]))
    corrections = []
    arguments.progress.stage(CORRECTING, total=len(work))
    for place, job in enumerate(work):
        arguments.progress.step(min(place, 1), note=job.paths[0].name)
        program = job.read(setting)
        if setting.load is not None:
            program = replace(
                program, targets=tuple(target._replace(load=None) for target in program.targets))
        _require_loads(robot, program)
        chosen = chosen_points(program, arguments.points)
        reread = lambda contents, job=job: job.reread(contents, setting)
        tolerance = None if arguments.tolerance_mm is None else 1e-3 * arguments.tolerance_mm
        corrections.append(correct(program, model, chosen, setting.start, arguments.threads, reread,
                                   tolerance))
    _stop_at_refused(corrections, arguments)
    if odd := unmatched([c.program for c in corrections], arguments.points or "calculated"):
        raise InputError(f"--points {','.join(odd)}: no point of these programs has such a name")
    q_after = np.concatenate([c.q_after for c in corrections])
    arguments.progress.stage(TRUSTED)
    radius = model_uncertainty(robot, q_after, arguments.threads)
    written = [pair for c in corrections for pair in zip(c.program.files, c.contents)]
    return CommandResult(
        json=summary_of(corrections, frames, model, radius) | {"model_uncertainty": trust_json(radius)},
        report=report_of(robot, corrections, frames, model, radius),
        tables={"compensation.csv": compensation_table(corrections, radius)}
        | {f"{source.path!r}.parquet": target_table.columns_of(content) for source, content in written
           if isinstance(source.path, MemoryTable)},
        contents={source.path.name: content for source, content in written
                  if not isinstance(source.path, MemoryTable)},
        inputs=tuple(path
                     for path in (arguments.nominal,
                                  None if arguments.frames in ("nominal", "identified") else arguments.frames)
                     if path is not None))


def _check(robot: Robot, arguments: argparse.Namespace) -> None:
    if not robot.has_geometry:
        raise InputError(f"robot {robot.name}: expected a declared geometry, found drives only")
    if robot.controller.absolute_accuracy:
        raise InputError(
            f"robot {robot.name}: its controller corrects targets itself ([controller] absolute_accuracy); "
            "a program must not be corrected twice")
    out = None if arguments.out is None else real_path(arguments.out)
    for path in arguments.files:
        if isinstance(path, MemoryTable):
            continue
        if real_path(path).parent == out:
            raise InputError(
                "lies in the folder of results and would be overwritten; expected another --out", file=path)
        if path.name in RESULTS:
            raise InputError("has the name of a result; expected another name", file=path)
        if arguments.points in (None, "calculated") and (command := _written_by(path)) in (NAME, "plan"):
            raise InputError(f"{command} has written it for the real arm, says result.json beside it; a "
                             "second correction makes it wrong: expected the program before it, or --points "
                             "NAMES", file=path)
    if arguments.frame == "base":
        require_acting(arguments, add_arguments, {"session": "with --frame device"})
    else:
        if arguments.frames != "nominal":
            raise InputError(
                "--frame device: poses in the device's frame need no other base; expected --frames nominal")
        sessions = sorted(
            {int(name[8:].split(".")[0]) for name in robot.intervals if name.startswith("session_")})
        if arguments.session is not None and sessions and arguments.session != sessions[0]:
            raise InputError(
                f"--session {arguments.session}: the robot file holds the device frame of session "
                f"{sessions[0]}; expected that one, or a file calibrated with the other alone")


def _written_by(path: Path) -> str:
    """The command whose result.json beside a file counts it among its own; empty: none."""
    try:
        result = json.loads((path.parent / "result.json").read_text())
        return str(result["command"]) if path.name in result["files"] else ""
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _setting(robot: Robot, arguments: argparse.Namespace) -> Setting:
    load = None
    if arguments.payload:
        mass, x, y, z = read_numbers("--payload", arguments.payload, (4,))
        if mass < 0.0:
            raise InputError(f"--payload {arguments.payload}: expected a mass of 0 or more")
        if mass > MOST[PAYLOAD] or np.linalg.norm([x, y, z]) > FAR_M:
            raise InputError(f"--payload {arguments.payload}: expected kg, and its centre in m, within "
                             f"{FAR_M:g} m of the flange")
        if heavy := too_heavy(robot, mass):
            raise InputError(f"--payload {arguments.payload}: {heavy}")
        load = (mass, (x, y, z))
    start = None
    if arguments.start:
        start = np.array(read_numbers("--start", arguments.start, (robot.axes,)))
        start = np.where([joint.type == "revolute" for joint in robot.joints], np.radians(start), start)
    return Setting(robot, read_frames("--tool", arguments.tool), read_frames("--base", arguments.base), start,
                   load, arguments.frame == "device", dict(arguments.columns))


def _tip(job: Job, setting: Setting) -> Placement:
    """The tool that touched the reference points: the only one that --tool gives; the flange without one."""
    numbers, placement = list(setting.tools.values()), getattr(job.dialect, "placement", None)
    return placement(numbers[0]) if placement and len(numbers) == 1 else Placement()


def _require_frames(job: Job, setting: Setting) -> None:
    """As many numbers a frame as its controller shows."""
    count = getattr(job.dialect, "FRAME_NUMBERS", 6)
    for option, frames in (("--tool", setting.tools), ("--base", setting.bases)):
        for name, numbers in frames.items():
            if len(numbers) != count:
                raise InputError(f"{option} {name}: {len(numbers)} numbers; a frame of {job.dialect.NAME} "
                                 f"has {count}",
                                 file=job.paths[0])


def _require_loads(robot: Robot, program: Program) -> None:
    """Loads of targets that the arm may carry; each of them is looked at once."""
    for load, target in {target.load: target for target in reversed(program.targets)}.items():
        if load is not None and (heavy := too_heavy(robot, load[0])):
            raise InputError(f"{target.name}: its payload is {heavy}", file=program.files[target.file].path,
                             line=target.line)


def _stop_at_refused(corrections: list[Any], arguments: argparse.Namespace) -> None:
    refused = [error for correction in corrections for error in correction.refused]
    if refused and not arguments.keep_refused:
        more = f" (and {len(refused) - 1} more)" if len(refused) > 1 else ""
        raise InputError(
            f"{refused[0].message}{more}; nothing was written: name the points to correct with --points, or "
            "leave these as they are with --keep-refused", file=refused[0].file, line=refused[0].line)
