"""`exactarm evaluate`: the error of a robot file, as it is, on data it has not seen."""

from __future__ import annotations

import argparse

import numpy as np

from exactarm.commands.arguments import add_files, add_robot
from exactarm.commands.result import CommandResult
from exactarm.dataset import Dataset, read_dataset
from exactarm.errors import InputError
from exactarm.identify.evaluate import EVALUATORS, Evaluation
from exactarm.report import Figure, Highlight, Highlights, Quantity, Report, Table, Warnings
from exactarm.report.numbers import quantity
from exactarm.report.plots.errors import error_histogram, error_per_pose
from exactarm.robot import Robot
from exactarm.robot_file import load_robot

NAME = "evaluate"
HELP = "the error of a robot file, as it is, on data it has not seen"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    add_files(parser)


def run(arguments: argparse.Namespace) -> CommandResult:
    robot = load_robot(arguments.robot)
    data = read_dataset(arguments.files, robot, arguments.kind)
    if data.kind not in EVALUATORS:
        raise InputError(f"evaluate judges {', '.join(EVALUATORS)}; found {data.kind}", file=arguments.files[0])
    arguments.progress.stage("evaluating")
    result = EVALUATORS[data.kind](robot, data, arguments.seed, arguments.threads)
    files = [source.path for source in data.sources]
    columns = {"file": [files[i] for i in data.file_index], "row": data.row, "session": data.session}
    columns[f"error_{result.unit.replace('/', '_')}"] = result.error
    columns |= {name: result.residual[:, k] for k, name in enumerate(result.columns)}
    return CommandResult(
        json={
            "error": result.overall.to_json(),
            "unit": result.unit,
            "sessions": [{"session": session} | summary.to_json() for session, summary in result.sessions],
            "warnings": list(result.warnings),
        },
        report=_report(robot, data, result),
        tables={"residuals.csv": columns},
    )


def _report(robot: Robot, data: Dataset, result: Evaluation) -> Report:
    s, unit = result.overall, result.unit
    verdict = (
        f"{robot.name} as its file describes it is off by {quantity(s.mean, unit)} on average, "
        f"by {quantity(s.max, unit)} at most ({s.n} rows; only the set-up was fitted)."
    )
    name = "position error" if data.kind == "poses" else "error"
    rows = tuple(
        (str(session), e.n, *(Quantity(v, unit) for v in (e.mean, e.rms, e.max, e.std)))
        for session, e in result.sessions
    )
    none = np.ones(len(result.error), bool)
    return Report(f"Evaluation of {robot.name}", verdict, (
        Highlights((
            Highlight("mean", Quantity(s.mean, unit)), Highlight("RMS", Quantity(s.rms, unit)),
            Highlight("maximum", Quantity(s.max, unit)),
        )),
        Table("By session", ("session", "rows", "mean", "RMS", "maximum", "std. dev."), rows),
        Figure("error_per_row", f"{name.capitalize()} of every row",
               lambda: error_per_pose(result.error, result.error, none, unit, name=name),
               "No row was used to fit the robot.", f"{name} against the row"),
        Figure("error_histogram", f"Distribution of the {name}",
               lambda: error_histogram(result.error, result.error, unit, name=name, of="rows"),
               "Number of rows by their error.", f"histogram of the {name}"),
        Warnings(result.warnings),
    ))
