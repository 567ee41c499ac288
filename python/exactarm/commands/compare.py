"""`exactarm simulate ROBOT --compare PATH`: what a plan is worth on the true robot.

The true robot is ROBOT with deviated geometry and masses, its springs, its gears, and hidden effects if asked
for. Three motor motions for one path are played on it:

    nominal      rigid inverse kinematics with the geometry of ROBOT
    identified   rigid inverse kinematics with the true geometry: a perfect kinematic calibration
    exactarm     the plan on the true robot's tables: gears, springs, masses (never the hidden effects)

Between the knots the motors follow the quintic spline through the motor angles at the knots. The flange's
error is that at the knots and that of the instants between them, at `BETWEEN` times the rate of the path.
"""

import argparse
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec

import numpy as np
from scipy.interpolate import make_interp_spline

from exactarm.commands.call import files_among
from exactarm.commands.result import CommandResult
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import TRACKED_MOTION
from exactarm.errors import InputError
from exactarm.identify.statistics import summarise
from exactarm.plan.inverse_kinematics import inverse_kinematics
from exactarm.plan.optimal import PlanOptions, plan_path
from exactarm.plan.path_file import PlannedPath, load_path
from exactarm.report import Highlight, Highlights, Quantity, Report, Table, Text, Warnings
from exactarm.report.numbers import quantity
from exactarm.report.plots.curves import curves
from exactarm.report.plots.style import HEIGHT_IN, figure_of_panel
from exactarm.robot.controller_frames import at_flange
from exactarm.robot.robot import Robot
from exactarm.robot.writer import robot_text
from exactarm.simulate import VirtualRobot, deviated, parse_effect
from exactarm.simulate.independent import independent_path
from exactarm.simulate.measure import true_path
from exactarm.simulate.plant import is_elastic
from exactarm.simulate.virtual_robot import one_sided

BETWEEN = 4
DEVIATION = 1.0  # as usual for a new arm
ENGINES = {"own": "stiff integrator", "pinocchio": "Pinocchio"}
_METHODS = {
    "nominal": "rigid, nominal geometry", "identified": "rigid, identified geometry",
    "exactarm": "exactarm's plan",
}
_LEAST_SHOWN_M = 1e-10


@dataclass(frozen=True)
class Motion:
    """Motor angles theta and planned joint angles (N, n) at the knots `time` (N,)."""

    time: np.ndarray
    theta: np.ndarray
    joints: np.ndarray


@dataclass(frozen=True)
class Played:
    """A method's motion on one engine: instants (M,), flange (M, 3) m and its error (M,) m; every BETWEEN-th
    is a knot."""

    method: str
    engine: str
    time: np.ndarray
    flange: np.ndarray
    error: np.ndarray

    @property
    def knots(self) -> np.ndarray:
        return self.error[::BETWEEN]

    @property
    def between(self) -> np.ndarray:
        return np.delete(self.error, np.s_[::BETWEEN])


def run(arguments: argparse.Namespace, robot: Robot) -> CommandResult:
    path = replace(load_path(arguments.compare), gear_direction=arguments.gear_direction)
    path = path if arguments.rate is None else replace(path, rate_hz=arguments.rate)
    if not is_elastic(robot):
        raise InputError(f"robot {robot.name}: --compare expects a spring on every axis and link masses",
                         file=robot.file)
    random = np.random.default_rng(arguments.seed)
    deviation = DEVIATION if arguments.deviation is None else arguments.deviation
    known = one_sided(deviated(robot, deviation, random, frames=False) if deviation else robot,
                      arguments.gear_direction)
    hidden = [parse_effect(text, robot.axes) for text in arguments.effect]
    virtual = VirtualRobot.of(robot, hidden, known)
    arguments.progress.stage("planning")
    motions = planned_motions(robot, known, path, arguments.threads)
    engines, silent = _engines(arguments.engine, virtual, arguments.damping or 0.0)
    played = []
    for method, motion in motions.items():
        for engine in engines:
            arguments.progress.stage(f"playing {_METHODS[method]}, {ENGINES[engine]}")
            played.append(play(virtual, method, motion, path, engine, arguments.damping or 0.0))
    columns = {"time_s": played[0].time}
    columns |= {f"error_{p.method}_{p.engine}_m": p.error for p in played}
    return CommandResult(json=_json(path, played, deviation, silent),
                         report=_report(robot, path, played, silent), tables={"compare.csv": columns},
                         inputs=files_among(arguments.compare),
                         texts={"truth.toml": robot_text(virtual.true)})


def planned_motions(nominal: Robot, known: Robot, path: PlannedPath, threads: int) -> dict[str, Motion]:
    """The three motor motions for a path: `nominal` as drawn, `known` as identified."""
    reference = path.reference()
    motions = {}
    for method, robot in (("nominal", nominal), ("identified", known)):
        joints = inverse_kinematics(at_flange(robot).core, reference).q
        motions[method] = Motion(reference.time, (joints - robot.offsets) * robot.ratios, joints)
    plan = plan_path(known, path, PlanOptions(threads=threads))
    return motions | {"exactarm": Motion(plan.time, plan.theta, plan.q_desired)}


