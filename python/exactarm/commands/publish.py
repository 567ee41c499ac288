"""From a `Outcome` to the files of a run and the text on the terminal."""

import os
import platform
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from glob import escape
from importlib import metadata
from pathlib import Path
from typing import Any

import exactarm
from exactarm.commands.next_steps import with_lines
from exactarm.commands.outcome import Asked, Outcome
from exactarm.commands.output import ALWAYS, PICTURES, ROBOT_FILES, OutputFolder
from exactarm.commands.plain import plain, rows_of, sha256
from exactarm.data.rows import Source
from exactarm.errors import ComputationError, InputError
from exactarm.files.memory_table import MemoryTable
from exactarm.progress import SILENT, Progress
from exactarm.report.html import render_html
from exactarm.report.plots.files import draw
from exactarm.report.printing import print_page
from exactarm.report.sections import Report
from exactarm.report.terminal import render_text
from exactarm.robot.robot import Robot

_SHORT_HASH = 12  # characters of a SHA-256 that are shown; result.json has all
_NUMERICS = ("numpy", "scipy")


@dataclass(frozen=True)
class Published:
    """A run that is done: its result, its result.json, its report as written, and what the terminal shows."""

    result: Outcome
    json: dict[str, Any]
    report: Report
    text: str


def save(result: Outcome, folder: str | Path, progress: Progress = SILENT) -> Path:
    """Writes a result that Python holds; returns the path of its report."""
    started = time.perf_counter()
    files = result.asked.files if result.asked else ()
    read = [*map(str, result.inputs), *(source.path for source in files)]
    with OutputFolder(Path(folder), _names(result), read) as place:
        publish(result, place, started, progress)
    return Path(folder) / "report.html"


def _names(result: Outcome) -> list[str]:
    """Of all files that `publish` writes, as patterns."""
    robot = ROBOT_FILES if result.robot is not None else ()
    pictures = PICTURES if result.report.figures else ()
    own = [*result.tables, *result.texts, *result.contents, *([result.pdf] if result.pdf else [])]
    return [*ALWAYS, *robot, *pictures, *map(escape, own)]


def publish(result: Outcome, folder: OutputFolder, started: float, progress: Progress = SILENT,
            width: int | None = None) -> Published:
    """Writes everything, `result.json` last."""
    asked = result.asked or Asked("computed", "")
    asked = replace(asked, files=asked.files + sources(result.inputs, asked.files))
    made = datetime.now(UTC).isoformat(timespec="seconds")
    report = with_lines(result.report, result, asked, folder.path)
    report = replace(report, details=_details(asked, made) | {"run": folder.run})
    for file, columns in result.tables.items():
        folder.write_table(file, columns)
    for file, text in result.texts.items():
        folder.write_text(file, text)
    for file, content in result.contents.items():
        folder.place(file).write_bytes(content)
    if result.robot is not None:
        _write_robot(result.robot, made, folder)
    drawings = draw(report.figures, folder.place, progress)
    folder.write_text("report.html", render_html(report, drawings))
    printed = _print(result.pdf, folder, progress)
    seconds = time.perf_counter() - started
    common = {"exactarm": exactarm.__version__,
              "command": asked.command,
              "robot": asked.robot,
              "inputs": [{"file": source.path, "sha256": source.sha256, "rows": source.rows}
                         for source in asked.files],
              "seed": asked.seed,
              "seconds": round(seconds, 3),
              "asked": asked.line}
    json = plain(common | dict(result.json) | printed)
    folder.write_result(json)
    folder.publish([source.path for source in asked.files])
    text = render_text(report, width) + f"\n{folder.path}/report.html  ({seconds:.1f} s)\n"
    if printed:
        text += (f"{folder.path}/{result.pdf}\n" if printed["pdf"]["file"]
                 else f"no PDF: {printed['pdf']['why']}\n")
    return Published(result, json, report, text)


def sources(paths: Iterable[Any], known: tuple[Source, ...] = ()) -> tuple[Source, ...]:
    """Path, SHA-256 and number of data rows of every path that is a file, and of tables in memory, once
    each."""
    seen = {source.path for source in known}
    read = {str(path): path for path in paths if str(path) not in seen}
    return tuple(Source(name, path.sha256, path.rows) if isinstance(path, MemoryTable)
                 else Source(name, sha256(path), rows_of(Path(path)))
                 for name, path in read.items() if isinstance(path, MemoryTable) or os.path.isfile(path))


def _print(name: str | None, folder: OutputFolder, progress: Progress) -> dict[str, Any]:
    """The page as PDF, where a result asks for one; what became of it for result.json."""
    if name is None:
        return {}
    progress.stage("printing")
    why = print_page(folder.place("report.html"), folder.place(name))
    return {"pdf": {"file": None if why else name, "why": why}}


def _details(asked: Asked, made: str) -> dict[str, str]:
    """The last lines of a page: enough to do it again and to see that it is the same."""
    told = {"asked": f"`{asked.line}`"} if asked.line else {}
    told |= {"robot": asked.robot} if asked.robot else {}
    rows = lambda source: f", {source.rows} rows" if source.rows is not None else ""
    files = [f"{source.path}{rows(source)}, SHA-256 {source.sha256[:_SHORT_HASH]}" for source in asked.files]
    told |= {"files": "; ".join(files)} if files else {}
    others = ", ".join(f"{name} {metadata.version(name)}" for name in _NUMERICS)
    versions = f"exactarm {exactarm.__version__}, Python {platform.python_version()}, {others}"
    return told | {"seed": str(asked.seed), "versions": versions, "date": made}


def _write_robot(robot: Robot, made: str, folder: OutputFolder) -> None:
    """The robot file; its record gets date and run."""
    from exactarm.robot.urdf import read_urdf, write_urdf
    from exactarm.robot_file import read_robot, write_robot

    record = robot.record | {"date": made, "run": folder.run}
    write_robot(folder.place("robot.toml"), replace(robot, record=record))
    _require_readable(read_robot, folder.place("robot.toml"))
    if robot.has_geometry:
        write_urdf(folder.place("robot.urdf"), robot)
        _require_readable(read_urdf, folder.place("robot.urdf"))


def _require_readable(read: Callable[[Path], Robot], path: Path) -> None:
    """A run is done when our own reader takes what it wrote: the best fit may have a negative mass."""
    try:
        read(path)
    except InputError as error:
        raise ComputationError(f"the estimated robot is none, nothing was written: {error.message}") from None
