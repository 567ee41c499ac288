"""`exactarm identify`: inertial parameters, rotors and friction from motion data."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from exactarm.commands.arguments import add_files, add_robot, add_sessions
from exactarm.commands.calibrate import dropped_table
from exactarm.commands.call import (
    AnyData,
    AnyRobot,
    AnyTable,
    asked,
    command,
    data_of,
    files_among,
    robot_of,
    table_option,
    threads_of,
)
from exactarm.commands.error_sections import SETS, error_table, highlights, parameter_table
from exactarm.commands.load_section import with_payload_section
from exactarm.commands.memory import within_memory
from exactarm.commands.next_steps import next_steps
from exactarm.commands.outcome import recorded
from exactarm.commands.output import PICTURES, ROBOT_FILES
from exactarm.commands.result import CommandResult, estimate
from exactarm.commands.steps import CHECKING, READING, STEPS
from exactarm.commands.suspicions import suspicions
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import MOTION
from exactarm.data.split import DEFAULT_SEED
from exactarm.effects.units_in_names import unit_of
from exactarm.errors import InputError
from exactarm.identify.dynamics import (
    DynamicsIdentification,
    DynamicsOptions,
    friction_layout,
    identify_dynamics,
    inertial_layout,
    with_links,
)
from exactarm.identify.statistics import summarise
from exactarm.progress import SILENT, Progress
from exactarm.report import Cell, Estimate, Figure, Quantity, Report, Table, Warnings
from exactarm.report.numbers import change, quantity
from exactarm.report.plots.curves import curves_per_axis
from exactarm.robot.robot import Robot

NAME = "identify"
HELP = "identify masses, rotors and friction from motion data"
WRITES = (*ROBOT_FILES, *PICTURES, "residuals.csv", "payloads.csv")
_NANOMETRE = 9  # decimals of a metre: a centre on an axis is there but for rounding


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    add_files(parser)
    add_sessions(parser)
    parser.add_argument("--bandwidth", metavar="HZ", type=float, default=None,
                        help="low-pass on measurement and prediction alike (default: 20 Hz, none for slow "
                             "logs)")
    parser.add_argument("--share", metavar="PART", type=float, default=0.7,
                        help="part of the rows that is fitted, where the data do not say (default "
                             "%(default)s)")
    parser.add_argument("--friction-only", action="store_true",
                        help="keep masses and rotors as declared, estimate Coulomb and viscous friction")


@command
def identify(robot: AnyRobot, data: AnyData, *, bandwidth_hz: float | None = None, share: float = 0.7,
             friction_only: bool = False,
             seed: int = DEFAULT_SEED, threads: int | None = None, kind: str | None = None,
             sessions: AnyTable | None = None, progress: Progress = SILENT) -> CommandResult:
    """Identifies inertial parameters, rotors and friction from motions with torques or currents.

    bandwidth_hz: low-pass on measurement and prediction (None: 20 Hz, none for slow logs). share: part of the
    rows that is fitted, where the data do not say. friction_only: masses and rotors stay as declared.
    sessions: a table of what holds for whole sessions; a payload_kg that is empty there is estimated.
    """
    sessions = table_option(sessions, "sessions")
    given = {"bandwidth_hz": bandwidth_hz, "share": share, "friction_only": friction_only,
             "kind": kind, "sessions": sessions}
    progress.plan(STEPS["identify"])
    progress.stage(READING)
    declared = robot_of(robot)
    rows = require_motion(data_of(data, declared, kind, sessions=sessions, weighs=(MOTION.name,)))
    options = DynamicsOptions(
        bandwidth_hz=_bandwidth(bandwidth_hz), share=_share(share), inertial=not friction_only, seed=seed,
        threads=threads_of(threads))
    progress.stage(CHECKING)
    within_memory("identify", MOTION.name, rows)
    with suspicions(declared, rows) as found:
        result = identify_dynamics(declared, rows, options, progress.stage)
    call = asked("identify", robot, rows, seed, given,
                 {"bandwidth_hz": None, "share": 0.7, "friction_only": False})
    made = CommandResult(
        json=_json(result),
        report=_report(declared, result, rows.split_rule(options.share)),
        robot=recorded(result.robot, call),
        tables={"residuals.csv": residual_table(result)},
        inputs=files_among(sessions),
        asked=call).warned(found)
    return with_payload_section(made, result.payloads, "The links are those without it.")


def run(arguments: argparse.Namespace) -> CommandResult:
    return identify(arguments.robot, arguments.files, bandwidth_hz=arguments.bandwidth, share=arguments.share,
                    friction_only=arguments.friction_only, seed=arguments.seed, threads=arguments.threads,
                    kind=arguments.kind, sessions=arguments.sessions, progress=arguments.progress)


def require_motion(data: Dataset) -> Dataset:
    if MOTION.name not in data.kinds:
        raise InputError("expected a motion (torques or currents over time), found "
                         f"{data.kind.replace('_', ' ')}",
                         file=data.sources[0].path if data.sources else None)
    return data


def _bandwidth(value: float | None) -> float | None:
    if value is not None and not value > 0.0:
        raise InputError(f"--bandwidth {value}: expected a positive number of Hz")
    return value


def _share(value: float) -> float:
    if not 0.0 < value < 1.0:
        raise InputError(f"--share {value}: expected a number between 0 and 1")
    return value


def torque_summary(residual: np.ndarray, axes: np.ndarray) -> dict[str, Any]:
    """S over all samples and axes of a residual (N, m), with a list of S per axis."""
    rows = [{"joint": int(axis) + 1} | summarise(np.abs(residual[:, k])).to_json()
            for k, axis in enumerate(axes)]
    return summarise(np.abs(residual).ravel()).to_json() | {"axes": rows}


def _json(result: DynamicsIdentification) -> dict[str, Any]:
    empty = np.zeros((0, len(result.fit.axes)))
    pairs = zip(result.fit.layout.names, result.fit.fit.x, result.fit.intervals)
    base = result.base
    return {
        "unit": "Nm",
        "before": {name: torque_summary(result.before.get(name, empty), result.fit.axes) for name in SETS},
        "after": {name: torque_summary(result.after.get(name, empty), result.fit.axes) for name in SETS},
        "unconstrained": {name: torque_summary(result.unconstrained.get(name, empty), result.fit.axes)
                          for name in SETS},
        "parameters": {name: estimate(float(x), float(low), float(high)) for name, x, (low, high) in pairs},
        "base_parameters": {base.names[column]: base.group(k) for k, column in enumerate(base.kept)},
        "base_values": {name: estimate(*told) for name, (_, *told) in _sums(result).items()},
        "dropped": [{"parameter": entry.name, "why": entry.why} for entry in result.dropped],
        "noise_Nm": {f"axis_{axis + 1}": float(s) for axis, s in zip(result.fit.axes, result.fit.sigma)},
        "bandwidth_hz": result.records["identification"].bandwidth_hz,
        "converged": result.fit.fit.converged,
        "warnings": list(result.warnings)}


def residual_table(result: DynamicsIdentification) -> dict[str, Any]:
    """Columns of residuals.csv: time, run, set, then residual before and after of every axis."""
    columns: dict[str, list[Any]] = {"time_s": [], "run": [], "set": []}
    for name, record in result.records.items():
        columns["time_s"].append(record.data.sample_times[record.keep])
        columns["run"].append(record.data.run[record.keep])
        columns["set"].append(np.full(int(record.keep.sum()), name))
        for k, axis in enumerate(result.fit.axes):
            for when, residual in (("before", result.before), ("after", result.after)):
                columns.setdefault(f"residual_{when}_{axis + 1}_Nm", []).append(residual[name][:, k])
    return {name: np.concatenate(parts) for name, parts in columns.items()}


def _report(robot: Robot, result: DynamicsIdentification, rule: str) -> Report:
    summaries = {when: {name: summarise(np.abs(residual.get(name, np.zeros(0))).ravel()) for name in SETS}
                 for when, residual in (("before", result.before), ("after", result.after))}
    judge = "validation" if summaries["after"]["validation"].n else "identification"
    before, after = summaries["before"][judge], summaries["after"][judge]
    who = "motion that was never fitted" if judge == "validation" else "the fitted motion (none was held out)"
    verdict = (
        f"The RMS error of the drive torque on {who} {change(before.rms, after.rms, 'Nm')} over all axes.")
    cost = float(np.sqrt(np.mean(result.unconstrained[judge] ** 2)))
    if result.inertial:
        verdict += (" The links are physically consistent; without that constraint it would be "
                    f"{quantity(cost, 'Nm')}.")
    band = result.records["identification"].bandwidth_hz
    note = "Before: the robot file as it is. " + rule
    note += f" Measured and predicted torque passed the same low-pass at {band:.3g} Hz." if band else ""
    return Report(
        f"Dynamics of {robot.name}", verdict,
        (highlights(summaries["before"], summaries["after"], "Nm"),
         next_steps(robot, MOTION, before.rms, after.rms),
         error_table(summaries["before"], summaries["after"], "Nm", "Torque error", note),
         _axis_table(result, judge), *_bodies(result), _figure(result, judge), _parameters(robot, result),
         _groups(result),
         dropped_table(result.dropped, "Friction and rotors keep their declared values; inertial parameters "
                       "follow the bodies that the links are drawn to."),
         Warnings(result.warnings)),
        "good" if after.rms < before.rms else "caution")


def _axis_table(result: DynamicsIdentification, judge: str) -> Table:
    rms = lambda residual: np.sqrt(np.mean(residual[judge] ** 2, axis=0))
    torque = result.records[judge].torque[result.records[judge].keep][:, result.fit.axes]
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (f"axis {axis + 1}", *(Quantity(float(value), "Nm") for value in values))
        for axis, *values in zip(result.fit.axes, np.sqrt(np.mean(torque**2, axis=0)), rms(result.before),
                                 rms(result.after)))
    return Table(f"Axes, {judge}", ("", "RMS of the torque", "RMS error before", "RMS error after"), rows)


def _bodies(result: DynamicsIdentification) -> tuple[Table, ...]:
    """Mass, centre and principal moments of every link, and the motion that decides them."""
    if not result.inertial:
        return ()
    rows: list[tuple[Cell, ...]] = []
    for number, link in enumerate(result.robot.links or (), start=1):
        moments = np.linalg.eigvalsh(link.inertia)
        centre = (Quantity(round(float(value), _NANOMETRE), "m") for value in link.centre_of_mass)
        rows.append((f"link {number}", Quantity(link.mass, "kg"), *centre,
                     *(Quantity(float(value), "kg m²") for value in moments)))
    drawn_to = "its declared mass, centre and inertia" if result.declared_bodies else (
        "a plain bar from joint to joint, all of them as heavy together as the motion asks")
    return (Table("Links as bodies", ("", "mass", "centre x", "y", "z", "moment: least", "middle", "largest"),
                  tuple(rows),
                  "Every link has a positive mass and moments that a body can have (positive definite "
                  "pseudo-inertia). What the "
                  f"motion does not show is drawn to {drawn_to}: a possible body, not the true one."),)


def _figure(result: DynamicsIdentification, judge: str) -> Figure:
    record = result.records[judge]
    run = record.runs[0]
    rows = run[record.keep[run]]
    place = np.cumsum(record.keep) - 1
    measured = record.torque[np.ix_(rows, result.fit.axes)]
    left = result.after[judge][place[rows]]
    traces = {"measured": measured, "model": measured - left, "residual": left}
    return Figure(
        "torque", f"Torque of every axis ({judge})",
        partial(curves_per_axis, record.data.sample_times[rows], traces, unit="Nm", name="torque"),
        "Measured, as the identified model has it, and the difference.", "torque of every axis over time",
        main=int(np.argmax(np.square(left).sum(axis=0))))


def _parameters(robot: Robot, result: DynamicsIdentification) -> Table:
    start = with_links(robot)
    declared = friction_layout(start,
                               result.records["identification"]).joined(inertial_layout(start, result.base))
    values = dict(zip(declared.names, declared.values))
    names = result.fit.layout.names
    table = parameter_table(names, [values.get(name, 0.0) for name in names], result.fit.fit.x,
                            result.fit.intervals, [unit_of(name) for name in names], result.fit.fit.at_bound)
    return replace(table, note="The interval of an inertial parameter is that of the sum that it stands for "
                   "(next table): its own share of it follows the bodies that the links are drawn to.")


def _sums(result: DynamicsIdentification) -> dict[str, tuple[str, float, float, float]]:
    """Estimated parameter that stands for a sum -> the sum in words, its value and interval."""
    base, found = result.base, {}
    estimates = dict(zip(result.fit.layout.names, zip(result.fit.fit.x, *result.fit.intervals.T)))
    for k, name in enumerate(base.names[column] for column in base.kept):
        if name in estimates and base.group(k) != name:
            x, low, high = (float(value) + base.borne(k, result.robot) for value in estimates[name])
            found[name] = base.group(k), x, low, high
    return found


def _groups(result: DynamicsIdentification) -> Table:
    rows = tuple((name, words, Estimate(x, low, high, unit_of(name)))
                 for name, (words, x, low, high) in _sums(result).items())
    return Table("What the inertial parameters stand for", ("parameter", "base parameter", "estimate (95 %)"),
                 rows,
                 "A motion shows these sums only; how each is shared out among its parts follows the "
                 "bodies that the links are drawn to. All other parameters stand for themselves.")
