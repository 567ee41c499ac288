"""What a command hands back, and the two forms that numbers take in result.json."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Mapping, Sequence

import numpy as np

from exactarm.report.sections import Report
from exactarm.robot import Robot


@dataclass(frozen=True)
class CommandResult:
    """All results of one command; the frame writes them.

    json        the command's own keys of result.json (SI units; arrays and NaN are taken care of)
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


def error_summary(errors: np.ndarray) -> dict[str, Any]:
    """S of the errors (N,), each >= 0 or signed; mean, max, min and std are of their magnitudes."""
    magnitude = np.abs(np.asarray(errors, dtype=float).ravel())
    if magnitude.size == 0:
        return {"n": 0, "mean": None, "rms": None, "max": None, "min": None, "std": None}
    return {
        "n": int(magnitude.size),
        "mean": float(magnitude.mean()),
        "rms": float(np.sqrt(np.mean(magnitude**2))),
        "max": float(magnitude.max()),
        "min": float(magnitude.min()),
        "std": float(magnitude.std()),
    }
