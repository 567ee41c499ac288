"""`exactarm loop`: the full loop on a virtual robot with a hidden cause.

Round 0 plans with the drawing, round 1 with the calibrated robot, round 2 with the diagnosed one; each time
the motion is executed on the true robot and its error measured. The desired path is fixed in the tracker's
frame (where the drawing's base frame was found), and the error is that of the measured target: base and tool
frames of two estimated models need not coincide, what the tracker sees does.
"""

import argparse
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from exactarm.commands.arguments import add_robot
from exactarm.commands.outcome import Asked, recorded
from exactarm.commands.output import PICTURES, ROBOT_FILES
from exactarm.commands.planning_arguments import noise_of
from exactarm.commands.result import CommandResult
from exactarm.commands.steps import CALIBRATING, EXECUTING, MEASURING, STEPS
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import TRACKED_MOTION
from exactarm.diagnose.diagnosis import Diagnosis, diagnose
from exactarm.effects.base import Effect
from exactarm.errors import InputError
from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.identify.declared import frames_layout
from exactarm.identify.statistics import ErrorSummary, summarise
from exactarm.plan.optimal import PlanOptions, plan_path
from exactarm.plan.path_file import PlannedPath, load_path
from exactarm.plan.reference import Reference
from exactarm.report import Highlight, Highlights, Quantity, Report, Table, Text
from exactarm.report.numbers import quantities, with_prefixes
from exactarm.report.plots.curves import curves
from exactarm.report.plots.style import HEIGHT_IN, figure_of_panel
from exactarm.robot.controller_frames import base_in_device, target_on_flange
from exactarm.robot.robot import Robot
from exactarm.robot.writer import robot_text
from exactarm.robot_file import load_robot
from exactarm.simulate import Sensors, VirtualRobot, deviated, measure_poses, parse_effect
from exactarm.simulate.measure import true_path
from exactarm.simulate.profiles import limit
from exactarm.simulate.virtual_robot import placed

NAME = "loop"
HELP = "the full loop on a virtual robot: identify, plan, execute, measure, diagnose, plan and execute again"
WRITES = (*ROBOT_FILES, *PICTURES, "tracking.csv", "truth.toml")
# of the springs over their stiffness: an undamped arm would ring from the first reversal on
_DAMPING_S = 1e-3
ROUNDS = ("as drawn", "calibrated", "diagnosed")


@dataclass(frozen=True)
class _Round:
    name: str
    robot: Robot
    error: np.ndarray  # (N,) m of the target along the path
    summary: ErrorSummary


@dataclass(frozen=True)
class _Moved:
    """A curve carried along by a rigid motion, and shifted: x' = rotation (x - origin) - offset."""

    curve: object
    rotation: np.ndarray
    origin: np.ndarray
    offset: np.ndarray

    def motion(self, duration: float):
        inner = self.curve.motion(duration)

        def at(t):
            position, *rates = inner(t)
            moved = (position - self.origin) @ self.rotation.T - self.offset
            return (moved, *(rate @ self.rotation.T for rate in rates))

        return at


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    parser.add_argument("--path", default="line",
                        help="path file (.toml), or line or spiral (default %(default)s)")
    parser.add_argument("--effect", metavar="WORDS", action="append", default=[],
                        help='the hidden cause, as "gear_eccentricity joint=2 first_cos_rad=3e-4 '
                             'first_sin_rad=1e-4"')
    parser.add_argument("--deviation", type=float, default=1.0,
                        help="size of the true deviations (default %(default)s)")
    parser.add_argument("--count", type=int, default=160, help="measured poses (default %(default)s)")
    parser.add_argument("--noise", type=float, default=3e-5,
                        help="of a measured position in m (default %(default)s)")


def run(arguments: argparse.Namespace) -> CommandResult:
    robot, path = load_robot(arguments.robot), load_path(arguments.path)
    if not arguments.effect:
        raise InputError("--effect: expected a hidden cause to be found, as --effect \"gear_ratio joint=2 "
                         "scale=3e-4\"")
    noise_of(arguments.noise)
    random = np.random.default_rng(arguments.seed)
    true = placed(deviated(robot, arguments.deviation, random, frames=False), random)
    # Masses and springs as declared: what is hidden is the cause that was asked for, and the geometry.
    true = replace(true, links=robot.links)
    hidden = [parse_effect(text, robot.axes) for text in arguments.effect]
    virtual = VirtualRobot.of(robot, hidden, true)
    arguments.progress.plan(STEPS["loop"], long=True)
    arguments.progress.stage(MEASURING)
    data = _measure(virtual, arguments, random)
    arguments.progress.stage(CALIBRATING)
    options = CalibrationOptions(compliance=(), seed=arguments.seed, threads=arguments.threads)
    calibrated = calibrate(robot, data, options)
    diagnosis = diagnose(robot, data, seed=arguments.seed, threads=arguments.threads,
                         progress=arguments.progress.stage)
    drawn = _framed(robot, data)
    rounds = []
    arguments.progress.stage(EXECUTING, total=len(ROUNDS))
    for name, model in zip(ROUNDS, (drawn, calibrated.robot, diagnosis.robot)):
        rounds.append(_execute(name, model, drawn, virtual, path, arguments.threads))
        arguments.progress.step(note=name)
    return CommandResult(
        json=_json(rounds, diagnosis), report=_report(robot, path, rounds, diagnosis, hidden),
        robot=recorded(diagnosis.robot, Asked(NAME, "", seed=arguments.seed)),
        tables={"tracking.csv": {f"error_{r.name.replace(' ', '_')}_m": r.error for r in rounds}},
        texts={"truth.toml": robot_text(virtual.true)})


