"""`exactarm identifiable`: which parameters planned or measured poses can identify, and which collide."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from exactarm.chain import Layout
from exactarm.commands.arguments import add_files, add_fixture, add_robot, require_acting
from exactarm.commands.calibrate import dropped_table
from exactarm.commands.call import (
    AnyData,
    AnyFixture,
    AnyRobot,
    arguments_of,
    asked,
    changed_options,
    command,
    files_among,
    fixture_of,
    robot_of,
    tables_of,
    threads_of,
)
from exactarm.commands.output import PICTURES
from exactarm.commands.planning_arguments import (
    Numbers,
    add_noise,
    add_planning,
    box_of,
    clearance_of,
    noise_of,
    target_hint,
    with_tool,
)
from exactarm.commands.result import CommandResult
from exactarm.data.dataset import Dataset, read_planned_poses
from exactarm.data.fixture import Fixture
from exactarm.data.kinds import CLOSURES
from exactarm.data.split import DEFAULT_SEED
from exactarm.design.joint_limits import beyond_limits
from exactarm.design.pose_space import Box, PoseSpace
from exactarm.effects.parameter_id import Group, ParameterId
from exactarm.errors import InputError
from exactarm.first_aid.first_aid import with_cause
from exactarm.identify.closure_fit import Pulls
from exactarm.identify.closure_scale import expected_deviations, gravity_alone, scale_is_known
from exactarm.identify.closures import (
    GRAVITY_ALONE,
    SCALE,
    carried_effects,
    identifiable_closures,
    nominal_closures,
)
from exactarm.identify.compliance import compliance_layout
from exactarm.identify.contact_starts import counted_anew
from exactarm.identify.declared import carried_layout, frames_layout, geometry_layout, require_geometry
from exactarm.identify.identifiability import Dropped, Identifiability, still_axes
from exactarm.identify.match import Mismatch, require_match
from exactarm.identify.model_check import ModelCheck, check_model
from exactarm.identify.partner_prior import with_open_partner
from exactarm.identify.planned import (
    SIGMA_POSITION_M,
    PlannedModel,
    controller_angles,
    pose_blocks,
    pose_data,
    row_weights,
)
from exactarm.measurement.closures import touches
from exactarm.progress import SILENT, Progress
from exactarm.report import Cell, Figure, Quantity, Report, Section, Table, Text, Warnings
from exactarm.report.numbers import number
from exactarm.report.plots.parameters import singular_values
from exactarm.report.plots.style import figure_of_panel
from exactarm.robot.robot import Robot

NAME = "identifiable"
HELP = "which parameters the planned or measured poses can identify, and which collide with which"
WRITES = (*PICTURES, "parameters.csv")


@dataclass(frozen=True)
class _Poses:
    """What is looked at: robot, layout, poses; `words` say where they come from."""

    robot: Robot
    layout: Layout
    data: Dataset
    orientation: bool
    frame_count: int
    words: str
    warnings: tuple[str, ...] = ()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    add_files(parser, least=0, text="measured or planned poses (default: random poses within the joint "
                                    "limits)")
    parser.add_argument("--count", metavar="K", type=int, default=1000,
                        help="number of random poses (default %(default)s)")
    add_fixture(parser)
    add_planning(parser)
    add_noise(parser)


@command
def identifiable(robot: AnyRobot, files: AnyData = (), *, count: int = 1000,
                 tool_m: Numbers | None = None, frames: Literal["both", "base", "tool", "none"] = "both",
                 use: Literal["position", "pose"] = "position", box: Box | Numbers | None = None,
                 clearance_m: float | None = None, noise: float = SIGMA_POSITION_M,
                 fixture: AnyFixture = None, seed: int = DEFAULT_SEED, threads: int | None = None,
                 progress: Progress = SILENT) -> CommandResult:
    """Which parameters measured or planned poses can show, and how well; without files: `count` random poses.

    tool_m: target on the flange. frames: which frames are unknown. box, clearance_m: where flange and target
    of random poses may be. noise: standard deviation of a measured coordinate in m. fixture: what is known of
    touched contacts.

        >>> import exactarm as ea
        >>> found = ea.identifiable("ur10", count=60)
        >>> "d_1_m" in found.summary()
        True
    """
    options = changed_options(identifiable, locals())
    tables = files if isinstance(files, Dataset) else tables_of(files)
    arguments = arguments_of(add_arguments, robot_of(robot), [] if isinstance(tables, Dataset) else tables,
                             options)
    vars(arguments).update(files=tables, seed=seed, threads=threads_of(threads), progress=progress)
    return run(arguments).asked_as(asked("identifiable", robot, tables, seed, options))


def run(arguments: argparse.Namespace) -> CommandResult:
    robot = with_tool(robot_of(arguments.robot), arguments.tool)
    require_geometry(robot)
    noise = noise_of(arguments.noise)
    touched = _touches(robot, arguments)
    if touched is not None:
        check, poses = _closures(robot, touched, noise, arguments)
        return replace(_result(robot, check, poses, noise), inputs=files_among(arguments.fixture))
    poses = _poses(robot, arguments)
    check = check_model(
        poses.robot, poses.layout,
        lambda layout: pose_blocks(poses.robot, layout, poses.data, poses.orientation, arguments.threads),
        keep_first=poses.frame_count, weights=row_weights(poses.orientation, noise),
        still=still_axes(controller_angles(poses.robot, poses.data)))
    return _result(robot, check, poses, noise)


def _result(robot: Robot, check: ModelCheck, poses: _Poses, noise: float) -> CommandResult:
    return CommandResult(json=_json(check, poses, noise), report=_report(robot, check, poses, noise),
                         tables={"parameters.csv": _parameter_columns(check)})


def _touches(robot: Robot, arguments: argparse.Namespace) -> Dataset | None:
    """The rows of a file with contacts, measured or planned; None for other files."""
    if arguments.files:
        require_acting(arguments, add_arguments, dict.fromkeys(("count", "box", "clearance"), "without FILE"))
    fixture = fixture_of(arguments.fixture) or Fixture()
    data = _rows(robot, arguments)
    if data is None or not data.contacts:
        require_acting(arguments, add_arguments, {"fixture": "on rows with contacts"})
        return None
    require_acting(arguments, add_arguments, dict.fromkeys(("frames", "use"), "on poses"))
    return touches(replace(data, kind=CLOSURES.name, kinds=(CLOSURES.name,), fixture=fixture))


def _rows(robot: Robot, arguments: argparse.Namespace) -> Dataset | None:
    """Measured or planned; None where none are given."""
    if isinstance(arguments.files, Dataset):
        return arguments.files
    return read_planned_poses(arguments.files, robot) if arguments.files else None


def _closures(robot: Robot, data: Dataset, noise: float,
              arguments: argparse.Namespace) -> tuple[ModelCheck, _Poses]:
    nominal = nominal_closures(robot, data, carried_effects(robot, data), arguments.seed, arguments.threads)
    beside = geometry_layout(robot).joined(compliance_layout(robot, data))
    setup = with_open_partner(counted_anew(nominal.layout))
    layout, found = identifiable_closures(robot, setup, beside, data, arguments.threads)
    deviations = expected_deviations(robot, layout, setup.joined(beside), data, noise,
                                     Pulls.of(geometry_layout(robot), data.fixture), arguments.threads)
    known = dict(zip(layout.names, deviations))
    found = replace(found, sigma_parameter=np.array([known.get(name, np.nan) for name in found.names]))
    warnings: tuple[str, ...] = () if scale_is_known(layout, data) else (SCALE,)
    warnings += (GRAVITY_ALONE,) if gravity_alone(data) else ()
    poses = _Poses(robot, layout, data, False, nominal.layout.size, f"{len(data)} touches", warnings)
    return ModelCheck(found, (), ()), poses


def _poses(robot: Robot, arguments: argparse.Namespace) -> _Poses:
    orientation = arguments.use == "pose"
    data = _rows(robot, arguments)
    if data is not None and data.position is not None:
        if orientation and data.rotation is None:
            raise InputError("--use pose: the data has no qw..qz or rx..rz columns")
        if arguments.frames != "both":
            raise InputError(f"--frames {arguments.frames}: measured poses have both frames unknown")
        frames, found = frames_layout(robot, data, orientation=orientation, seed=arguments.seed)
        try:
            require_match(robot, data, found, carried_layout(robot, data), arguments.seed)
        except Mismatch as error:
            raise with_cause(error) from error
        robot = replace(robot, tool=found[0][1].tool)  # reasons look at where the target really is
        layout = frames.joined(geometry_layout(robot)).joined(compliance_layout(robot, data))
        return _Poses(robot, layout, data, orientation, frames.size, f"{len(data)} measured poses")
    if data is not None:
        q, words = controller_angles(robot, data), f"{len(data)} planned poses"
        warnings = beyond_limits(robot, data, "planned poses")
    else:
        if arguments.count < 1:
            raise InputError(f"--count {arguments.count}: expected 1 or more")
        space = PoseSpace.of(robot, box_of(arguments.box), clearance_of(arguments.clearance))
        q = space.draw(arguments.count, np.random.default_rng(arguments.seed))
        words, warnings = f"{len(q)} random poses within the joint limits", _limit_warnings(space)
    model = PlannedModel.of(robot, q, arguments.frames, orientation)
    return _Poses(model.robot, model.layout, pose_data(q), orientation, model.frame_count, words, warnings)


def _limit_warnings(space: PoseSpace) -> tuple[str, ...]:
    if not space.assumed:
        return ()
    axes = ", ".join(str(axis) for axis in space.assumed)
    return (f"the robot file has no limits for axis {axes}: half a turn either way was assumed",)


def _json(check: ModelCheck, poses: _Poses, noise: float) -> dict[str, Any]:
    result = check.identifiability
    return {"poses": len(poses.data),
            "noise": noise,
            "identifiable": result.identifiable,
            "dropped": [_dropped(entry) for entry in result.dropped],
            "absent": [_dropped(entry) for entry in check.absent],
            "gaps": [{"parameter": gap.name, "why": gap.why} for gap in check.gaps],
            "singular_values": result.singular_values,
            "condition": result.condition,
            "observability": result.observability.as_dict(),
            "warnings": _warnings(check, poses)}


def _warnings(check: ModelCheck, poses: _Poses) -> list[str]:
    hints = target_hint(check.identifiability.dropped)
    return [*poses.warnings, *(gap.why for gap in check.gaps), *hints]


def _dropped(entry: Dropped) -> dict[str, Any]:
    return {"parameter": entry.name, "why": entry.why, "collides_with": entry.collides_with,
            "exact": entry.exact}


def _parameter_columns(check: ModelCheck) -> dict[str, list[Any]]:
    result = check.identifiability
    dropped = {entry.name: entry for entry in result.dropped}
    why = [dropped[name].why if name in dropped else "" for name in result.names]
    collides = ["; ".join(dropped[name].collides_with) if name in dropped else "" for name in result.names]
    return {"parameter": list(result.names),
            "identifiable": ["yes" if keep else "no" for keep in result.kept],
            "standard_deviation": list(_deviations(result)),
            "collides_with": collides,
            "why": why}


# -- report ------------------------------------------------------------------------------------------
def _report(robot: Robot, check: ModelCheck, poses: _Poses, noise: float) -> Report:
    result = check.identifiability
    count, total = len(result.identifiable), len(result.names)
    what = "position and orientation" if poses.orientation else "position"
    verdict = (
        f"{count} of {total} parameters can be identified from the {what} of the target in {poses.words}.")
    sections: list[Section] = [_frame_table(robot, check), _dropped_table(check), _index_table(result)]
    if warnings := _warnings(check, poses):
        sections.append(Warnings(tuple(warnings)))
    sections += [_figure(result), _sigma_table(result, noise), _method()]
    return Report(f"What can be identified: {robot.name}", verdict, tuple(sections),
                  "caution" if check.gaps else "good")


def _frame_table(robot: Robot, check: ModelCheck) -> Table:
    state: dict[ParameterId, str] = dict.fromkeys(check.identifiability.identifiable, "i")
    state |= {entry.name: "n" for entry in check.identifiability.dropped}
    state |= {entry.name: "n" for entry in check.absent}
    state |= {gap.name: "gap" for gap in check.gaps}
    symbols = {}
    for name, mark in state.items():
        if name.group in (Group.GEOMETRY, Group.OFFSET, Group.RATIO):
            symbols[name.symbol, name.axis] = mark
    columns = ("d", "a", "alpha", "beta", "q_offset", "ratio")
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (axis, *(symbols.get((column, axis), "x") for column in columns)) for axis in range(1, robot.axes + 1)
    )
    note = "i: identifiable, n: not identifiable, x: not in the model, gap: not in the model, but would show"
    return Table("Parameters of each frame", ("frame", *columns), rows, note)


def _dropped_table(check: ModelCheck) -> Table:
    entries = (*check.identifiability.dropped, *check.absent)
    return dropped_table(entries, "" if entries else "Everything can be identified.",
                         "Not identifiable, and why")


def _index_table(result: Identifiability) -> Table:
    rows = tuple((name, Quantity(value)) for name, value in result.observability.as_dict().items())
    note = ("Condition number of the identifiable columns, each scaled to unit length: "
            f"{number(result.condition)}.")
    return Table("Observability", ("index", "value"), rows, note)


def _deviations(result: Identifiability) -> np.ndarray:
    """(P,) at the noise; NaN where none is known."""
    return np.full(len(result.names), np.nan) if result.sigma_parameter is None else result.sigma_parameter


def _figure(result: Identifiability) -> Figure:
    return figure_of_panel(
        "singular_values", "Singular values",
        partial(singular_values, result.singular_values, int(np.sum(result.singular_values > 1e-9))), 3.0,
        "All columns of the stacked identification Jacobian, each scaled to unit length. Those that vanish "
        "count the combinations of parameters that move nothing.",
        "Singular values in falling order on a logarithmic scale")


def _sigma_table(result: Identifiability, noise: float) -> Table:
    rows = []
    for name, sigma in zip(result.names, _deviations(result)):
        if np.isfinite(sigma):
            unit = name.unit
            rows.append((name, Quantity(float(sigma), unit)))
    heading = f"Standard deviations to expect at {number(1e3 * noise)} mm of noise in every coordinate"
    return Table(heading, ("parameter", "standard deviation"), tuple(rows))


def _method() -> Text:
    return Text(
        "How it was decided",
        ("The identification Jacobian of all poses is stacked and its columns scaled to unit length. Columns "
         "are taken in an order of preference (frames of the set-up, geometry, joint offsets, gear ratios, "
         "others; the axes from the base on), and one that is a combination of those taken before it is "
         "dropped: these parameters collide.",
         "A parameter whose standard deviation at the stated noise exceeds what is plausible for it is "
         "dropped as well."))
