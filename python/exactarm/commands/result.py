"""What a command hands back, and the form of an estimated number in result.json."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Mapping, Sequence

from exactarm.report.sections import Report
from exactarm.robot import Robot


@dataclass(frozen=True)
class CommandResult:
    """All results of one command; the frame writes them.

    json        the command's own keys of result.json (SI units; arrays, NaN, objects with to_json() may be in it)
    report      goes to the terminal, to report.html and, its figures, to plots/
    robot       written as robot.toml
    tables      file name -> columns (name with unit -> (N,) values); .csv or .parquet by the name
    texts       file name -> text written as it is (a .urdf, a .toml)
    inputs      further files that were read, beside the robot file and FILES
    """

    json: Mapping[str, Any]
    report: Report
    robot: Robot | None = None
    tables: Mapping[str, Mapping[str, Sequence]] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    inputs: tuple[Any, ...] = ()
    exit_code: int = 0


def estimate(value: float, low: float, high: float) -> dict[str, Any]:
    """An estimated number with its 95 % interval."""
    return {"value": value, "ci95": [low, high]}