def _measure(virtual: VirtualRobot, arguments, random: np.random.Generator) -> Dataset:
    low, high = (limit(virtual.nominal, name) for name in ("q_min", "q_max"))
    q = random.uniform(0.9 * low, 0.9 * high, (arguments.count, virtual.nominal.axes))
    return measure_poses(virtual, q, Sensors(position_m=arguments.noise), random)


def _framed(robot: Robot, data: Dataset) -> Robot:
    """The drawing with base and tool frames found from the measured poses."""
    _, found = frames_layout(robot, data, orientation=False)
    return replace(robot, base=found[0][1].base, tool=found[0][1].tool)


def _execute(name: str, model: Robot, drawn: Robot, virtual: VirtualRobot, path: PlannedPath,
             threads: int) -> _Round:
    """Plans with `model` so that its target follows the path of the drawing's, and executes it for real."""
    desired = path.reference()
    here, there = base_in_device(model.base, model.controller), base_in_device(drawn.base, drawn.controller)
    turn = here.rotation.T @ there.rotation
    rotation = desired.rotation[0]
    held = turn @ rotation
    origin = turn.T @ (here.rotation.T @ (here.position - there.position))
    target = lambda robot: target_on_flange(robot.tool, robot.controller).position
    offset = held @ (target(model) - target(drawn))
    moved = replace(path, curve=_Moved(path.curve, turn, origin, offset), orientation_wxyz=_quaternion(held))
    plan = plan_path(model, moved, PlanOptions(threads=threads))
    series = Dataset.of_arrays(TRACKED_MOTION.name, {"theta": plan.theta}, time=plan.time)
    measured = true_path(virtual, series, plan.q_desired, damping_s=_DAMPING_S)
    error = np.linalg.norm(measured - _in_tracker(desired, drawn), axis=1)
    return _Round(name, model, error, summarise(error))


def _in_tracker(desired: Reference, drawn: Robot) -> np.ndarray:
    """(N, 3) where the target should be, in the tracker's frame."""
    base = base_in_device(drawn.base, drawn.controller)
    target = desired.position + desired.rotation @ target_on_flange(drawn.tool, drawn.controller).position
    return target @ base.rotation.T + base.position


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z])


def _json(rounds: list[_Round], diagnosis: Diagnosis) -> dict:
    return {"rounds": [{"name": r.name, "tracking": r.summary.to_json()} for r in rounds],
            "verdict": diagnosis.verdict,
            "sentence": diagnosis.sentence,
            "effects": [{"effect": f.effect.name, "joint": f.effect.joint, "probability": f.probability}
                        for f in diagnosis.findings]}


def _report(robot: Robot, path: PlannedPath, rounds: list[_Round], diagnosis: Diagnosis,
            hidden: list[Effect]) -> Report:
    first, middle, last = rounds
    drawn, calibrated, diagnosed = quantities([r.summary.rms for r in rounds], "m")
    verdict = (
        f"On the path '{path.name}' the target of the virtual {robot.name} misses by {drawn} RMS as drawn, "
        f"by {calibrated} calibrated and by {diagnosed} diagnosed.")
    rows = tuple((r.name, *(Quantity(getattr(r.summary, f), "m") for f in ("mean", "rms", "max")))
                 for r in rounds)
    time = np.linspace(0.0, path.duration, len(first.error))
    return Report(f"The loop closed on {robot.name}", verdict, (
        Highlights(tuple(Highlight(r.name, Quantity(r.summary.rms, "m")) for r in rounds)),
        Table("Error of the target along the path", ("planned with the robot", "mean", "RMS", "maximum"),
              rows, "Executed on the true robot with its hidden cause; springs swing."),
        figure_of_panel("tracking", "Error along the path",
                        partial(curves, time, {r.name: r.error for r in rounds}, unit="m",
                                name="error of the target", log_y=True), HEIGHT_IN,
                        "Distance of the target from where it should be, round by round.",
                        "tracking error over time"),
        Text("What the diagnosis said", (diagnosis.sentence,)),
        Table("What was hidden, and what was found", ("", "effect", "in words"), (
            *((what, effect.title, with_prefixes(effect.describe_on(robot))) for what, effects in (
                ("hidden", hidden), ("found", [found.effect for found in diagnosis.findings])
            ) for effect in effects),), "The diagnosis saw the measured poses only."),
    ), "good" if last.summary.rms <= middle.summary.rms else "caution")
