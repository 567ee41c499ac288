"""What a command computed, and what was asked of it: plain values, which are then published or looked at."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import exactarm
from exactarm.data.rows import Source
from exactarm.report.sections import Report
from exactarm.robot.robot import Robot

Column = Sequence[Any] | np.ndarray


@dataclass(frozen=True)
class Asked:
    """What was asked: the command, the line that asks for it again, robot, files read, seed; the options that
    say how the files are read (words of a command line)."""

    command: str
    line: str
    robot: str | None = None
    files: tuple[Source, ...] = ()
    seed: int = 0
    reading: tuple[str, ...] = ()


_TOLD = ("command", "exactarm", "seed", "data", "date", "run", "previous")


def recorded(robot: Robot, asked: Asked) -> Robot:
    """The robot with a record of what made it: command, measured data, seed. What was so on record is
    `previous`. Date and run come with its file."""
    earlier = {key: robot.record[key] for key in _TOLD if key in robot.record}
    own = {key: value for key, value in robot.record.items() if key not in earlier}
    told = {"command": asked.command, "exactarm": exactarm.__version__, "seed": asked.seed,
            "data": [source.entry for source in asked.files if source.rows is not None]}
    return replace(robot, record=own | told | ({"previous": earlier} if earlier else {}))


@dataclass(frozen=True, eq=False)
class Outcome:
    """Everything that one command computed.

    json        the command's own keys of result.json (SI units; arrays, NaN, objects with to_json() may be in
                it)
    report      goes to the terminal, to report.html and, its figures, to plots/
    robot       written as robot.toml, with its record (`recorded`)
    tables      file name -> columns (name with unit -> (N,) values); .csv or .parquet by the name
    texts       file name -> text written as it is (a .urdf, a .toml)
    contents    file name -> bytes written as they are (a robot program)
    inputs      further files that were read, beside the robot file and FILES
    asked       what was asked, for the report's last lines
    data        measured rows that a simulation made, ready for the next command; else None
    pdf         name of the report printed as PDF beside report.html, where a browser is there to print; None:
                not asked for
    """

    json: Mapping[str, Any]
    report: Report
    robot: Robot | None = None
    tables: Mapping[str, Mapping[str, Column]] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    contents: Mapping[str, bytes] = field(default_factory=dict)
    inputs: tuple[Any, ...] = ()
    exit_code: int = 0
    asked: Asked | None = None
    data: Any = None
    pdf: str | None = None
