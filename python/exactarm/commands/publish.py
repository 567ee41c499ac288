"""From a `CommandResult` to the files of a run and the text on the terminal."""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Callable

import exactarm
from exactarm.commands.output import OutputFolder, describe_inputs, plain
from exactarm.commands.result import CommandResult
from exactarm.errors import ComputationError, InputError
from exactarm.report.html import render_html
from exactarm.report.plots.files import draw
from exactarm.report.sections import Report
from exactarm.report.terminal import render_text
from exactarm.robot import Robot


@dataclass(frozen=True)
class Published:
    """A run that is done: its result, its result.json, its report as written, and what the terminal shows."""

    result: CommandResult
    json: dict[str, Any]
    report: Report
    text: str


def publish(command: str, arguments: argparse.Namespace, result: CommandResult, folder: OutputFolder,
            started: float) -> Published:
    """Writes everything, `result.json` last."""
    name = getattr(arguments, "robot", None)
    read = [*([name] if name else []), *(getattr(arguments, "files", None) or []), *result.inputs]
    inputs = describe_inputs(read)
    report = replace(result.report, details=_details(command, name, inputs, arguments.seed) | {"run": folder.run})
    for file, columns in result.tables.items():
        folder.write_table(file, columns)
    for file, text in result.texts.items():
        folder.write_text(file, text)
    if result.robot is not None:
        _write_robot(result.robot, command, inputs, folder)
    drawings = draw(report.figures, folder.place, arguments.progress)
    folder.write_text("report.html", render_html(report, drawings))
    seconds = time.perf_counter() - started
    common = {
        "exactarm": exactarm.__version__,
        "command": command,
        "robot": name,
        "inputs": inputs,
        "seed": arguments.seed,
        "seconds": round(seconds, 3),
    }
    json = plain(common | dict(result.json))
    folder.write_result(json)
    folder.publish(read)
    text = render_text(report) + f"\n{folder.path}/report.html  ({seconds:.1f} s)\n"
    return Published(result, json, report, text)


def _details(command: str, robot: str | None, inputs: list[dict[str, Any]], seed: int) -> dict[str, str]:
    details = {"command": f"exactarm {command} (version {exactarm.__version__})"}
    if robot:
        details["robot"] = robot
    rows = [f"{entry['file']}" + (f" ({entry['rows']} rows)" if entry["rows"] is not None else "") for entry in inputs]
    return details | ({"files": ", ".join(rows)} if rows else {}) | {"seed": str(seed)}


def _write_robot(robot: Robot, command: str, inputs: list[dict[str, Any]], folder: OutputFolder) -> None:
    """The robot file, with a record of which command made it, from which data and when."""
    from exactarm.robot_file import read_robot, write_robot
    from exactarm.urdf import read_urdf, write_urdf

    made = {
        "command": command,
        "exactarm": exactarm.__version__,
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "run": folder.run,
        "data": [{"file": entry["file"], "sha256": entry["sha256"]} for entry in inputs if entry["rows"] is not None],
    }
    earlier = {key: value for key, value in robot.record.items() if key in made or key == "previous"}
    own = {key: value for key, value in robot.record.items() if key not in earlier}
    record = own | made | ({"previous": earlier} if earlier else {})
    write_robot(folder.place("robot.toml"), replace(robot, record=record))
    _require_readable(read_robot, folder.place("robot.toml"))
    if robot.has_geometry:
        write_urdf(folder.place("robot.urdf"), robot)
        _require_readable(read_urdf, folder.place("robot.urdf"))


def _require_readable(read: Callable[[Path], Robot], path: Path) -> None:
    """A run is done when our own reader takes what it wrote: a negative mass fits data, but no robot has one."""
    try:
        read(path)
    except InputError as error:
        raise ComputationError(f"the estimated robot is none, nothing was written: {error.message}") from None
