"""What `evaluate --at POSES` adds: the 95 % ellipsoid of the target's error at every pose."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from exactarm.commands.outcome import Column
from exactarm.commands.result import CommandResult
from exactarm.data.dataset import Dataset
from exactarm.identify.pose_uncertainty import PoseUncertainty
from exactarm.report import Cell, Figure, Quantity, Table
from exactarm.report.numbers import quantity
from exactarm.report.plots.style import figure_of_panel
from exactarm.report.plots.uncertainty import half_axes_per_pose

FILE = "uncertainty.csv"


def with_uncertainty(made: CommandResult, found: PoseUncertainty, poses: Dataset) -> CommandResult:
    """The result with `uncertainty`, `uncertainty_check`, a table and a figure."""
    radius = found.radius
    median, worst = quantity(float(np.median(radius)), "m"), quantity(float(radius.max()), "m")
    told = f"At the poses asked for, 95 % of the errors stay within {median} (median), {worst} at the worst."
    sections = made.report.sections
    report = replace(made.report, verdict=f"{made.report.verdict} {told}",
                     sections=(*sections[:1], *_sections(found), *sections[1:]))
    json = dict(made.json) | {
        "uncertainty": [_entry(found, poses, k) for k in range(len(radius))],
        "uncertainty_check": {"rows": found.rows, "scale": found.scale, "coverage": found.coverage,
                              "own_validation_rows": found.own,
                              "parameter_covariance": found.with_parameters}}
    tables = dict(made.tables) | {FILE: _table(found, poses)}
    return replace(made, json=json, report=report, tables=tables).warned(list(_warnings(found)))


def _entry(found: PoseUncertainty, poses: Dataset, k: int) -> dict[str, Any]:
    return {"row": int(poses.row[k]), "position_m": found.position[k], "covariance_m2": found.covariance[k],
            "ellipsoid95_m": found.half_axes[k], "radius95_m": float(found.radius[k])}


def _table(found: PoseUncertainty, poses: Dataset) -> dict[str, Column]:
    columns: dict[str, Column] = {"row": poses.row}
    columns |= {f"{axis}_m": found.position[:, i] for i, axis in enumerate("xyz")}
    columns |= {"radius95_m": found.radius}
    columns |= {f"half_axis_{i + 1}_m": found.half_axes[:, i] for i in range(3)}
    pairs = [(i, j) for i in range(3) for j in range(i, 3)]
    return columns | {f"c{'xyz'[i]}{'xyz'[j]}_m2": found.covariance[:, i, j] for i, j in pairs}


def _warnings(found: PoseUncertainty) -> Iterator[str]:
    if not found.with_parameters:
        yield ("the robot file carries no covariance of its parameters (calibrate or diagnose writes it): "
               "but for the frames the ellipsoid is as wide at every pose as the judged rows ask for")


def _sections(found: PoseUncertainty) -> tuple[Table | Figure, ...]:
    radius = found.radius
    which = "validation rows of the robot's own data" if found.own else "rows that the robot has not seen"
    rows: tuple[tuple[Cell, ...], ...] = (
        ("poses asked for", len(radius)),
        ("radius that holds 95 %, median", Quantity(float(np.median(radius)), "m")),
        ("smallest", Quantity(float(radius.min()), "m")),
        ("largest", Quantity(float(radius.max()), "m")),
        (f"judged by, {which}", found.rows),
        ("inside, of rows left out in turn", f"{100.0 * found.coverage:.1f} %"))
    note = (f"Ellipsoids from the estimates' covariance, curves of gears and noise, times {found.scale:.2f} "
            f"in variance so that the judged rows are held. One row a pose in `{FILE}`.")
    return (
        Table("Certified error", ("", ""), rows, note),
        figure_of_panel("uncertainty_per_pose", "Half axes of the 95 % ellipsoid at every pose",
                        partial(half_axes_per_pose, found.half_axes), 3.6,
                        "From the shortest to the longest half axis.",
                        "half axes of the ellipsoid against the pose"))
