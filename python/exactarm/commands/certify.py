"""`exactarm certify`: one page that says how good an arm is before and after, on poses that were never
fitted."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.commands.about import KEYS, about_of, add_about
from exactarm.commands.arguments import add_files, add_robot
from exactarm.commands.calibrate import require_poses
from exactarm.commands.call import (
    AnyData,
    AnyRobot,
    asked,
    command,
    data_of,
    files_among,
    listed,
    robot_of,
    table_option,
    threads_of,
)
from exactarm.commands.certify_report import Certified, certificate, results_of
from exactarm.commands.memory import within_memory
from exactarm.commands.output import PICTURES
from exactarm.commands.plain import sha256
from exactarm.commands.result import CommandResult
from exactarm.commands.steps import CHECKING, JUDGING, READING, STEPS
from exactarm.commands.suspicions import suspicions
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import TRACKED_MOTION
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.identify.statistics import summarise
from exactarm.numerics.stamps import typical_step
from exactarm.progress import SILENT, Progress
from exactarm.robot.controller_frames import in_base
from exactarm.robot.robot import Placement, Robot
from exactarm.verify.held_out import Judged, choose_rows, controllers_robot, judge
from exactarm.verify.iso_9283 import iso_9283
from exactarm.verify.iso_orientation import iso_orientation
from exactarm.verify.iso_path import path_tests
from exactarm.verify.uncertainty import budget, by_region

NAME = "certify"
HELP = "a certificate: the arm before and after by ISO 9283 and on held-out poses, with its uncertainty"
PDF = "certificate.pdf"
WRITES = (*PICTURES, "residuals.csv", PDF)
_SLOWEST_LOG_S = 1.0  # of a tracker along a path: ten times the step of the slowest ones


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    add_files(parser)
    parser.add_argument("--before", metavar="ROBOT",
                        help="the model to compare with (default: the chain that the controller works with)")
    parser.add_argument(
        "--path", metavar="FILE", type=Path, action="append", default=[],
        help="tracked motion along a path, several cycles (AT, RT), in the poses' set-up; may be repeated")
    add_about(parser)


@command
def certify(robot: AnyRobot, data: AnyData, *, before: AnyRobot | None = None, path: AnyData = (),
            about: str | Path | Mapping[str, Any] | None = None, seed: int = DEFAULT_SEED,
            threads: int | None = None, kind: str | None = None, progress: Progress = SILENT,
            **details: Any) -> CommandResult:
    """Judges an identified robot on poses that were never fitted, beside what its controller calculates, with
    a budget of uncertainty.

    before: another model to compare with. path: tracked motions along a path, several cycles, in the
    set-up of the poses. about: a file or mapping of what the certificate says of arm and
    instrument (`serial`, `instrument`, `instrument_u_mm`, `measured`, ...); each may also be given by name.

        >>> import exactarm as ea
        >>> result = ea.certify("ur10", ea.example("ur10/series_B"), serial="2012300001")
        >>> result["about"]["serial"], result["before"]["validation"]["n"] > 500
        ('2012300001', True)
    """
    unknown = next((name for name in details if name not in KEYS), None)
    if unknown is not None:
        raise InputError(f"no option {unknown!r}; expected one of {', '.join(KEYS)}")
    told = about_of(about, details)
    progress.plan(STEPS["certify"])
    progress.stage(READING)
    arm = robot_of(robot)
    rows = require_poses(data_of(data, arm, kind))
    earlier = controllers_robot(arm) if before is None else robot_of(before)
    if earlier.axes != arm.axes:
        raise InputError(
            f"--before: {earlier.axes} axes, the robot has {arm.axes}; expected a model of the same arm")
    paths: list[Any] = [table_option(each, f"path_{i}") for i, each in enumerate(listed(path), start=1)]
    followed = _followed(paths, arm, rows)
    progress.stage(CHECKING)
    within_memory("evaluate", rows.kind, rows)
    with suspicions(arm, rows, *followed) as found:
        progress.stage(JUDGING)
        certified = _certify(arm, earlier, rows, followed, told, seed, threads_of(threads))
    read = (about, before, *(source.path for each in followed for source in each.sources))
    shown = paths[0] if len(paths) == 1 else paths or None
    options = {"before": before, "path": shown, "about": about, **details}
    json = results_of(certified)
    json["robot_sha256"] = sha256(robot) if isinstance(robot, (str, Path)) and os.path.isfile(robot) else None
    return CommandResult(
        json=json, report=certificate(certified), tables={"residuals.csv": _table(certified)},
        inputs=files_among(*read, *paths), pdf=PDF,
        asked=asked("certify", robot, rows, seed, options, dict.fromkeys(options))).warned(found)


def run(arguments: argparse.Namespace) -> CommandResult:
    return certify(arguments.robot, arguments.files, before=arguments.before, path=arguments.path,
                   about=arguments.about, seed=arguments.seed, threads=arguments.threads, kind=arguments.kind,
                   progress=arguments.progress,
                   **{key: getattr(arguments, key) for key in KEYS if getattr(arguments, key) is not None})


def _followed(path: AnyData, arm: Robot, poses: Dataset) -> tuple[Dataset, ...]:
    """Tracked motions, file by file: a file without a column `session` was measured in the poses' set-up."""
    found = tuple(data_of(file, arm, TRACKED_MOTION.name) for file in listed(path))
    for data in found:
        same = {source.sha256 for source in data.sources} & {source.sha256 for source in poses.sources}
        if same:
            raise InputError("--path: the file of the poses; expected a motion along a path",
                             file=data.first_file)
        time = np.asarray(data.time)[data.run == data.run[0]]
        if (step := typical_step(time)) > _SLOWEST_LOG_S:
            raise InputError(f"--path: rows {step:.3g} s apart, as of poses at rest; expected a motion, rows "
                             f"{_SLOWEST_LOG_S:g} s apart or less", file=data.first_file)
    return found


