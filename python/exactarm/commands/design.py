"""`exactarm design`: the measurement poses that show the parameters best."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from exactarm.commands.arguments import add_robot, require_acting
from exactarm.commands.calibrate import dropped_table
from exactarm.commands.call import (
    AnyFixture,
    AnyRobot,
    arguments_of,
    asked,
    changed_options,
    command,
    files_among,
    fixture_of,
    robot_of,
    threads_of,
)
from exactarm.commands.closure_design import designed_closures, designed_pictures, designed_readings
from exactarm.commands.design_for import designed_for, minutes_of, pose_columns
from exactarm.commands.isolability_table import isolability_columns, isolability_json, isolability_table
from exactarm.commands.output import PICTURES
from exactarm.commands.planning_arguments import (
    ACCEPTANCE_DEG,
    Numbers,
    add_planning,
    add_station,
    box_of,
    clearance_of,
    numbers_of,
    station_of,
    target_hint,
    with_tool,
)
from exactarm.commands.result import CommandResult
from exactarm.commands.steps import CAUSES, STEPS
from exactarm.compensate.measuring_program import WRITERS, measuring_program, stops_of
from exactarm.data.dataset import Dataset
from exactarm.data.fixture import CameraSetup
from exactarm.data.kinds import POSES
from exactarm.data.split import DEFAULT_SEED
from exactarm.design.closure_design import ClosureDesignOptions
from exactarm.design.design import Design, DesignOptions, design_poses
from exactarm.design.line_of_sight import Station
from exactarm.design.pose_space import Box
from exactarm.diagnose.isolability import isolability
from exactarm.errors import InputError
from exactarm.measurement.board_views import VIEWS, Views
from exactarm.measurement.contacts import CAMERA, SENSORS
from exactarm.progress import SILENT, Progress
from exactarm.report import Figure, Quantity, Report, Section, Table, Text, Warnings
from exactarm.report.numbers import number
from exactarm.report.plots.design import observability_over_steps
from exactarm.report.plots.style import figure_of_panel
from exactarm.report.plots.workspace import poses_view
from exactarm.robot.robot import Robot

NAME = "design"
LEAST_NOISE_MM = 1e-4  # a tenth of a micrometre: what is less was meant in m
MOST_APART_MM = 1000.0  # two seats on one plate
NOISE_MM = 0.05  # of a measured coordinate: a laser tracker on an arm that repeats to 0.03 mm
NEAR_MM, FAR_MM, TILT_DEG = 1e3 * VIEWS.near, 1e3 * VIEWS.far, float(round(np.degrees(VIEWS.lean)))
SOCKET = "socket"
TOUCHED = (SOCKET, *SENSORS, *CAMERA)
ACT_WITH_CONTACT = {  # options of `Calibration without a tracker`
    "places": (SOCKET, *CAMERA), "at": (SOCKET, *CAMERA), "apart_mm": (SOCKET,),
    **dict.fromkeys(("fixture", "near_mm", "far_mm", "tilt_deg"), CAMERA)}
OF_A_TRACKER = ("validation", "frames", "use", "noise_mm", "station", "opening", "acceptance", "both_ways")
HELP = "optimal measurement poses, and others to validate with"


def WRITES(arguments: argparse.Namespace) -> list[str]:  # of other commands a tuple
    beside = ["isolability.csv"] if arguments.contact is None else ["fixture.toml"]
    return [*PICTURES, "poses.csv", *beside, *(["measure.*"] if arguments.program else ())]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    parser.add_argument("--count", metavar="K", type=int, default=50,
                        help="poses to identify with (default %(default)s)")
    parser.add_argument("--validation", metavar="K", type=int, default=13,
                        help="further poses to validate with (default %(default)s)")
    add_planning(parser)
    parser.add_argument("--noise-mm", metavar="MM", type=float, default=NOISE_MM,
                        help="noise of a measured coordinate in mm: which causes could be told (default "
                             "%(default)s)")
    add_station(parser)
    drive = parser.add_argument_group("how the robot gets there")
    drive.add_argument("--both-ways", action="store_true",
                       help="every pose twice, all axes coming from below and from above: shows lost motion")
    drive.add_argument("--program", choices=tuple(WRITERS),
                       help="also write a program for this controller that drives to the poses and waits "
                            "there")
    next_one = parser.add_argument_group("after a diagnosis")
    next_one.add_argument("--for", dest="diagnosis", metavar="RESULT", type=Path,
                          help="result.json of `diagnose`: the poses that tell most about the causes it "
                               "could not tell apart")
    next_one.add_argument("--minutes", metavar="NAME=MINUTES", action="append", default=[],
                          help="what it costs to visit a pose (visit) or to mount a payload (payload)")
    touch = parser.add_argument_group("calibration without a tracker")
    touch.add_argument("--contact", choices=TOUCHED,
                       help="design touches of two seats instead: where to put them, and the poses; tilt, "
                            "accel: poses to read a sensor on the flange in; camera: where to put a board, "
                            "and the poses to take pictures in")
    touch.add_argument("--places", metavar="K", type=int, default=3,
                       help="of the two seats, of the board (default %(default)s)")
    touch.add_argument("--apart-mm", metavar="MM", type=float, default=50.0,
                       help="distance of the seats (default %(default)s)")
    touch.add_argument("--at", metavar="X,Y,Z", action="append", default=[],
                       help="middle of the two seats, of the board at a given place, in m in the base "
                            "frame; may be repeated (default: proposed)")
    touch.add_argument("--fixture", metavar="FILE", type=Path,
                       help="[board] and [camera] (size_px, focal_px) of the pictures (.toml)")
    touch.add_argument("--near-mm", metavar="MM", type=float, default=NEAR_MM,
                       help="least distance of camera and board (default %(default)g)")
    touch.add_argument("--far-mm", metavar="MM", type=float, default=FAR_MM,
                       help="most distance of camera and board (default %(default)g)")
    touch.add_argument("--tilt-deg", metavar="DEG", type=float, default=TILT_DEG,
                       help="most angle of the view from the board's normal (default %(default)g)")


@command
def design(robot: AnyRobot, *, count: int = 50, validation: int = 13, tool_m: Numbers | None = None,
           frames: Literal["both", "base", "tool", "none"] = "both",
           use: Literal["position", "pose"] = "position", box: Box | Numbers | None = None,
           clearance_m: float | None = None, noise_mm: float = NOISE_MM,
           station: Station | Numbers | None = None, opening: Numbers | None = None,
           acceptance: float = ACCEPTANCE_DEG, both_ways: bool = False, program: str | None = None,
           diagnosis: str | Path | None = None, minutes: str | Sequence[str] = (),
           contact: str | None = None, places: int = 3, apart_mm: float = 50.0,
           at: Numbers | Sequence[str] = (), fixture: AnyFixture = None, near_mm: float = NEAR_MM,
           far_mm: float = FAR_MM, tilt_deg: float = TILT_DEG, seed: int = DEFAULT_SEED,
           threads: int | None = None, progress: Progress = SILENT) -> CommandResult:
    """Measurement poses that show the parameters best, and others to validate with.

    tool_m: target on the flange. frames: which frames are unknown. box, clearance_m: where flange and target
    may be; station: of the tracker that has to see the target, whose reflector opens to `opening` and returns
    the beam within `acceptance` degrees. both_ways: every pose twice, from below and from above. program: the
    language of a controller (krl, rapid, fanuc, urscript, inform). noise_mm: of a measured coordinate, for
    the table of causes that the poses could tell. diagnosis: result.json of `diagnose`, for the poses that
    tell its causes apart (--for), minutes: what they cost (visit=2). contact: poses of touches, a gravity
    sensor or a camera instead (socket, tilt, accel, camera); at, places, apart_mm: where the seats or the
    board stand; fixture: board and camera; near_mm, far_mm, tilt_deg: of the camera's views.

        >>> import exactarm as ea
        >>> len(ea.design("ur10", count=20, validation=5).to_dataframe())
        25
    """
    options = changed_options(design, locals())
    arguments = arguments_of(add_arguments, robot_of(robot), [], options)
    vars(arguments).update(seed=seed, threads=threads_of(threads), progress=progress)
    return run(arguments).asked_as(asked("design", robot, None, seed, options))


def _poses(arguments: argparse.Namespace) -> CommandResult:
    arm = with_tool(robot_of(arguments.robot), arguments.tool)
    _require_counts(arguments, {"count": 1, "validation": 0})
    chosen = DesignOptions(
        count=arguments.count, validation=arguments.validation, box=box_of(arguments.box),
        clearance=clearance_of(arguments.clearance),
        station=station_of(arguments.station, arguments.opening, arguments.acceptance),
        frames=arguments.frames, orientation=arguments.use == "pose", seed=arguments.seed,
        threads=arguments.threads)
    if not LEAST_NOISE_MM <= arguments.noise_mm < 100.0:
        raise InputError(f"--noise-mm {arguments.noise_mm:g}: expected mm, {LEAST_NOISE_MM:g} to 100")
    arguments.progress.plan(STEPS["design"])
    found = design_poses(arm, chosen, arguments.progress.stage)
    arguments.progress.stage(CAUSES)
    causes = isolability(arm, Dataset.of_arrays(POSES.name, {"q": found.q}), 1e-3 * arguments.noise_mm,
                         arguments.seed, arguments.threads)
    q, sets, approach = _visits(found, arguments.both_ways)
    texts = {}
    if arguments.program is not None:
        stops = stops_of(q, approach, found.space.lower, found.space.upper)
        texts = dict([measuring_program(arm, arguments.program, stops)])
    return CommandResult(json=_json(found) | {"isolability": isolability_json(causes)},
                         report=_report(arm, found, isolability_table(causes, arguments.noise_mm)),
                         tables={"poses.csv": {"set": sets} | pose_columns(arm, q, approach),
                                 "isolability.csv": isolability_columns(causes)},
                         texts=texts)


def _require_counts(arguments: argparse.Namespace, least: Mapping[str, int]) -> None:
    for name, fewest in least.items():
        if (given := getattr(arguments, name)) < fewest:
            raise InputError(f"--{name} {given}: expected {fewest} or more")


def _closures(arguments: argparse.Namespace) -> CommandResult:
    robot = with_tool(robot_of(arguments.robot), arguments.tool)
    at = tuple(tuple(numbers_of("--at", text, 3)) for text in arguments.at)
    _require_counts(arguments, {"places": 1, "count": 1})
    if not 0.0 < arguments.apart_mm < MOST_APART_MM:
        raise InputError(f"--apart-mm {arguments.apart_mm:g}: expected above 0 and below {MOST_APART_MM:g}")
    views = _views(arguments)
    arguments.progress.stage("designing touches")
    options = ClosureDesignOptions(
        places=len(at) or arguments.places, count=arguments.count, apart=1e-3 * arguments.apart_mm, at=at,
        box=box_of(arguments.box), clearance=clearance_of(arguments.clearance), seed=arguments.seed,
        threads=arguments.threads)
    if arguments.contact in CAMERA:
        return designed_pictures(robot, _camera(arguments.fixture), options, views)
    if arguments.contact in SENSORS:
        return designed_readings(robot, arguments.contact, options)
    return designed_closures(robot, options)


def _camera(fixture: AnyFixture) -> CameraSetup:
    known = fixture_of(fixture)
    if known is None or known.camera is None:
        raise InputError("no board; expected --fixture with [board] (squares, square_mm) and [camera] "
                         "(size_px, focal_px)",
                         file=str(fixture) if isinstance(fixture, (str, Path)) else None)
    return known.camera


def _views(arguments: argparse.Namespace) -> Views:
    near, far, tilt = arguments.near_mm, arguments.far_mm, arguments.tilt_deg
    if not 1.0 <= near < far <= 1e5:
        raise InputError(f"--near-mm {near:g}, --far-mm {far:g}: expected 1 to 100000, the nearer "
                         "one smaller")
    if not 0.0 < tilt <= 80.0:
        raise InputError(f"--tilt-deg {tilt:g}: expected degrees above 0, 80 at most")
    return Views(1e-3 * near, 1e-3 * far, float(np.radians(tilt)))


def _idle(arguments: argparse.Namespace) -> dict[str, str]:
    """Options that do nothing for what is designed, and with which they act."""
    known = arguments.diagnosis is not None
    idle = {name: f"with --contact {' or '.join(contacts)}" for name, contacts in ACT_WITH_CONTACT.items()
            if known or arguments.contact not in contacts}
    if known:
        idle |= dict.fromkeys(("count", "tool", "box", "clearance", "contact", *OF_A_TRACKER),
                              "without --for")
    elif arguments.contact is not None:
        idle |= dict.fromkeys(("program", *OF_A_TRACKER), "without --contact")
    if arguments.at:
        idle.setdefault("places", "without --at")
    return idle if known else idle | {"minutes": "with --for RESULT"}


def run(arguments: argparse.Namespace) -> CommandResult:
    require_acting(arguments, add_arguments, _idle(arguments))
    if arguments.diagnosis is not None:
        made = designed_for(robot_of(arguments.robot), arguments.diagnosis, minutes_of(arguments.minutes),
                            arguments.program)
        return replace(made, inputs=files_among(arguments.diagnosis))
    if arguments.contact is not None:
        return replace(_closures(arguments), inputs=files_among(arguments.fixture))
    return _poses(arguments)


def _json(design: Design) -> dict[str, Any]:
    return design.observability.as_dict() | {
        "start": design.start.as_dict(),
        "exchanged": design.exchanged.as_dict(),
        "poses": len(design.q),
        "validation_poses": len(design.q_validation),
        "identifiable": design.identifiability.identifiable,
        "dropped": [{"parameter": entry.name, "why": entry.why} for entry in design.identifiability.dropped]}


def _visits(design: Design, both_ways: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """q (N, n) in the order of driving, the set of each, and the direction of approach (N, n), if planned."""
    q = np.concatenate([design.q, design.q_validation])
    sets = np.repeat(["identification", "validation"], [len(design.q), len(design.q_validation)])
    if not both_ways:
        return q, sets, None
    return np.repeat(q, 2, axis=0), np.repeat(sets, 2), np.tile([[-1], [1]], (len(q), q.shape[1]))


def _report(robot: Robot, design: Design, causes: Table) -> Report:
    gain = design.observability.O1 / design.start.O1
    parameters = len(design.identifiability.identifiable)
    verdict = (f"{len(design.q)} poses for {parameters} parameters: O1 = {number(design.observability.O1)}, "
               f"{gain:.2f} times that of the random set it started from.")
    sections: list[Section] = [_index_table(design), causes, dropped_table(
        design.identifiability.dropped, "", "Not identifiable by any such poses")]
    if warnings := _warnings(design):
        sections.append(Warnings(warnings))
    sections += [_history_figure(design), _pose_figure(design), _method(design)]
    return Report(f"Measurement poses: {robot.name}", verdict, tuple(sections), "good")


def _index_table(design: Design) -> Table:
    sets = (design.observability, design.exchanged, design.start)
    rows = tuple((name, *(Quantity(getattr(each, name)) for each in sets))
                 for name in ("O1", "O2", "O3", "O4", "O5"))
    return Table("Observability", ("index", "this design", "before polishing", "random start"), rows,
                 "Larger is better. O1: all parameters together; O4: the one that shows least.")


def _warnings(design: Design) -> tuple[str, ...]:
    items = [
        f"joint limits, the box and {number(1e3 * design.space.clearance)} mm from base column and upper arm "
        "are kept; obstacles, cables and covers are not known: check the poses before they are driven"]
    if design.space.assumed:
        axes = ", ".join(str(axis) for axis in design.space.assumed)
        items.append(f"the robot file has no limits for axis {axes}: half a turn either way was assumed")
    return (*items, *target_hint(design.identifiability.dropped))


def _history_figure(design: Design) -> Figure:
    references = {"after polishing": design.observability.O1}
    return figure_of_panel("observability", "Observability over the exchange",
                           partial(observability_over_steps, design.history, references=references), 3.2,
                           "O1 of the best set after each step: one pose added, one removed.",
                           "O1 rising over the steps")


def _pose_figure(design: Design) -> Figure:
    q = np.concatenate([design.q, design.q_validation])
    return Figure("poses", "Where the target stands",
                  partial(poses_view, design.space.target(q), np.arange(len(q)) >= len(design.q)),
                  "The target in the robot's base frame.",
                  "Designed and validation poses from above and from the side")


def _method(design: Design) -> Text:
    paragraphs = [
        "From a random set, poses are exchanged one by one: of random candidates that raise O1 the one that "
        "raises O4 most is added, and the pose that O1 misses least is removed; what has just come or gone "
        "is tabu for a while. Then every pose moves a little as long as O1 rises and O4 does not fall. Poses "
        "are in an order of short ways.",
        "Lengths and angles count as metres of the target per metre or radian; other parameters per a "
        "thousand times their plausible magnitude."]
    if len(design.q_validation):
        paragraphs.append(
            "The validation poses are not designed: a design sits at the rim of what the arm can do, an "
            "honest judgement needs ordinary poses. Of many random sets the one was taken whose poses lie "
            f"farthest from each other and from the others (at least {100 * design.validation_distance:.0f} "
            "% of the joints' ranges, root mean square).")
    return Text("How the poses were found", tuple(paragraphs))