def play(virtual: VirtualRobot, method: str, motion: Motion, path: PlannedPath, engine: str,
         damping_s: float = 0.0) -> Played:
    """The flange of the true robot along a motor motion, at and between the knots."""
    time = np.linspace(motion.time[0], motion.time[-1], BETWEEN * (len(motion.time) - 1) + 1)
    theta, joints = (make_interp_spline(motion.time, values, k=5)(time)
                     for values in (motion.theta, motion.joints))
    seen = VirtualRobot(virtual.nominal, at_flange(virtual.true))
    if engine == "pinocchio":
        flange = independent_path(seen, time, theta, joints)
    else:
        data = Dataset.of_arrays(TRACKED_MOTION.name, {"theta": theta}, time=time)
        flange = true_path(seen, data, joints, damping_s=damping_s)
    error = np.linalg.norm(flange - path.curve.motion(path.duration)(time)[0], axis=1)
    return Played(method, engine, time, flange, error)


def _engines(asked: str | None, virtual: VirtualRobot, damping_s: float) -> tuple[tuple[str, ...], str]:
    """Which engines play, and why the independent one does not; both unless one was asked for."""
    if asked in ENGINES:
        return (asked,), ""
    if virtual.true.effects or damping_s:
        return ("own",), "it knows neither effects beyond the tables nor damping"
    if find_spec("pinocchio") is None:
        return ("own",), "the package pin is not installed"
    return tuple(ENGINES), ""


def _json(path: PlannedPath, played: list[Played], deviation: float, silent: str) -> dict:
    return {"path": {"name": path.name, "samples": len(played[0].knots), "nu": path.nu,
                     "gear_direction": path.gear_direction},
            "between_knots": {"held_by": "quintic spline through the motor angles at the knots",
                              "samples_a_knot": BETWEEN},
            "deviation": deviation,
            "tracking": [{"method": p.method, "engine": p.engine, "knots": summarise(p.knots).to_json(),
                          "between": summarise(p.between).to_json()}
                         for p in played],
            "engines_differ_m": _difference(played),
            "independent_engine_silent": silent or None}


def _difference(played: list[Played]) -> dict[str, float]:
    """Method -> largest distance in m between the flanges of two engines."""
    found = {}
    for method in _METHODS:
        flanges = [p.flange for p in played if p.method == method]
        if len(flanges) == 2:
            found[method] = float(np.max(np.linalg.norm(flanges[0] - flanges[1], axis=1)))
    return found


def _report(robot: Robot, path: PlannedPath, played: list[Played], silent: str) -> Report:
    first = {method: next(p for p in played if p.method == method) for method in _METHODS}
    rms = {method: summarise(p.knots).rms for method, p in first.items()}
    verdict = (
        f"On the path '{path.name}' the flange of the true {robot.name} misses by "
        f"{quantity(rms['nominal'], 'm')} RMS with rigid inverse "
        f"kinematics as drawn, by {quantity(rms['identified'], 'm')} with its geometry identified, and by "
        f"{quantity(rms['exactarm'], 'm')} with exactarm's plan.")
    rows = tuple((_METHODS[p.method], ENGINES[p.engine], *(_micrometres(getattr(summarise(errors), name))
                                                           for errors in (p.knots, p.between)
                                                           for name in ("mean", "rms", "max")))
                 for p in played)
    header = ("motor motion", "engine",
              *(f"{name}, {where}" for where in ("knots", "between") for name in ("mean", "RMS", "max")))
    differ = _difference(played)
    agreement = (f" The two engines never differ by more than {quantity(max(differ.values()), 'm')}."
                 if differ else "")
    sections = (
        Highlights(tuple(Highlight(_METHODS[method], Quantity(rms[method], "m"))
                         for method in ("exactarm", "identified", "nominal"))),
        Table("Error of the flange in micrometres", header, rows,
              "Between knots the motors follow the quintic spline through the motor angles at the knots; "
              f"{BETWEEN - 1} instants between two knots." + agreement, len(rows) - 1),
        figure_of_panel("compare", "Error along the path",
                        partial(curves, played[0].time,
                                {_METHODS[m]: 1e6 * np.maximum(p.error, _LEAST_SHOWN_M)
                                 for m, p in first.items()},
                                name="error of the flange [µm]", log_y=True), HEIGHT_IN,
                        "Distance of the flange from the path, at and between the knots; below 0.1 nm "
                        "nothing is shown.",
                        "error of the flange over time, logarithmic, for three ways to plan"),
        Text("What is compared", (
            "The true robot deviates from the drawing in geometry and masses and moves behind its springs "
            "and gears. 'Identified' knows the true geometry and nothing else; exactarm's plan knows gears, "
            "springs and masses too. Hidden effects, if any, are on the true robot alone. What an "
            "identification from noisy measurements leaves, the command loop shows.",)),
        Warnings((f"the independent engine did not play: {silent}",) if silent else ()))
    return Report(f"What the plan is worth on {robot.name}", verdict, sections,
                  "good" if rms["exactarm"] < rms["identified"] else "caution")


def _micrometres(value: float) -> str:
    micrometres = 1e6 * value
    return f"{micrometres:,.0f}" if micrometres >= 100.0 else f"{micrometres:.3g}"
