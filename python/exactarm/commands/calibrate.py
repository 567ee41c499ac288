"""`exactarm calibrate`: kinematic identification from measured poses."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Sequence
from functools import partial
from typing import Any, Literal

import numpy as np

from exactarm.commands.arguments import add_files, add_fixture, add_robot, add_sessions
from exactarm.commands.call import (
    AnyData,
    AnyFixture,
    AnyRobot,
    AnyTable,
    asked,
    command,
    data_of,
    files_among,
    require_choice,
    robot_of,
    table_option,
    threads_of,
)
from exactarm.commands.effect_sections import on_axes
from exactarm.commands.error_sections import error_figures, error_table, geometry_tables, highlights
from exactarm.commands.load_section import with_load_section, with_payload_section
from exactarm.commands.memory import within_memory
from exactarm.commands.next_steps import next_steps
from exactarm.commands.outcome import recorded
from exactarm.commands.output import PICTURES, ROBOT_FILES
from exactarm.commands.result import WORSE, CommandResult, estimate
from exactarm.commands.steps import CHECKING, READING, STEPS
from exactarm.commands.suspicions import suspicions
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import CLOSURES, POSES, kind_of
from exactarm.data.split import DEFAULT_SEED
from exactarm.effects.parameter_id import Group
from exactarm.effects.units_in_names import unit_of
from exactarm.errors import InputError
from exactarm.identify.calibrate import Calibration, CalibrationOptions
from exactarm.identify.calibrate import calibrate as identify_geometry
from exactarm.identify.calibration_doubts import doubts, with_contradiction
from exactarm.identify.closure_scale import gravity_alone
from exactarm.identify.closures import calibrate_closures
from exactarm.identify.declared import geometry_layout
from exactarm.identify.identifiability import Dropped
from exactarm.measurement.contact import Contact
from exactarm.numerics.rotation import log
from exactarm.progress import SILENT, Progress
from exactarm.report import Estimate, Figure, Quantity, Report, Table, Warnings
from exactarm.report.numbers import change, quantities
from exactarm.report.plots.parameters import parameter_forest
from exactarm.robot.robot import Robot

_KEPT = "These keep their values: those declared, or of a frame that is not, those of the first guess."
NAME = "calibrate"
HELP = "identify the geometry (and joint compliance) from measured poses"
WRITES = (*ROBOT_FILES, *PICTURES, "residuals.csv", "payloads.csv")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    add_files(parser)
    add_fixture(parser)
    add_sessions(parser)
    parser.add_argument("--use", choices=("auto", "position", "pose"), default="auto",
                        help="what is fitted: positions alone, or orientations too (default: what was "
                             "measured)")
    parser.add_argument("--compliance", metavar="AXES", default="auto",
                        help="axes whose joint compliance is estimated, as 2,3, or none (default: those "
                             "under load)")
    parser.add_argument("--robust", action="store_true", default=None,
                        help="Huber's loss: gross errors weigh less (default: where some rows are far off)")


@command
def calibrate(robot: AnyRobot, data: AnyData, *, use: Literal["auto", "position", "pose"] = "auto",
              compliance: Sequence[int] | str | None = None, robust: bool | None = None,
              seed: int = DEFAULT_SEED, threads: int | None = None, kind: str | None = None,
              fixture: AnyFixture = None, sessions: AnyTable | None = None,
              progress: Progress = SILENT) -> CommandResult:
    """Identifies geometry, joint offsets, gear ratios and joint springs from measured poses or closures.

    use: positions alone, or orientations too ("auto": what was measured). compliance: axes from 1 whose
    spring is estimated, as (2, 3), or "none" (None: those under load). robust: Huber's loss (None: where some
    rows are wild). threads: None is all cores.

        >>> import exactarm as ea
        >>> result = ea.calibrate("ur10", ea.example("ur10/series_B"), compliance=())
        >>> 0.3e-3 < result.after["validation"].mean < 0.5e-3 < result.before["validation"].mean
        True
    """
    require_choice("use", use, ("auto", "position", "pose"))
    compliance = _axes(compliance) if isinstance(compliance, str) else compliance
    sessions = table_option(sessions, "sessions")
    given = {"use": use, "compliance": compliance, "robust": robust, "kind": kind,
             "fixture": fixture, "sessions": sessions}
    declared = robot_of(robot)
    progress.plan(STEPS["calibrate"])
    progress.stage(READING)
    rows = require_poses(data_of(data, declared, kind, fixture, sessions, weighs=(POSES.name,)), CALIBRATORS)
    for option, acts in (("--robust", robust), ("--use", use != "auto")):
        if acts and rows.kind != POSES.name:
            raise InputError(f"{option} acts on poses only, found {rows.kind}", file=rows.first_file)
    wrong = [axis for axis in compliance or () if not 1 <= axis <= declared.axes]
    if wrong:
        raise InputError(f"compliance: axis {wrong[0]} does not exist, expected 1 to {declared.axes}")
    options = CalibrationOptions(orientation={"auto": None, "position": False, "pose": True}[use],
                                 compliance=None if compliance is None else tuple(compliance),
                                 robust=robust, seed=seed, threads=threads_of(threads))
    progress.stage(CHECKING)
    rows, told = within_memory("calibrate", rows.kind, rows, progress)
    with suspicions(declared, rows) as found:
        identify = CALIBRATORS[rows.kind]
        of_rows = lambda some: identify(declared, some, options)
        try:
            result = identify(declared, rows, options, progress.stage)
        except InputError as error:
            raise with_contradiction(error, declared, rows, of_rows) from None
        doubted = doubts(declared, result, of_rows)
    call = asked("calibrate", robot, rows, seed, given, {"use": "auto", "compliance": None, "robust": None})
    made = CommandResult(
        json=_json(result),
        report=_report(declared, rows, result, rows.split_rule(), bool(doubted) or result.length_doubted),
        robot=recorded(result.robot, call),
        tables={"residuals.csv": residual_table(result.data, result.identification, result.error_before,
                                                result.residual_after)},
        inputs=files_among(fixture, sessions),
        asked=call).warned([*told, *found, *doubted, *_unknown_payloads(rows, result)])
    made = with_payload_section(made, result.payloads, "One stiffness for all sessions.")
    return with_load_section(made, declared, rows)


def _unknown_payloads(data: Dataset, result: Calibration) -> list[str]:
    """Of sessions whose mass was asked for, and that these poses do not tell."""
    found = {p.session for p in result.payloads if p.estimated}
    return [f"session {session}: its payload stays unknown; these poses do not tell its mass from a spring "
            "and the geometry" for session in data.unweighed if session not in found]


def run(arguments: argparse.Namespace) -> CommandResult:
    return calibrate(
        arguments.robot, arguments.files, use=arguments.use, compliance=arguments.compliance,
        robust=arguments.robust, seed=arguments.seed, threads=arguments.threads, kind=arguments.kind,
        fixture=arguments.fixture, sessions=arguments.sessions, progress=arguments.progress)


CALIBRATORS = {POSES.name: identify_geometry, CLOSURES.name: calibrate_closures}


def require_poses(data: Dataset, kinds: Collection[str] = (POSES.name,)) -> Dataset:
    if data.kind not in kinds:
        how = "; --kind poses takes its rows as poses at rest" if data.position is not None else ""
        raise InputError(f"expected poses (x, y, z at rest), found a {data.kind.replace('_', ' ')}{how}",
                         file=data.sources[0].path if data.sources else None)
    return data


def _axes(text: str) -> tuple[int, ...] | None:
    if text == "auto":
        return None
    if text == "none":
        return ()
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--compliance {text}: expected axes as 2,3 or none or auto") from None


def _json(result: Calibration) -> dict[str, Any]:
    shown = result.shown
    return {
        "data_kind": result.data.kind,
        "unit": _unit(result),
        "before": _summaries(result.before, result.beside_before),
        "after": _summaries(result.after, result.beside_after),
        "parameters": {name: estimate(float(value), float(low), float(high))
                       for name, value, (low, high) in zip(result.names, shown.x, shown.interval())},
        "dropped": [{"parameter": entry.name, "why": entry.why, "collides_with": list(entry.collides_with)}
                    for entry in result.identifiability.dropped],
        "observability": result.identifiability.observability.as_dict(),
        "noise": {"position_m": result.fit.sigma_position, "orientation_rad": result.fit.sigma_orientation},
        **_drawing(result),
        **_placements(result),
        "converged": result.fit.fit.converged,
        "warnings": list(result.warnings)}


def _placements(result: Calibration) -> dict[str, Any]:
    """Where cameras and boards are, by session."""
    found = {f"session_{effect.session}": {
        name: {"position_m": place.tolist(), "rotation_vector_rad": log(turned).tolist()}
        for name, (turned, place) in effect.placements().items()}
        for effect in result.fit.layout.effects if isinstance(effect, Contact) and effect.placements()}
    return {"placements": found} if found else {}


def _placement_table(result: Calibration) -> tuple[Any, ...]:
    numbers = lambda values, scale: ", ".join(f"{scale * value:.3f}" for value in values)
    rows = tuple((session.removeprefix("session_"), name, numbers(at["position_m"], 1e3),
                  numbers(np.degrees(at["rotation_vector_rad"]), 1.0))
                 for session, each in _placements(result).get("placements", {}).items()
                 for name, at in each.items())
    note = "The rotations among the parameters of a camera count from a start; these are whole."
    return (Table("Where camera and board are", ("session", "what", "x, y, z [mm]", "rotation vector [deg]"),
                  rows, note),) if rows else ()


def _drawing(result: Calibration) -> dict[str, Any]:
    """How far the arm is from its drawing, where that was estimated: deviations beside plausible ones, and
    how many parameters the data tell."""
    drawn = result.drawn
    return {"drawing": {"scale": drawn.scale, "told_by_data": drawn.told}} if drawn.to else {}


def _summaries(summaries: dict[str, Any], beside: dict[str, dict[str, float]]) -> dict[str, Any]:
    """Each set's summary, of closures with the other errors beside it."""
    return {name: summary.to_json() | beside.get(name, {}) for name, summary in summaries.items()}


