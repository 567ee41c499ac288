"""`exactarm plan`: the motor motion that puts the flange on a path."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from exactarm.chain.direction import TRANSITION_S, reversals
from exactarm.commands.arguments import add_robot
from exactarm.commands.call import AnyRobot, asked, command, robot_of, threads_of
from exactarm.commands.model_trust import thinned, trust_highlights, trust_json, trust_text
from exactarm.commands.output import PICTURES
from exactarm.commands.result import CommandResult
from exactarm.commands.steps import PLANNING, STEPS, TRUSTED
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.identify.declared import require_geometry
from exactarm.identify.pose_uncertainty import model_uncertainty
from exactarm.plan.optimal import ENERGY_SHARE, Plan, PlanOptions, plan_path
from exactarm.plan.path_file import CHOICES, MOST_SAMPLES, PlannedPath, load_path, shipped_paths
from exactarm.plan.sent import FILES, sent_text
from exactarm.plan.trajectory import trajectory_table
from exactarm.progress import SILENT, Progress
from exactarm.report import Figure, Highlight, Highlights, Quantity, Report, Section, Table, Text, Warnings
from exactarm.report.numbers import quantity
from exactarm.report.plots.curves import curves, curves_per_axis
from exactarm.report.plots.style import HEIGHT_IN, figure_of_panel
from exactarm.robot.robot import Robot

NAME = "plan"
HELP = "motor trajectory that puts the flange on a path (line, spiral, or a path file)"
UNUSED_OPTIONS = ("seed",)  # nothing in it is random
IPOPT = "ipopt"
STANDS = 1e-4  # of the largest rate: an axis below only makes up for what springs give


def WRITES(arguments: argparse.Namespace) -> list[str]:  # of other commands a tuple
    return [*PICTURES, f"trajectory.{arguments.format}", *([FILES[arguments.send]] if arguments.send else ())]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robot(parser)
    parser.add_argument("path", metavar="PATH", help="path file (.toml), or line or spiral")
    parser.add_argument("--rate", metavar="HZ", type=float,
                        help="samples a second (default: that of the path)")
    parser.add_argument("--duration", metavar="S", type=float,
                        help="duration in s (default: that of the path); "
                             "stretches the times of via-points too")
    parser.add_argument("--nu", type=float, help="weight of the input (default: that of the path)")
    for key, options in CHOICES.items():
        parser.add_argument(f"--{key.replace('_', '-')}", choices=options, help="instead of the path's own")
    parser.add_argument("--start", metavar="DEG,DEG,...",
                        help="joint angles near the first pose, to choose a branch")
    parser.add_argument("--format", choices=("csv", "parquet"), default="csv",
                        help="of the trajectory (default csv)")
    parser.add_argument("--send", choices=tuple(FILES),
                        help="also in the words of a controller: joint angles as it reports them")


@command
def plan(robot: AnyRobot, path: str | Path | PlannedPath, *, rate_hz: float | None = None,
         duration_s: float | None = None, nu: float | None = None, gear_direction: str | None = None,
         input: str | None = None, solver: str | None = None, linear_solver: str | None = None,
         start_rad: Sequence[float] | np.ndarray | None = None, format: Literal["csv", "parquet"] = "csv",
         send: Literal["joint_trajectory", "servoj", "krl", "csv", "pulses"] | None = None,
         seed: int = DEFAULT_SEED, threads: int | None = None, progress: Progress = SILENT) -> CommandResult:
    """Plans the motor motion that keeps the flange on a path: `line`, `spiral`, a path file or a PlannedPath.

    None: as the path says. send: also as a file for a controller. start_rad: joint angles near the first
    pose, to choose a branch.

        >>> import exactarm as ea
        >>> result = ea.plan("racer-7-1.4", "line", rate_hz=200)
        >>> result["tracking"]["position_rms_m"] < 1e-6
        True
    """
    choices = {"gear_direction": gear_direction, "input": input, "solver": solver,
               "linear_solver": linear_solver}
    changed = {"rate_hz": rate_hz, "duration_s": duration_s, "nu": nu} | choices
    if send is not None and send not in FILES:
        raise InputError(f"send {send!r}; expected one of {', '.join(FILES)}")
    declared, follow = robot_of(robot), _path(path, rate_hz, duration_s, nu, choices)
    require_geometry(declared)
    progress.plan(STEPS["plan"])
    progress.stage(PLANNING)
    start = None if start_rad is None else np.asarray(start_rad, float)
    result = plan_path(declared, follow, PlanOptions(threads=threads_of(threads), start=start))
    progress.stage(TRUSTED)
    radius = model_uncertainty(declared, thinned(result.q_desired), threads_of(threads))
    file = [] if isinstance(path, PlannedPath) or str(path) in shipped_paths() else [Path(path)]
    name = follow.name if isinstance(path, PlannedPath) else str(path)
    return CommandResult(json=_json(result) | {"model_uncertainty": trust_json(radius)},
                         report=_report(declared, result, radius, send),
                         tables={f"trajectory.{format}": trajectory_table(result)},
                         texts={} if send is None else {FILES[send]: sent_text(send, declared, result)},
                         inputs=tuple(file),
                         asked=asked("plan", robot, None, seed,
                                     {"path": name} | {k: v for k, v in changed.items() if v is not None}))


def run(arguments: argparse.Namespace) -> CommandResult:
    return plan(arguments.robot, arguments.path, rate_hz=arguments.rate, duration_s=arguments.duration,
                nu=arguments.nu, **{key: getattr(arguments, key) for key in CHOICES},
                start_rad=_start(arguments.start), format=arguments.format, send=arguments.send,
                seed=arguments.seed, threads=arguments.threads, progress=arguments.progress)


def _path(given: str | Path | PlannedPath, rate_hz: float | None, duration_s: float | None, nu: float | None,
          choices: dict[str, str | None]) -> PlannedPath:
    path = given if isinstance(given, PlannedPath) else load_path(given)
    for name, value in {"rate": rate_hz, "duration": duration_s, "nu": nu}.items():
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise InputError(f"--{name}: expected a number above 0, found {value}")
    for name, choice in choices.items():
        if choice is not None and choice not in CHOICES[name]:
            raise InputError(f"{name} {choice!r}: expected one of {', '.join(CHOICES[name])}")
    if choices["linear_solver"] and (choices["solver"] or path.solver) != IPOPT:
        raise InputError(f"--linear-solver acts with --solver {IPOPT} only")
    if duration_s is not None:
        path = path.lasting(duration_s)
    chosen: dict[str, Any] = {"rate_hz": rate_hz, "nu": nu, **choices}
    path = replace(path, **{key: value for key, value in chosen.items() if value is not None})
    samples = path.duration * path.rate_hz + 1.0
    if not 12.0 <= samples <= MOST_SAMPLES:
        raise InputError(f"{samples:.0f} samples at {path.rate_hz:g} Hz in {path.duration:g} s: expected 12 "
                         f"to {MOST_SAMPLES}; change --rate or --duration")
    return path


def _start(text: str | None) -> np.ndarray | None:
    if text is None:
        return None
    try:
        return np.radians([float(part) for part in text.split(",")])
    except ValueError:
        raise InputError(f"--start {text}: expected joint angles in degrees as 0,90,0,0,90,0") from None


def _json(plan: Plan) -> dict[str, Any]:
    solver, tracking = plan.solver, plan.tracking
    return {
        "solver": {"name": solver.name, "linear_solver": solver.linear_solver, "status": solver.status,
                   "iterations": solver.iterations, "seconds": solver.seconds, "kkt_error": solver.kkt_error,
                   "objective": solver.objective},
        "tracking": {"position_rms_m": tracking.position_rms, "position_max_m": tracking.position_max,
                     "joint_max_rad": tracking.joint_max},
        "bandwidth_hz": list(plan.bandwidth),
        "path": {"name": plan.path.name, "duration_s": plan.path.duration, "samples": len(plan.time),
                 "step_s": plan.reference.step, "nu": plan.path.nu, "input": plan.path.input,
                 "gear_direction": plan.path.gear_direction},
        "violations": [{"joint": v.joint, "quantity": v.quantity, "unit": v.unit, "value": v.value,
                        "limit": v.limit,
                        "time_s": v.time} for v in plan.violations],
        "shortest_duration_s": plan.shortest_duration,
        "reversals": [{"joint": i + 1, "time_s": instant} for i, column in enumerate(plan.q_desired.T)
                      for instant, _ in reversals(plan.time, column)[1]],
        "passage_s": TRANSITION_S,
        "compensated": list(plan.compensated),
        "warnings": list(plan.warnings)}


def _sent(send: str | None) -> Text:
    """Which column is sent: neither of the two that a reader would take."""
    file = (f"They stand in {FILES[send]}." if send
            else "They are written by --send " + ", ".join(FILES) + ".")
    return Text("What is sent", (
        "trajectory holds theta_i, the motors, and q_i, the links behind gears and springs. A controller "
        "takes neither: it takes the joint angles that it reports, theta_i / controller_ratio + offset. "
        f"{file}",))


def _report(robot: Robot, plan: Plan, radius: np.ndarray | None, send: str | None = None) -> Report:
    tracking, solver = plan.tracking, plan.solver
    verdict = ("On the planner's model the flange keeps to the path within "
               f"{quantity(tracking.position_max, 'm')} ({quantity(tracking.position_rms, 'm')} RMS) at the "
               f"samples; solved in {solver.iterations} iterations and {quantity(solver.seconds, 's')}.")
    sections: list[Section] = [
        Highlights((Highlight("flange error, RMS", Quantity(tracking.position_rms, "m")),
                    Highlight("flange error, largest", Quantity(tracking.position_max, "m")),
                    Highlight("joint error, largest", Quantity(tracking.joint_max, "rad")),
                    *trust_highlights(radius))),
        _axis_table(robot, plan),
        Text("Solver", (f"{solver.name} ({solver.linear_solver}): {solver.status} after {solver.iterations} "
                        "iterations; "
                        f"largest first-order error, computed outside the solver: {solver.kkt_error:.1e}.",))]
    if plan.compensated:
        sections.append(Text("Compensated effects", (", ".join(plan.compensated) + ".",)))
    sections += [_sent(send), trust_text(radius, "along the path"), *_figures(robot, plan),
                 Warnings(plan.warnings)]
    return Report(f"Plan for {robot.name}: {plan.path.name}", verdict, tuple(sections),
                  "caution" if plan.warnings else "good")


def _axis_table(robot: Robot, plan: Plan) -> Table:
    sliding = np.array([joint.type == "prismatic" for joint in robot.joints])
    unit, size = np.where(sliding, "m", "deg"), np.where(sliding, 1.0, np.degrees(1.0))
    rate = size * np.abs(plan.theta_dot / robot.ratios).max(axis=0)
    acceleration = size * np.abs(plan.theta_ddot / robot.ratios).max(axis=0)
    moves = rate > STANDS * rate.max()
    shown = lambda i, value, named: Quantity(value if moves[i] else None, named)
    rows = tuple((str(i + 1), shown(i, float(rate[i]), f"{unit[i]}/s"),
                  shown(i, float(acceleration[i]), f"{unit[i]}/s²"), shown(i, plan.bandwidth[i], "Hz"))
                 for i in range(robot.axes))
    note = (
        f"Output side. Bandwidth: below it lie {100 * ENERGY_SHARE:.0f} % of the energy of the acceleration."
        + ("" if moves.all() else " An axis that stands still has none."))
    return Table("Axes", ("axis", "largest rate", "largest acceleration", "bandwidth"), rows, note)


def _figures(robot: Robot, plan: Plan) -> tuple[Figure, ...]:
    spectrum = np.abs(np.fft.rfft(plan.theta_ddot / robot.ratios, axis=0)) * 2.0 / len(plan.time)
    frequency = np.fft.rfftfreq(len(plan.time), plan.reference.step)
    return (
        figure_of_panel("flange_error", "Error of the flange",
                        partial(curves, plan.time, {"error": plan.position_error}, unit="m",
                                name="position error"), HEIGHT_IN,
                        "Distance of the flange from the path at the samples, on the planner's model.",
                        "flange error over time"),
        Figure("motor_rate", "Motor rates, output side",
               partial(curves_per_axis, plan.time,
                       {"motor": plan.theta_dot / robot.ratios, "link": plan.q_dot},
                                       unit="rad/s", name="rate"),
               "What the motors do so that the links move smoothly.", "motor and link rates over time",
               main=int(np.argmax(np.abs(plan.theta_dot / robot.ratios).max(axis=0)))),
        Figure("spectrum", "Spectrum of the motor accelerations",
               partial(curves_per_axis, frequency[1:], {"acceleration": spectrum[1:]}, unit="rad/s²",
                       name="amplitude", x_name="frequency", x_unit="Hz", log_x=True, log_y=True),
               "Single-sided amplitude of the input, output side.", "spectrum of the input per axis",
               main=int(np.argmax(spectrum[1:].max(axis=0)))))
