"""`exactarm gear`: gear ratio and its harmonics per axis and direction, from gear runs."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

from exactarm.commands.arguments import add_files, add_robot
from exactarm.commands.call import AnyData, AnyRobot, asked, command, data_of, robot_of, threads_of
from exactarm.commands.gear_report import gear_report
from exactarm.commands.memory import within_memory
from exactarm.commands.outcome import recorded
from exactarm.commands.output import PICTURES, ROBOT_FILES
from exactarm.commands.result import CommandResult, estimate
from exactarm.commands.steps import CHECKING, READING, STEPS
from exactarm.commands.suspicions import suspicions
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import GEAR_RUN
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.identify.gear import Gear, GearIdentification, identify_gears, why_dropped
from exactarm.identify.gear_orders import METHODS
from exactarm.progress import SILENT, Progress

NAME = "gear"
HELP = "gear ratio and its harmonics per axis and direction, from gear runs"
WRITES = (*ROBOT_FILES, *PICTURES, "residuals.csv")
_LEVEL = 1.96  # a million samples: Student's t is the normal distribution


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    add_files(parser, text="gear runs: motor angles and a gyroscope, or encoders on both sides (.csv, "
                           ".parquet)")
    parser.add_argument("--method", choices=METHODS, default=METHODS[0],
                        help="orders as real numbers, or whole numbers with their neighbours (default "
                             "%(default)s; both are compared in the report)")


@command
def gear(robot: AnyRobot, data: AnyData, *, method: str = METHODS[0], seed: int = DEFAULT_SEED,
         threads: int | None = None, kind: str | None = None, progress: Progress = SILENT) -> CommandResult:
    """Identifies the gear ratio and its harmonics per axis and direction, from gear runs.

    method: orders as real numbers ("refined"), or whole numbers with their neighbours, as the source has
    them.
    """
    progress.plan(STEPS["gear"])
    progress.stage(READING)
    declared = robot_of(robot)
    rows = data_of(data, declared, kind)
    if GEAR_RUN.name not in rows.kinds:
        raise InputError(f"expected gear runs (gyroscope, or encoders on both sides), found {rows.kind}",
                         file=rows.first_file)
    progress.stage(CHECKING)
    within_memory("gear", GEAR_RUN.name, rows)
    with suspicions(declared, replace(rows, kind=GEAR_RUN.name, kinds=(GEAR_RUN.name,))) as found:
        result = identify_gears(declared, rows, method=method, seed=seed, threads=threads_of(threads),
                                progress=progress)
    call = asked("gear", robot, rows, seed, {"method": method}, {"method": METHODS[0]})
    return CommandResult(
        json={"gears": [gear_json(gear) for gear in result.gears],
              "dropped": [{"parameter": f"order {order:.6g} of gear {joint}", "why": why_dropped(estimate)}
                          for joint, estimate in {gear.joint: gear.estimate for gear in result.gears}.items()
                          for order in estimate.dropped],
              "method": result.method,
              "alignment": [
                  {"joint": a.joint, "direction": a.side, "alpha_rad": a.angles[0], "beta_rad": a.angles[1],
                   "mean_before_rad_s": a.before, "mean_after_rad_s": a.after} for a in result.alignments],
              "comparison": [
                  {"joint": h.joint, "direction": h.side, "speed_rad_s": h.speed,
                   "set": "identification" if h.fitted else "validation", "n": h.rows, "rms_before": h.before,
                   "rms_after": h.after} for h in result.held_out],
              "converged": result.converged,
              "warnings": list(result.warnings)},
        report=gear_report(declared, result, rows.split_rule()),
        robot=recorded(result.robot, call),
        tables={"residuals.csv": _residuals(rows, result)},
        asked=call).warned(found)


def run(arguments: argparse.Namespace) -> CommandResult:
    return gear(arguments.robot, arguments.files, method=arguments.method, seed=arguments.seed,
                threads=arguments.threads, kind=arguments.kind, progress=arguments.progress)


def gear_json(gear: Gear) -> dict[str, Any]:
    """One direction of one axis, as the list `gears` has it."""
    table, fit = gear.table, gear.estimate.tables[gear.side]
    sigma = np.sqrt(np.diag(fit.covariance))
    spread = lambda value, deviation: estimate(float(value), float(value - _LEVEL * deviation),
                                               float(value + _LEVEL * deviation))
    m = table.order.size
    return {
        "joint": gear.joint,
        "direction": gear.side,
        "unit": gear.unit,
        "ratio": spread(gear.estimate.ratio, gear.estimate.ratio_sigma),
        "harmonics": [{"order": spread(order, deviation), "a": spread(a, s_a), "b": spread(b, s_b)}
                      for order, deviation, a, s_a, b, s_b in zip(
                          table.order, gear.estimate.order_sigma, table.a, sigma[:m], table.b, sigma[m:])],
        "before": {name: summary.to_json() for name, summary in gear.before.items()},
        "after": {name: summary.to_json() for name, summary in gear.after.items()},
        "declared": {name: summary.to_json() for name, summary in gear.declared.items()},
        "rest": {name: summary.to_json() for name, summary in gear.rest.items()},
        "unfiltered": {name: summary.to_json() for name, summary in gear.unfiltered.items()},
        "noise": gear.noise,
        "cutoff_hz": gear.cutoff_hz,
        "disturbances": dict(zip(gear.samples.disturbance_names, gear.estimate.disturbance.tolist()))}


def _residuals(data: Dataset, result: GearIdentification) -> dict[str, Any]:
    """Kinematic error before and after of every row that counts."""
    files = [source.path for source in data.sources] or [""]
    columns: dict[str, list[Any]] = {}
    for gear in result.gears:
        samples = gear.samples
        chosen = samples.side(-1.0 if gear.side == "cw" else 1.0)
        rows = samples.rows[chosen]
        unit = gear.unit.replace("/", "_")
        parts = {"file": np.array(files, object)[data.file_index[rows]],
                 "row": data.row[rows],
                 "run": data.run[rows],
                 "joint": np.full(rows.size, gear.joint),
                 "direction": np.full(rows.size, gear.side, object),
                 "set": np.where(samples.identification[chosen], "identification", "validation"),
                 "angle_rad": samples.angle[chosen] / gear.estimate.scale,
                 f"error_before_{unit}": gear.error_before[chosen],
                 f"error_after_{unit}": gear.error_after[chosen]}
        for name, values in parts.items():
            columns.setdefault(name, []).append(values)
    return {name: np.concatenate(parts) for name, parts in columns.items()}
