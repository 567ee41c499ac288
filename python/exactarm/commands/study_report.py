"""The report of `exactarm study`: tables and the figures that the source shows, for every path."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from exactarm import _core
from exactarm.commands.compare import Played
from exactarm.identify.statistics import summarise
from exactarm.plan.compensation import planning_model
from exactarm.plan.optimal import Plan
from exactarm.plan.spectrum import PEAK_SHARE, amplitude
from exactarm.report import Figure, Highlight, Highlights, Quantity, Report, Section, Table, Text
from exactarm.report.numbers import number, quantity
from exactarm.report.plots.weighting import (
    MICROMETRE,
    histories,
    over_weight,
    path_in_space,
    spectra_per_axis,
    trade_off,
)
from exactarm.robot.robot import Robot

_LEAST_SHOWN_M = 1e-10
_INPUTS = ("acceleration", "jerk")


@dataclass(frozen=True)
class Case:
    """One plan, nu the weight of the acceleration it compares with, and how it went on the virtual robot."""

    nu: float
    plan: Plan
    played: Played
    bandwidth: tuple[float | None, ...]  # Hz per axis, plan/spectrum.py
    ringing: np.ndarray  # (n,) rad/s^2, output side

    @property
    def widest(self) -> float:
        """Hz: the largest bandwidth of an axis."""
        return max((value for value in self.bandwidth if value is not None), default=0.0)


Study = dict[str, list[Case]]


def study_report(robot: Robot, studies: dict[str, Study]) -> Report:
    """`studies`: path -> input -> cases in the order of their weights."""
    best = {path: kinds["acceleration"][0] for path, kinds in studies.items()}
    verdict = " ".join(_verdict(path, kinds["acceleration"]) for path, kinds in studies.items())
    sections: list[Section] = [
        Highlights(tuple(Highlight(f"{path}, between the knots, RMS",
                                   Quantity(_rms(case.played.between), "m"))
                         for path, case in best.items())),
        *[_table(path, kinds) for path, kinds in studies.items()],
        _ringing_table(studies),
        Figure("tradeoff", "Accuracy against bandwidth", partial(_trade_off, studies),
               "Error of the flange between the knots on the virtual robot over the largest bandwidth of an "
               "axis. Each point is a weight; a line joins them in their order.",
               "error over bandwidth, both logarithmic, for both inputs")]
    for path, kinds in studies.items():
        sections += _figures(robot, path, kinds)
    sections.append(Text("How to read it", (
        "Knots: the samples of the plan.",
        "Bandwidth: highest frequency at which the spectrum of the motor acceleration of an axis is above "
        f"{PEAK_SHARE:g} of the largest peak of all axes. Ringing: RMS of what alternates from knot to knot, "
        "the eigenvalue −1 of the trapezoidal rule. All accelerations on the output side of the gears. "
        "Played on the virtual robot without deviations by the stiff integrator, between the knots on the "
        "quintic spline through the motor angles at the knots.",
        "The weight of the jerk is ν / (100 rad/s)²: at 16 Hz both inputs cost the same, and a row compares "
        "two such plans.")))
    return Report(f"Weight of the input on {robot.name}", verdict, tuple(sections), "plain")


def _rms(errors: np.ndarray) -> float:
    return summarise(errors).rms


def _verdict(path: str, cases: list[Case]) -> str:
    """cases: in the order of their weights."""
    ends = [(quantity(_rms(case.played.between), "m"), _power(case.nu)) for case in (cases[0], cases[-1])]
    (least, smallest), (most, largest) = ends
    return (f"{path}: between the knots of its plan the flange is off by {least} RMS with the smallest "
            f"weight (ν = {smallest}), by {most} with the largest (ν = {largest}).")


def _micrometres(error: float) -> str:
    """One unit for errors that span many decades, each with its own digits."""
    return number(error / MICROMETRE)


def _power(nu: float) -> str:
    """A weight as a person writes it: 1e−14 as 10 to the power of −14."""
    exponent = np.log10(nu)
    if abs(exponent - round(exponent)) > 1e-9:
        return f"{nu:.3g}"
    return "10" + str(int(round(exponent))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _table(path: str, kinds: Study) -> Table:
    rows = tuple(
        (_power(case.nu), *map(_micrometres, (case.plan.tracking.position_rms, _rms(case.played.knots),
                                              _rms(case.played.between), summarise(case.played.between).max)),
         Quantity(case.widest, "Hz"), case.plan.solver.iterations)
        for case in kinds["acceleration"])
    header = ("ν", "planned, RMS [µm]", "knots, RMS [µm]", "between, RMS [µm]", "between, largest [µm]",
              "bandwidth", "iterations")
    return Table(f"Weights on {path}, acceleration as the input", header, rows,
                 "Error of the flange: on the planner's model, then on the virtual robot at and between the "
                 "knots.", 0)


def _ringing_table(studies: dict[str, Study]) -> Table:
    rows = []
    for path, kinds in studies.items():
        for jerk in kinds["jerk"]:
            plain = next(case for case in kinds["acceleration"] if case.nu == jerk.nu)
            rows.append((path, _power(jerk.nu), *(
                cell for pair in zip(_compared(plain), _compared(jerk)) for cell in pair)))
    header = ("path", "ν", *(f"{name}, {kind}{unit}" for name, unit in (
        ("knots", " [µm]"), ("between", " [µm]"), ("bandwidth", ""), ("ringing", "")) for kind in ("a", "j")))
    return Table("Acceleration (a) and jerk (j) as the input", header, tuple(rows),
                 "RMS errors of the flange on the virtual robot; largest bandwidth and ringing of an axis.")


def _compared(case: Case) -> tuple[str | Quantity, ...]:
    return (_micrometres(_rms(case.played.knots)), _micrometres(_rms(case.played.between)),
            Quantity(case.widest, "Hz"), Quantity(float(1e3 * case.ringing.max()), "mrad/s²"))


def _trade_off(studies: dict[str, Study]):
    lines = {path: {f"{kind} as the input": (np.array([case.widest for case in cases]),
                                                      np.array([_rms(case.played.between) for case in cases]))
                    for kind, cases in kinds.items()}
             for path, kinds in studies.items()}
    return trade_off(lines, "RMS error between knots", "largest bandwidth", "Hz")


def _figures(robot: Robot, path: str, kinds: Study) -> list[Figure]:
    cases = kinds["acceleration"]
    shown = [cases[0], cases[len(cases) // 2], cases[-1]] if len(cases) > 2 else cases
    labels = [f"ν = {_power(case.nu)}" for case in shown]
    best, time = cases[0].plan, cases[0].plan.time
    axis = int(np.argmax(np.abs(best.theta_ddot / robot.ratios).max(axis=0)))  # whose motor is livelier
    each = lambda pick: {label: pick(case) for label, case in zip(labels, shown)}
    per_axis = lambda values: {f"axis {i + 1}": values[:, i] for i in range(values.shape[1])}
    smallest = f"ν = {_power(cases[0].nu)}"
    joints, orientation = best.q - best.q_desired, _turned(robot, best)
    planned, wanted = (np.linalg.norm(np.gradient(p, time, axis=0), axis=1)
                       for p in (best.position, best.reference.position))
    build = [
        ("weight", "error and bandwidth over the weight", "Error of the flange on the virtual robot, at and "
                                                          "between the knots, and bandwidth of each axis.",
         partial(
             over_weight,
             np.array([case.nu for case in cases]),
             {label: np.array([getattr(summarise(getattr(case.played, where)), field) for case in cases])
              for label, where, field in (("RMS at knots", "knots", "rms"), ("between", "between", "rms"),
                                          ("largest", "between", "max"))},
             np.array([[np.nan if b is None else b for b in case.bandwidth] for case in cases]))),
        ("spectrum", "spectrum of the motor acceleration",
         "Output side; the highest amplitude of each narrow band.",
         partial(spectra_per_axis, _spectrum(robot, shown[0])[0],
                 each(lambda case: _spectrum(robot, case)[1]))),
        ("error", "error of the flange over time", "Distance of the flange from the path at the samples, on "
                                                   "the planner's model.",
         partial(histories, time,
                 [("position error", "m",
                   each(lambda case: np.maximum(case.plan.position_error, _LEAST_SHOWN_M)))],
                           log_y=True)),
        ("axis", f"what the weight does to axis {axis + 1}",
         "Motor acceleration, motor rate and link rate, output side.",
         partial(histories, time, [
             ("motor acceleration", "rad/s²",
              each(lambda case: (case.plan.theta_ddot / robot.ratios)[:, axis])),
             ("motor rate", "rad/s", each(lambda case: (case.plan.theta_dot / robot.ratios)[:, axis])),
             ("link rate", "rad/s", each(lambda case: case.plan.q_dot[:, axis]))])),
        ("speed", "speed along the path", f"{smallest}, differences of the planned positions.",
         partial(histories, time, [("speed", "m/s", {"desired": wanted, "calculated": planned})])),
        ("errors", f"errors with {smallest}", "Joint angles, orientation of the flange and its position, on "
                                              "the planner's model.",
         partial(histories, time, [
             ("joint error", "rad", per_axis(joints)),
             ("orientation error", "rad",
              {name: orientation[:, k] for k, name in enumerate(("about x", "about y", "about z"))}),
             ("position error", "m",
              {name: (best.position - best.reference.position)[:, k] for k, name in enumerate("xyz")})])),
        ("motion", f"motion with {smallest}", "Motor acceleration, motor rate and link rate, output side.",
         partial(histories, time, [("motor acceleration", "rad/s²", per_axis(best.theta_ddot / robot.ratios)),
                                  ("motor rate", "rad/s", per_axis(best.theta_dot / robot.ratios)),
                                  ("link rate", "rad/s", per_axis(best.q_dot))])),
        ("space", "path in space", f"{smallest}; the axes of the flange at some instants.",
         partial(path_in_space, best.reference.position, best.position, best.reference.rotation)),
        ("jerk", "spectrum with either input", "Motor acceleration, output side, both with the weight of "
                                               f"{smallest}.",
         partial(spectra_per_axis, _spectrum(robot, cases[0])[0],
                                  {f"{kind} as the input": _spectrum(robot, kinds[kind][0])[1]
                                   for kind in _INPUTS}))]
    main = {"spectrum": axis, "jerk": axis, "errors": 2}  # of the position
    return [Figure(f"{name}_{path}", f"{path.capitalize()}: {heading}", draw, caption, heading,
                   main=main.get(name, 0))
            for name, heading, caption, draw in build]


def _spectrum(robot: Robot, case: Case) -> tuple[np.ndarray, np.ndarray]:
    return amplitude(case.plan.theta_ddot / robot.ratios, case.plan.reference.step)


def _turned(robot: Robot, plan) -> np.ndarray:
    """(N, 3) rad: small rotation from the desired orientation to that of the planned joint angles."""
    rotation = _core.forward_kinematics(planning_model(robot).core, plan.q)[1].reshape(-1, 3, 3)
    off = np.swapaxes(plan.reference.rotation, -1, -2) @ rotation
    return 0.5 * np.stack([off[:, 2, 1] - off[:, 1, 2], off[:, 0, 2] - off[:, 2, 0],
                           off[:, 1, 0] - off[:, 0, 1]], axis=1)
