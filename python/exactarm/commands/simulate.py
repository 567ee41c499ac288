"""`exactarm simulate`: a virtual robot, measured as the real one would be.

    exactarm simulate racer-7-1.4 trajectory.csv --out played
    exactarm simulate racer-7-1.4 --measure motion --effect "payload mass_kg=3 ..." --out log
    exactarm simulate racer-7-1.4 --compare line --out worth
    exactarm simulate panda --measure closures --contact socket --places 3 --count 20 --out touched
    exactarm simulate ur10 poses.csv --measure poses --effect "joint_compliance joint=2 ..." --out poses
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from exactarm.commands import compare
from exactarm.commands.arguments import add_files, add_robot, require_acting
from exactarm.commands.call import (
    AnyRobot,
    AnyTable,
    arguments_of,
    asked,
    changed_options,
    command,
    robot_of,
    table_of,
    threads_of,
)
from exactarm.commands.output import PICTURES
from exactarm.commands.planning_arguments import MOST_NOISE_M
from exactarm.commands.result import CommandResult
from exactarm.commands.virtual_measurements import FILES, FIXTURE_FILES, MEASURES, SHOW_THE_TARGET, Played
from exactarm.data.dataset import Dataset, dataset_columns, read_planned_poses
from exactarm.data.kinds import CLOSURES, GEAR_RUN, MOTION, POSES, TRACKED_MOTION
from exactarm.data.split import DEFAULT_SEED
from exactarm.design.joint_limits import beyond_limits
from exactarm.errors import InputError
from exactarm.identify.statistics import summarise
from exactarm.plan.path_file import CHOICES
from exactarm.progress import SILENT, Progress
from exactarm.report import Highlight, Highlights, Quantity, Report, Text
from exactarm.report.numbers import quantity
from exactarm.robot.generic_masses import with_generic_masses
from exactarm.robot.robot import Robot
from exactarm.robot.writer import robot_text
from exactarm.simulate import VirtualRobot, deviated, parse_effect
from exactarm.simulate.closures import CONTACTS
from exactarm.simulate.virtual_robot import one_sided, placed

NAME = "simulate"
HELP = "play a trajectory or measure poses, gears and motions on a virtual robot"
COMPARED = "compare"  # stands beside the measures
ACT_WITH = {  # options that not every measure reads
    "frames": SHOW_THE_TARGET, "quasi_static": (MOTION.measured_as, TRACKED_MOTION.measured_as),
    "damping": (MOTION.measured_as, TRACKED_MOTION.measured_as, COMPARED),
    "engine": (TRACKED_MOTION.measured_as, COMPARED), "count": (POSES.measured_as, CLOSURES.measured_as),
    "visits": (POSES.measured_as,), "contact": (CLOSURES.measured_as,), "places": (CLOSURES.measured_as,),
    "orientation": (POSES.measured_as,), "joint": (GEAR_RUN.measured_as,), "speed": (GEAR_RUN.measured_as,),
    "torques": (POSES.measured_as, MOTION.measured_as), "repeats": (GEAR_RUN.measured_as,),
    "in_motion": (GEAR_RUN.measured_as,), "runs": (MOTION.measured_as,), "seconds": (MOTION.measured_as,),
    "rate": (GEAR_RUN.measured_as, MOTION.measured_as, TRACKED_MOTION.measured_as, COMPARED),
    "wrong_rows": SHOW_THE_TARGET,
    "temperature": tuple(measure for measure in MEASURES if measure != CLOSURES.measured_as),
}
_ANY, _POSITIVE = sys.float_info.max, sys.float_info.min
MOST_TORQUE_NOISE_NM = 1000.0  # a tenth of what the axes of the largest arms give
LIMITS = {  # least, most and what is expected
    **dict.fromkeys(("count", "places", "visits", "repeats", "runs"), (1, _ANY, "1 or more")),
    **dict.fromkeys(("counts", "noise", "deviation", "damping"), (0, _ANY, "0 or more")),
    **dict.fromkeys(("seconds", "rate", "speed"), (_POSITIVE, _ANY, "a positive number")),
    "torques": (0, MOST_TORQUE_NOISE_NM, f"a standard deviation in Nm, at most {MOST_TORQUE_NOISE_NM:g}"),
    "wrong_rows": (0, 1, "a share from 0 to 1"),
    "temperature": (-100, 200, "degrees Celsius, -100 to 200"),  # kelvin of a hall are beyond
}
MOST_NOISE = {
    POSES.measured_as: (MOST_NOISE_M, "m"), TRACKED_MOTION.measured_as: (MOST_NOISE_M, "m"),
    CLOSURES.measured_as: (MOST_NOISE_M, "m (rad of a sensor of gravity)"),
    GEAR_RUN.measured_as: (0.1, "rad/s"),  # 6 deg/s: twenty times that of a cheap gyroscope
    MOTION.measured_as: (MOST_TORQUE_NOISE_NM, "Nm"),
}
WITHOUT_A_FILE = ("count", "runs", "seconds")
HIDDEN_OPTIONS = ("--effect",)  # the truth stands in truth.toml alone


def WRITES(arguments: argparse.Namespace) -> list[str]:  # of other commands a tuple
    if arguments.compare is not None:
        return [*PICTURES, "truth.toml", "compare.csv"]
    asked = [arguments.measure] if arguments.measure else [POSES.measured_as, TRACKED_MOTION.measured_as]
    beside = FIXTURE_FILES if CLOSURES.measured_as in asked else ()
    return [*PICTURES, "truth.toml", *(FILES[measure] for measure in asked), *beside]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    add_files(parser, least=0, text="trajectory.csv to play, or poses.csv to measure")
    parser.add_argument("--measure", choices=tuple(MEASURES), default=None,
                        help="what is measured (default: tracked for a trajectory, else poses)")
    parser.add_argument("--compare", metavar="PATH", default=None,
                        help="what a plan is worth: plays rigid motions and exactarm's for a path file, line "
                             "or spiral")
    truth = parser.add_argument_group("truth, written to truth.toml alone")
    truth.add_argument("--effect", metavar="WORDS", action="append", default=[],
                       help='a hidden effect, as "backlash joint=2 width_rad=4e-4"; may be repeated')
    truth.add_argument("--deviation", metavar="SCALE", type=float, default=None,
                       help="random errors of masses, friction and, for positions, geometry: 1 = as usual "
                            "(default 0, to compare 1)")
    truth.add_argument("--frames", choices=("random", "declared"), default="random",
                       help="where tracker and target are, for poses and tracked motion (default "
                            "%(default)s)")
    truth.add_argument("--quasi-static", action="store_true", help="springs follow the load without swinging")
    truth.add_argument("--gear-direction", choices=CHOICES["gear_direction"],
                       default=CHOICES["gear_direction"][0],
                       help="gear tables of the direction of motion, or one throughout, as a plan may assume "
                            "(default %(default)s)")
    truth.add_argument("--damping", metavar="S", type=float, default=None,
                       help="damping of the springs over their stiffness (default: 1e-3 for motion, 0 for "
                            "tracked)")
    truth.add_argument("--engine", choices=("own", "pinocchio"), default=None,
                       help="plant of a tracked motion: ours, or an independent one (needs the package pin); "
                            "default ours, to compare both")
    what = parser.add_argument_group("measurement")
    what.add_argument("--count", metavar="K", type=int, default=63,
                      help="random poses, without a file (default %(default)s)")
    what.add_argument("--visits", metavar="K", type=int, default=1,
                      help="how often each pose is visited (default %(default)s)")
    what.add_argument("--contact", choices=CONTACTS, default="socket",
                      help="what closures touch (default %(default)s)")
    what.add_argument("--places", metavar="K", type=int, default=3,
                      help="of the fixture; --count is the number of touches of each contact there (default "
                           "%(default)s)")
    what.add_argument("--orientation", action="store_true", help="measure orientations too")
    what.add_argument("--joint", metavar="I", type=int, action="append",
                      help="axes of gear runs (default: all with a gear)")
    what.add_argument("--torques", metavar="SIGMA", type=float, default=None,
                      help="measure the drive torques of poses too, with this noise in Nm")
    what.add_argument("--speed", metavar="DEG_S", type=float, action="append",
                      help="speeds of gear runs (default: 40 and 30 %% of the largest)")
    what.add_argument("--repeats", metavar="K", type=int, default=2,
                      help="to and fro at each speed (default %(default)s)")
    what.add_argument("--in-motion", action="store_true",
                      help="gear runs begin and end at constant speed, not at rest")
    what.add_argument("--runs", metavar="K", type=int, default=3,
                      help="motions, without a file (default %(default)s)")
    what.add_argument("--seconds", metavar="S", type=float, default=10.0,
                      help="length of a motion (default %(default)s)")
    what.add_argument("--rate", metavar="HZ", type=float, default=None,
                      help="samples per second (default: the file's, else 1000, motion 500)")
    sensors = parser.add_argument_group("sensors")
    sensors.add_argument("--noise", metavar="SIGMA", type=float, default=None,
                         help="of position in m (5e-5), gravity's direction in rad (5e-5), gyroscope in rad"
                              "/s (8.7e-4), torque in Nm (1 %% of each axis)")
    sensors.add_argument("--counts", metavar="K", type=int, default=None,
                         help="encoder counts per revolution of the motor (default: 65536, exact where no "
                              "gear ratio is declared; 0: exact)")
    sensors.add_argument("--wrong-rows", metavar="SHARE", type=float, default=0.0,
                         help="share of rows with gross errors")
    sensors.add_argument("--temperature", metavar="DEGC", type=float, nargs=2, default=None,
                         help="at the start and in the end")


@command
def simulate(robot: AnyRobot, file: AnyTable | None = None, *, measure: str | None = None,
             compare: str | Path | None = None, effects: str | Sequence[str] = (),
             deviation: float | None = None, frames: Literal["random", "declared"] = "random",
             quasi_static: bool = False, gear_direction: str = CHOICES["gear_direction"][0],
             damping: float | None = None, engine: Literal["own", "pinocchio"] | None = None, count: int = 63,
             visits: int = 1, contact: str = "socket", places: int = 3, orientation: bool = False,
             joint: int | Sequence[int] | None = None, torques: float | None = None,
             speed: float | Sequence[float] | None = None, repeats: int = 2, in_motion: bool = False,
             runs: int = 3, seconds: float = 10.0, rate_hz: float | None = None, noise: float | None = None,
             counts: int | None = None, wrong_rows: float = 0.0, temperature: Sequence[float] | None = None,
             seed: int = DEFAULT_SEED, threads: int | None = None,
             progress: Progress = SILENT) -> CommandResult:
    """Plays a trajectory or measures poses, gears and motions on a virtual robot; `result.data` are the
    measured rows.

    file: a trajectory to play or poses to measure, a file or a table. measure: poses, gear, motion, closures
    or tracked (None: tracked for a trajectory, else poses). compare: plays rigid motions and exactarm's along
    a path instead. effects, deviation: hidden causes in words, random errors of what is declared. noise: in
    m, rad, rad/s or Nm; temperature: at the start and in the end, in degrees C; speed: of gear runs, in
    deg/s. `exactarm simulate --help` says more of each.

        >>> import exactarm as ea
        >>> made = ea.simulate("ur10", count=30, effects=["base_compliance rad_per_Nm=1e-6"])
        >>> len(made.data), made.data.kind
        (30, 'poses')
    """
    options = changed_options(simulate, locals())
    tables = [] if file is None else [table_of(file, 1)]
    arguments = arguments_of(add_arguments, robot_of(robot), tables, options)
    vars(arguments).update(seed=seed, threads=threads_of(threads), progress=progress)
    told = options | ({"effects": ["..."]} if "effects" in options else {})
    return run(arguments).asked_as(asked("simulate", robot, tables, seed, told))


def run(arguments: argparse.Namespace) -> CommandResult:
    robot = robot_of(arguments.robot)
    if arguments.compare is not None:
        _require_comparison(arguments, robot)
        return compare.run(arguments, robot)
    planned = read_planned_poses(arguments.files, robot) if arguments.files else None
    series = planned is not None and planned.time is not None
    measure = arguments.measure or (TRACKED_MOTION if series else POSES).measured_as
    _require(arguments, robot, measure, planned)
    given = planned if series or measure == POSES.measured_as else None
    _require_read(arguments, measure, given)
    random = np.random.default_rng(arguments.seed)
    virtual = _virtual(arguments, robot, measure, random)
    arguments.progress.stage(f"measuring {measure}")
    played = MEASURES[measure](arguments, virtual, given, random)
    truth = virtual.true
    return CommandResult(
        json=_json(played, measure), report=_report(robot, played, measure),
        tables={played.name: dataset_columns(played.data, robot)},
        texts={"truth.toml": robot_text(truth)} | played.texts,
        data=played.data).warned(() if planned is None else beyond_limits(robot, planned, "planned rows"))


def _require_comparison(arguments: argparse.Namespace, robot: Robot) -> None:
    if arguments.files or arguments.measure:
        raise InputError("--compare plans its own trajectories: expected neither a file nor --measure")
    if arguments.quasi_static:
        raise InputError("--compare lets the springs swing: expected no --quasi-static")
    if arguments.engine == "pinocchio" and (arguments.effect or arguments.damping):
        raise InputError("--engine pinocchio knows neither hidden effects nor damping: expected no --effect "
                         "and no --damping")
    _require_numbers(arguments)
    require_acting(arguments, add_arguments, _idle(COMPARED))
    if not robot.has_geometry:
        raise InputError(f"robot {robot.name} declares no geometry; expected one for a path", file=robot.file)


def _require(arguments: argparse.Namespace, robot: Robot, measure: str, planned: Dataset | None) -> None:
    _require_numbers(arguments)
    if measure in SHOW_THE_TARGET and not robot.has_geometry:
        raise InputError(f"robot {robot.name} declares no geometry; expected one for measured positions",
                         file=robot.file)
    if measure == MOTION.measured_as and (robot.links is None or robot.generic_masses):
        raise InputError(f"robot {robot.name} declares no link masses; expected them for a motion",
                         file=robot.file)
    if measure == TRACKED_MOTION.measured_as and (planned is None or planned.time is None):
        raise InputError("tracked motion: expected a trajectory.csv with time_s and theta_i_rad")


def _require_read(arguments: argparse.Namespace, measure: str, given: Dataset | None) -> None:
    """Whatever was given is read, `given` of the FILE."""
    if arguments.files and (given is None or measure in (GEAR_RUN.measured_as, CLOSURES.measured_as)):
        takes = "a trajectory with time_s" if measure == MOTION.measured_as else "no FILE"
        raise InputError(f"--measure {measure} takes {takes}", file=arguments.files[0])
    most, unit = MOST_NOISE[measure]
    if arguments.noise is not None and arguments.noise > most:
        raise InputError(f"--noise {arguments.noise:g}: expected a standard deviation in {unit}, at most "
                         f"{most:g}")
    idle = _idle(measure) | (dict.fromkeys(WITHOUT_A_FILE, "without FILE") if arguments.files else {})
    require_acting(arguments, add_arguments, idle)


def _idle(played: str) -> dict[str, str]:
    """Options that do nothing for a measure or COMPARED, and with which they act."""
    found = {}
    for name, measures in ACT_WITH.items():
        if played not in measures:
            words = f"with --measure {' or '.join(each for each in measures if each != COMPARED)}"
            found[name] = words + " or --compare" * (COMPARED in measures)
    return found | (dict.fromkeys(("noise", "counts"), "without --compare") if played == COMPARED else {})


def _require_numbers(arguments: argparse.Namespace) -> None:
    for name, (least, most, expected) in LIMITS.items():
        given = getattr(arguments, name)
        for value in given if isinstance(given, list) else [given]:
            if value is not None and not least <= value <= most:
                raise InputError(f"--{name.replace('_', '-')} {value:g}: expected {expected}")


def _virtual(arguments: argparse.Namespace, robot: Robot, measure: str,
             random: np.random.Generator) -> VirtualRobot:
    effects = [parse_effect(text, robot.axes) for text in arguments.effect]
    true = robot
    if arguments.deviation:
        true = deviated(true, arguments.deviation, random, geometry=measure in SHOW_THE_TARGET, frames=False)
    if arguments.torques is not None or any(effect.by_load for effect in effects):
        true = with_generic_masses(true) if measure in SHOW_THE_TARGET else true
    true = one_sided(true, arguments.gear_direction)
    if arguments.frames == "random" and measure in SHOW_THE_TARGET:
        true = placed(true, random)
    return VirtualRobot.of(robot, effects, true)


def _json(played: Played, measure: str) -> dict[str, Any]:
    result = {"data_kind": played.data.kind, "file": played.name, "rows": len(played.data)}
    if played.tracking is not None:
        summary = summarise(played.tracking).to_json()
        result["tracking"] = {"position_rms_m": summary["rms"], "position_max_m": summary["max"],
                              "error": summary}
    return result


def _report(robot: Robot, played: Played, measure: str) -> Report:
    runs = len(np.unique(played.data.run))
    rows = f"{len(played.data)} rows" + (f" in {runs} runs" if runs > 1 else "")
    verdict = f"{played.name} holds {rows}, as a virtual {robot.name} would have been measured ({measure})."
    sections: list[Any] = []
    if played.tracking is not None:
        summary = summarise(played.tracking).to_json()
        verdict += f" The flange follows the trajectory within {quantity(summary['rms'], 'm')} (RMS)."
        sections.append(Highlights(tuple(
            Highlight(f"flange error, {name}", Quantity(summary[key], "m"), None)
            for name, key in (("mean", "mean"), ("RMS", "rms"), ("maximum", "max")))))
    sections.append(Text("Truth", ("What the virtual robot is stands in truth.toml and nowhere else.",)))
    return Report(f"Virtual {robot.name}", verdict, tuple(sections), "plain")