def residual_table(data: Dataset, identification: np.ndarray, before: np.ndarray,
                   after: np.ndarray) -> dict[str, Any]:
    """Columns of residuals.csv: where the row came from, its set, error before, residual after."""
    files = [source.path for source in data.sources] or [""]
    return {"file": [files[i] for i in data.file_index],
            "row": data.row,
            "session": data.session,
            "set": np.where(identification, "identification", "validation"),
            "error_before_m": before,
            "error_after_m": np.linalg.norm(after, axis=1),
            "dx_m": after[:, 0],
            "dy_m": after[:, 1],
            "dz_m": after[:, 2]}


def _unit(result: Calibration) -> str:
    """Of the errors: an angle where gravity's direction alone was measured."""
    return "rad" if result.data.contacts and gravity_alone(result.data) else "m"


def _report(robot: Robot, data: Dataset, result: Calibration, rule: str, doubted: bool) -> Report:
    unit = _unit(result)
    judge = "validation" if result.after["validation"].n else "identification"
    before, after = result.before[judge], result.after[judge]
    who = "poses that were never fitted" if judge == "validation" else "the fitted poses (none were held out)"
    verdict = (f"The mean position error on {who} {change(before.mean, after.mean, unit)} "
               f"(largest: {' to '.join(quantities([before.max, after.max], unit))}).")
    what, row, known = "position error", "pose", ()
    note = "Before: nominal parameters with only base and tool frames fitted. " + rule
    if data.kind == CLOSURES.name:
        what = "distance to the contact" if unit == "m" else "error of gravity's direction"
        if [name for name, numbers in data.contacts.items() if np.any(numbers >= 0)] == ["camera"]:
            what, row = "error of a corner", "corner"
        known = _distance_tables(result)
        verdict = verdict.replace("position error", what)
        note = "Before: nominal parameters with only contacts and tool fitted. " + rule
    if data.kind == POSES.name and result.fit.sigma_orientation is not None:
        (turn,) = quantities([np.sqrt(3.0) * result.fit.sigma_orientation], "rad")
        note += f" The measured orientations of the fitted rows are missed by {turn} (RMS)."
    note += _held_springs(robot, result)
    sections = (
        highlights(result.before, result.after, unit),
        next_steps(robot, kind_of(data.kind), before.mean, after.mean, after.rms > WORSE * before.rms,
                   doubted),
        error_table(result.before, result.after, unit, what.capitalize(), note), *known,
        *error_figures(result.error_before, result.error_after, result.identification, unit, what, row),
        *_placement_table(result), *_parameter_sections(robot, result),
        dropped_table(result.identifiability.dropped), Warnings(result.warnings))
    return Report(f"Calibration of {robot.name}", verdict, sections,
                  "good" if after.mean < before.mean and not doubted else "caution")