def _certify(arm: Robot, earlier: Robot, data: Dataset, followed: tuple[Dataset, ...], told: dict[str, Any],
             seed: int, threads: int) -> Certified:
    rows = choose_rows((arm, earlier), data, seed)
    before, after = (judge(each, data, rows, seed, threads) for each in (earlier, arm))
    judged = data.select(rows.judged)
    instrument = told.get("instrument_u_mm")
    points = _in_first_frame(judged, after)
    return Certified(
        robot=arm, earlier=earlier, data=judged, rows=rows, about=told, before=before, after=after,
        points=in_base(arm, points),
        summaries=(summarise(before.error), summarise(after.error)),
        iso=iso_9283(judged, before.residual, after.residual, after.predicted, before.predicted, seed),
        orientation=None if before.turn is None or after.turn is None
        else iso_orientation(judged, before.turn, after.turn, after.base),
        paths=path_tests((earlier, arm), (before, after), followed),
        budget=budget(judged, after, None if instrument is None else 1e-3 * instrument),
        regions=by_region(points, in_base(arm, points), before.error, after.error))


def _in_first_frame(data: Dataset, judged: Judged) -> np.ndarray:
    """(M, 3) where the target was, in DH frame 0."""
    assert data.position is not None  # poses have one
    points = np.empty((len(data), 3))
    for session in np.unique(data.session):
        base = Placement()
        for effect in judged.fit.layout.effects:
            base = effect.place(int(session), base, Placement())[0]
        here = data.session == session
        points[here] = (data.position[here] - base.position) @ base.rotation
    return points


def _table(certified: Certified) -> dict[str, Any]:
    data, after = certified.data, certified.after
    files = [source.path for source in data.sources] or [""]
    columns = {"file": [files[i] for i in data.file_index],
               "row": data.row,
               "session": data.session,
               "error_before_m": certified.before.error,
               "error_after_m": after.error}
    columns |= {f"d{axis}_m": after.residual[:, i] for i, axis in enumerate("xyz")}
    return columns | {f"{axis}_base_m": certified.points[:, i] for i, axis in enumerate("xyz")}
