"""`exactarm study ROBOT PATH...`: what the weight of the input trades, accuracy against bandwidth (thesis
figures 4.1 to 4.15).

Every path is planned with every weight nu, with the acceleration of the motors as the input and, for the
smaller weights, with their jerk; each plan is played on the virtual robot by the stiff integrator, at the
knots and between them. The weight of the jerk is nu / (100 rad/s)^2: at 16 Hz both inputs cost the same.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.commands.arguments import add_robot
from exactarm.commands.call import (
    AnyRobot,
    arguments_of,
    asked,
    changed_options,
    command,
    files_of,
    robot_of,
    threads_of,
)
from exactarm.commands.compare import BETWEEN, Motion, play
from exactarm.commands.output import PICTURES
from exactarm.commands.result import CommandResult
from exactarm.commands.steps import CASES, STEPS
from exactarm.commands.study_report import Case, study_report
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.identify.statistics import summarise
from exactarm.plan.optimal import PlanOptions, plan_path
from exactarm.plan.path_file import MOST_SAMPLES, PlannedPath, load_path, shipped_paths
from exactarm.plan.spectrum import PEAK_SHARE, peak_bandwidth, ringing
from exactarm.progress import SILENT, Progress
from exactarm.robot.robot import Robot
from exactarm.simulate import VirtualRobot
from exactarm.simulate.plant import is_elastic
from exactarm.simulate.virtual_robot import one_sided

NAME = "study"
HELP = "the weight of the input: accuracy against bandwidth, acceleration against jerk as the input"
UNUSED_OPTIONS = ("seed",)  # nothing in it is random
WRITES = (*PICTURES, "study.csv")
WEIGHTS = tuple(10.0**k for k in range(-14, -5))
SAME_COST_RAD_S = 100.0  # where a jerk costs what an acceleration does
# of the acceleration; above it the flange leaves the path by a tenth of a millimetre and more
MOST_JERK_WEIGHT = 1e-10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    parser.add_argument("paths", metavar="PATH", nargs="+", help="path files (.toml), or line, spiral")
    parser.add_argument("--nu", metavar="NU,NU,...",
                        help="weights to compare, at least two (default: 1e-14 to 1e-6, a decade each)")
    parser.add_argument("--rate", metavar="HZ", type=float,
                        help="samples a second (default: that of the path)")


@command
def study(robot: AnyRobot, paths: str | Path | Sequence[str | Path], *, nu: Sequence[float] | None = None,
          rate_hz: float | None = None, seed: int = DEFAULT_SEED, threads: int | None = None,
          progress: Progress = SILENT) -> CommandResult:
    """Plans with several weights of the input: accuracy against bandwidth. Nothing in it is random: `seed` is
    recorded.

    paths: path files (.toml), or line, spiral. nu: the weights (None: 1e-14 to 1e-6, a decade each); rate_hz:
    samples a second (None: that of the path).
    """
    options = changed_options(study, locals())
    named = [str(path) for path in files_of(paths, "path files, line or spiral")]
    arguments = arguments_of(add_arguments, robot_of(robot), named, options)
    vars(arguments).update(seed=seed, threads=threads_of(threads), progress=progress)
    called = asked("study", robot, None, seed, {"paths": named} | options)
    return run(arguments).asked_as(called)


def run(arguments: argparse.Namespace) -> CommandResult:
    robot = robot_of(arguments.robot)
    if not is_elastic(robot):
        raise InputError(f"robot {robot.name}: a study expects a spring on every axis and link masses",
                         file=robot.file)
    weights = _weights(arguments.nu)
    paths = [_path(name, arguments.rate) for name in arguments.paths]
    if len({path.name for path in paths}) < len(paths):
        raise InputError("PATH: two paths have the same name")
    arguments.progress.plan(STEPS["study"], long=True)
    arguments.progress.stage(CASES, total=sum(len(_inputs(weights)) for _ in paths))
    studies = {path.name: _study(robot, path, weights, arguments) for path in paths}
    files = tuple(Path(name) for name in arguments.paths if name not in shipped_paths())
    return CommandResult(json=_json(studies), report=study_report(robot, studies),
                         tables={"study.csv": _columns(studies)}, inputs=files)


def _weights(text: str | None) -> tuple[float, ...]:
    if text is None:
        return WEIGHTS
    try:
        weights = sorted({float(part) for part in text.split(",")})
    except ValueError:
        weights = []
    if len(weights) < 2 or not (weights[0] > 0.0 and np.isfinite(weights[-1])):
        raise InputError(f"--nu {text}: expected at least two different numbers above 0, separated by commas")
    return tuple(weights)


def _path(name: str, rate: float | None) -> PlannedPath:
    path = load_path(name)
    if rate is None:
        return path
    if not (np.isfinite(rate) and rate * path.duration >= 11.0):
        raise InputError(f"--rate {rate:g}: expected at least 12 samples in {path.duration:g} s, "
                         f"{11.0 / path.duration:.3g} Hz or more")
    if rate * path.duration + 1.0 > MOST_SAMPLES:
        raise InputError(f"--rate {rate:g}: expected at most {MOST_SAMPLES} samples in {path.duration:g} s, "
                         f"{MOST_SAMPLES / path.duration:.3g} Hz or less")
    return replace(path, rate_hz=rate)


def _inputs(weights: tuple[float, ...]) -> list[tuple[str, float]]:
    """Kind of input and weight of the acceleration, all cases of a path."""
    most = max(MOST_JERK_WEIGHT, min(weights))
    return [*(("acceleration", nu) for nu in weights), *(("jerk", nu) for nu in weights if nu <= most)]


def _study(robot: Robot, path: PlannedPath, weights: tuple[float, ...],
           arguments: argparse.Namespace) -> dict[str, list[Case]]:
    virtual = VirtualRobot.of(one_sided(robot, path.gear_direction))
    found: dict[str, list[Case]] = {"acceleration": [], "jerk": []}
    for kind, nu in _inputs(weights):
        weight = nu if kind == "acceleration" else nu / SAME_COST_RAD_S**2
        plan = plan_path(robot, replace(path, input=kind, nu=weight), PlanOptions(threads=arguments.threads))
        played = play(virtual, kind, Motion(plan.time, plan.theta, plan.q_desired), path, "own")
        acceleration, step = plan.theta_ddot / robot.ratios, plan.reference.step
        found[kind].append(Case(nu, plan, played, peak_bandwidth(acceleration, step), ringing(acceleration)))
        arguments.progress.step(note=f"{path.name}, {kind}, nu = {nu:.0e}")
    return found


def _all(studies: dict[str, dict[str, list[Case]]]) -> Iterator[tuple[str, str, Case]]:
    for path, kinds in studies.items():
        for kind, cases in kinds.items():
            for case in cases:
                yield path, kind, case


def _json(studies: dict[str, dict[str, list[Case]]]) -> dict[str, Any]:
    return {
        "between_knots": {"held_by": "quintic spline through the motor angles at the knots",
                          "samples_a_knot": BETWEEN},
        "bandwidth": f"highest frequency at which an axis' acceleration has more than {PEAK_SHARE:g} of the "
                     "largest peak of all axes' spectra",
        "ringing": "RMS of the acceleration's fourth difference over 16, output side",
        "cases": [
            {"path": path, "input": kind, "nu": case.plan.path.nu, "iterations": case.plan.solver.iterations,
             "seconds": case.plan.solver.seconds, "kkt_error": case.plan.solver.kkt_error,
             "tracking": {"position_rms_m": case.plan.tracking.position_rms,
                          "position_max_m": case.plan.tracking.position_max},
             "knots": summarise(case.played.knots).to_json(),
             "between": summarise(case.played.between).to_json(),
             "bandwidth_hz": list(case.bandwidth), "energy_bandwidth_hz": list(case.plan.bandwidth),
             "ringing_rad_s2": case.ringing}
            for path, kind, case in _all(studies)]}


def _columns(studies: dict[str, dict[str, list[Case]]]) -> dict[str, list[Any]]:
    """One row a case."""
    rows = list(_all(studies))
    columns: dict[str, list[Any]] = {
        "path": [path for path, _, _ in rows], "input": [kind for _, kind, _ in rows],
        "nu": [case.plan.path.nu for *_, case in rows],
        "planned_rms_m": [case.plan.tracking.position_rms for *_, case in rows]}
    for where in ("knots", "between"):
        for measure in ("rms", "max"):
            columns[f"{where}_{measure}_m"] = [getattr(summarise(getattr(case.played, where)), measure)
                                               for *_, case in rows]
    most = max(len(case.bandwidth) for *_, case in rows)
    for i in range(most):
        columns[f"bandwidth_{i + 1}_hz"] = [case.bandwidth[i] for *_, case in rows]
    for i in range(most):
        columns[f"ringing_{i + 1}_rad_s2"] = [case.ringing[i] for *_, case in rows]
    return columns