def _held_springs(robot: Robot, result: Calibration) -> str:
    """In words, the declared springs that nothing was estimated of."""
    own = {effect.joint for effect in result.fit.layout.effects if effect.per_load}
    held = [i for i, joint in enumerate(robot.joints, start=1) if joint.spring_linear and i not in own]
    if not held:
        return ""
    return (f" The declared springs{on_axes(held, robot.axes)} were held as they are: "
            f"`--compliance {','.join(map(str, held))}` estimates what they lack.")


def _distance_tables(result: Calibration) -> tuple[Any, ...]:
    """The known distances before and after; on validation rows with the contacts fitted to these alone."""
    def table(title: str, error: str, unit: str, note: str) -> Table:
        rows = tuple(
            (name, Quantity(result.beside_before[name].get(error), unit), Quantity(after[error], unit))
            for name, after in result.beside_after.items() if error in after)
        return Table(title, ("rows", "before", "after"), rows, note)

    tables = (
        table("Corners in pictures", "reprojection_px", "px",
              "RMS of the reprojection error. In m it is what a pixel makes at the distance of the board."),
        table("Known distances", "distance_error_m", "m",
              "Mean absolute error. The scatter about contacts cannot show a wrong scale; a known distance "
              "does."),
        table("Direction of gravity", "tilt_error_rad", "rad",
              "Mean angle. In plots, 1 mrad stands as 1 mm: what it makes at a lever of 1 m."))
    return tuple(each for each in tables if each.rows)


