"""`exactarm design`: the measurement poses that show the parameters best."""

from __future__ import annotations

import argparse

import numpy as np

from exactarm.commands.arguments import add_robot
from exactarm.commands.planning_arguments import add_planning, box_of, clearance_of, target_hint, with_tool
from exactarm.commands.result import CommandResult
from exactarm.errors import InputError
from exactarm.identify.design import Design, DesignOptions, design_poses
from exactarm.report import Figure, Quantity, Report, Section, Table, Text, Warnings
from exactarm.report.numbers import number
from exactarm.robot import Robot
from exactarm.robot_file import load_robot

NAME = "design"
HELP = "optimal measurement poses, and others to validate with"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    parser.add_argument("--count", metavar="K", type=int, default=50, help="poses to identify with (default %(default)s)")
    parser.add_argument("--validation", metavar="K", type=int, default=13,
                        help="further poses to validate with (default %(default)s)")
    add_planning(parser)


def run(arguments: argparse.Namespace) -> CommandResult:
    robot = with_tool(load_robot(arguments.robot), arguments.tool)
    if arguments.count < 1 or arguments.validation < 0:
        raise InputError("--count: expected 1 or more, --validation: 0 or more")
    options = DesignOptions(
        count=arguments.count,
        validation=arguments.validation,
        box=box_of(arguments.box),
        clearance=clearance_of(arguments.clearance),
        frames=arguments.frames,
        orientation=arguments.use == "pose",
        seed=arguments.seed,
        threads=arguments.threads,
    )
    arguments.progress.stage("designing")
    design = design_poses(robot, options)
    return CommandResult(
        json=_json(design),
        report=_report(robot, design),
        tables={"poses.csv": _pose_columns(robot, design)},
    )


def _json(design: Design) -> dict:
    return design.observability.as_dict() | {
        "start": design.start.as_dict(),
        "exchanged": design.exchanged.as_dict(),
        "poses": len(design.q),
        "validation_poses": len(design.q_validation),
        "identifiable": design.identifiability.identifiable,
        "dropped": [{"parameter": entry.name, "why": entry.why} for entry in design.identifiability.dropped],
    }


def _pose_columns(robot: Robot, design: Design) -> dict[str, np.ndarray]:
    """The angles to command, and the motor angles where a gear is declared, rounded to what no encoder resolves."""
    q = np.concatenate([design.q, design.q_validation])
    columns: dict[str, np.ndarray] = {"set": np.repeat(["identification", "validation"], [len(design.q), len(q) - len(design.q)])}
    for i, joint in enumerate(robot.joints):
        columns[f"q_{i + 1}_{'m' if joint.type == 'prismatic' else 'rad'}"] = np.round(q[:, i], 9)
    theta = (q - robot.controller_offsets) * robot.controller_ratios
    for i, joint in enumerate(robot.joints):
        if joint.has_gear:
            columns[f"theta_{i + 1}_rad"] = np.round(theta[:, i], 9)
    return columns


def _report(robot: Robot, design: Design) -> Report:
    gain = design.observability.O1 / design.start.O1
    parameters = len(design.identifiability.identifiable)
    verdict = (
        f"{len(design.q)} poses for {parameters} parameters: O1 = {number(design.observability.O1)}, "
        f"{gain:.2f} times that of the random set it started from."
    )
    sections: list[Section] = [_index_table(design), _dropped_table(design)]
    if warnings := _warnings(design):
        sections.append(Warnings(warnings))
    sections += [_history_figure(design), _pose_figure(design), _method(design)]
    return Report(f"Measurement poses: {robot.name}", verdict, tuple(sections), "good")


def _index_table(design: Design) -> Table:
    sets = (design.observability, design.exchanged, design.start)
    rows = tuple((name, *(Quantity(getattr(each, name)) for each in sets)) for name in ("O1", "O2", "O3", "O4", "O5"))
    return Table("Observability", ("index", "this design", "before polishing", "random start"), rows,
                 "Larger is better. O1: all parameters together; O4: the one that shows least.")


def _dropped_table(design: Design) -> Table:
    rows = tuple((entry.name, entry.why) for entry in design.identifiability.dropped)
    return Table("Not identifiable by any such poses", ("parameter", "why"), rows)


def _warnings(design: Design) -> tuple[str, ...]:
    items = [
        f"joint limits, the box and {number(1e3 * design.space.clearance)} mm from base column and upper arm are kept; "
        "obstacles, cables and covers are not known: check the poses before they are driven"
    ]
    if design.space.assumed:
        axes = ", ".join(str(axis) for axis in design.space.assumed)
        items.append(f"the robot file has no limits for axis {axes}: half a turn either way was assumed")
    return (*items, *target_hint(design.identifiability.dropped))


def _history_figure(design: Design) -> Figure:
    def build():
        from exactarm.report.plots.design import observability_over_steps

        return observability_over_steps(design.history, references={"after polishing": design.observability.O1})

    return Figure("observability", "Observability over the exchange", build,
                  "O1 of the best set after each step: one pose added, one removed.", "O1 rising over the steps")


def _pose_figure(design: Design) -> Figure:
    def build():
        from exactarm.report.plots.workspace import poses_view

        q = np.concatenate([design.q, design.q_validation])
        return poses_view(design.space.target(q), np.arange(len(q)) >= len(design.q))

    return Figure("poses", "Where the target stands", build, "The target in the robot's base frame.",
                  "Designed and validation poses from above and from the side")


def _method(design: Design) -> Text:
    paragraphs = [
        "From a random set, poses are exchanged one by one: of random candidates that raise O1 the one that raises O4 most "
        "is added, and the pose that O1 misses least is removed; what has just come or gone is tabu for a while. Then every "
        "pose moves a little as long as O1 rises and O4 does not fall. Poses are in an order of short ways.",
        "Lengths and angles count as metres of the target per metre or radian; other parameters per a thousand times "
        "their plausible magnitude.",
    ]
    if len(design.q_validation):
        paragraphs.append(
            "The validation poses are not designed: a design sits at the rim of what the arm can do, an honest judgement "
            "needs ordinary poses. Of many random sets the one was taken whose poses lie farthest from each other and "
            f"from the others (at least {100 * design.validation_distance:.0f} % of the joints' ranges, root mean square)."
        )
    return Text("How the poses were found", tuple(paragraphs))