def _parameter_sections(robot: Robot, result: Calibration) -> tuple[Any, ...]:
    """Robot parameters as plot and table, then the frames of the sessions."""
    declared, shown = geometry_layout(robot), result.shown
    start_of = dict(zip(declared.names, declared.values))
    frame = np.array([name.group is Group.FRAME for name in result.names])

    def pick(mask: np.ndarray) -> tuple[Any, ...]:
        names = [name for name, keep in zip(result.names, mask) if keep]
        start = np.array([start_of.get(name, 0.0) for name in names])
        x, intervals = shown.x[mask], shown.interval()[mask]
        return names, start, x, intervals, [unit_of(name) for name in names]

    names, start, x, intervals, units = pick(~frame)
    drawing, beside = _drawing(result).get("drawing"), ""
    if drawing:
        beside = (f" The arm deviates from its drawing by {drawing['scale']:.2g} times what is usual. "
                  f"{drawing['told_by_data']:.0f} of these {len(names)} parameters follow more from the "
                  "poses than from the drawing.")
    tables = geometry_tables(names, start, x, intervals, units, result.fit.fit.at_bound[~frame])
    figures = (Figure(
        "parameters", "What changed",
        partial(parameter_forest, names, x - start, intervals[:, 0] - start, intervals[:, 1] - start, units),
        "Change of each parameter from its declared value, with its 95 % interval. Names are those of "
        "`result.json`, which is in m and rad." + beside,
        "parameter changes with intervals"),) if names else ()
    frames_names, _, frames_x, frames_intervals, frames_units = pick(frame)
    frames = tuple(
        Table(heading, ("parameter", "estimate (95 %)"), tuple(
            (name, Estimate(float(value) / size, float(low) / size, float(high) / size, shown))
            for name, value, (low, high), own in zip(frames_names, frames_x, frames_intervals, frames_units)
            if own == unit))
        for unit, heading, shown, size in (("m", "Frames: positions", "mm", 1e-3),
                                           ("rad", "Frames: rotations", "deg", np.pi / 180.0)))
    return *figures, *tables, *frames


def dropped_table(dropped: Sequence[Dropped], note: str = _KEPT,
                  heading: str = "Not identified") -> Table:
    return Table(heading, ("parameter", "why"), tuple((entry.name, entry.why) for entry in dropped), note)

