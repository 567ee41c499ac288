"""What the report of `exactarm gear` shows: errors before and after, spectra, tables, both methods on
held-out runs."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from exactarm.commands.next_steps import ENOUGH_FALL, next_steps
from exactarm.data.kinds import GEAR_RUN
from exactarm.identify.gear import Gear, GearIdentification
from exactarm.identify.gear_declared import SIDES
from exactarm.report import Estimate, Figure, Highlight, Highlights, Quantity, Report, Table, Text, Warnings
from exactarm.report.numbers import change, fixed, quantity
from exactarm.report.plots.residual import residual_over_signal, spectrum
from exactarm.report.plots.style import figure_of_panel
from exactarm.robot.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEVEL = 1.96
_MOST_SHOWN = 6000
_MOST_MARKS = 6


def gear_report(robot: Robot, result: GearIdentification, rule: str) -> Report:
    """Verdict, table, comparison of the methods, alignment, then figures and coefficients gear by gear."""
    judge = "validation" if any(gear.after["validation"].n for gear in result.gears) else "identification"
    before, after, declared = (_pooled(result.gears, name, judge) for name in ("before", "after", "declared"))
    unit = result.gears[0].unit
    error = "transmission error" if unit == "rad" else "kinematic error"
    filtered = any(gear.cutoff_hz for gear in result.gears)
    verdict = (f"The {error}{', behind a low-pass,' if filtered else ''} on runs that were "
               f"{'never fitted' if judge == 'validation' else 'fitted (none was held out)'} "
               f"{change(before, after, unit)} RMS{_as_declared(before, declared, unit)}; "
               f"{_noise_sentence(result.gears)}.")
    if filtered:
        plain = _pooled(result.gears, "unfiltered", judge)
        verdict += f" Without the low-pass, as `evaluate` has it, {quantity(plain, unit)} are left."
    fall = after < ENOUGH_FALL * before
    sections = (Highlights((Highlight(f"{judge}, RMS", Quantity(after, unit), Quantity(before, unit)),)),
                next_steps(robot, GEAR_RUN, declared, after),
                _error_table(result.gears, error, rule), _method_table(result, unit),
                *_alignment_table(result), *_ratio_and_disturbances(robot, result.gears),
                *(section for gear in result.gears for section in _gear_sections(gear, error)),
                Warnings(result.warnings))
    return Report(f"Gears of {robot.name}", verdict, sections, "good" if fall else "caution")


def _as_declared(before: float, declared: float, unit: str) -> str:
    """What the tables of the robot file leave, where it has other ones than a constant ratio."""
    return f" (as the file has it: {quantity(declared, unit)})" if declared < ENOUGH_FALL * before else ""


def _pooled(gears, name: str, judge: str) -> float:
    parts = [getattr(gear, name)[judge] for gear in gears if getattr(gear, name)[judge].n]
    return float(np.sqrt(sum(s.n * s.rms**2 for s in parts) / sum(s.n for s in parts)))


def _noise_sentence(gears) -> str:
    noise = float(np.sqrt(np.mean([gear.noise**2 for gear in gears])))
    return f"the sensor's noise alone is {quantity(noise, gears[0].unit)}"


def _error_table(gears, error: str, rule: str) -> Table:
    rows = []
    for gear in gears:
        for name in ("identification", "validation"):
            before, after = gear.before[name], gear.after[name]
            if before.n:
                fall = f"{fixed(100.0 * (1.0 - after.rms / before.rms), 0)} %"
                numbers = (Quantity(before.rms, gear.unit), Quantity(after.rms, gear.unit), fall)
                rows.append((f"{gear.joint} {gear.side}", name, before.n, *numbers,
                             Quantity(gear.noise, gear.unit), Quantity(gear.declared[name].rms, gear.unit),
                             *([Quantity(gear.unfiltered[name].rms, gear.unit)] if gear.cutoff_hz else [])))
    cutoffs = sorted({f"{gear.cutoff_hz:.0f} Hz" for gear in gears if gear.cutoff_hz})
    filtered = (f" Both sides filtered alike, -3 dB at {', '.join(cutoffs)}."
                if cutoffs else " One offset for each run taken out.")
    note = f"RMS. Before: the constant ratio that was identified.{filtered} {rule}"
    header = ("gear", "set", "rows", "before", "after", "fall", "noise", "as the file has it",
              *(["after, unfiltered"] if cutoffs else []))
    return Table(error.capitalize(), header, tuple(rows), note)


def _method_table(result: GearIdentification, unit: str) -> Table:
    methods = tuple(result.held_out[0].after) if result.held_out else ()
    rows = tuple(
        (f"{h.joint} {h.side}", Quantity(h.speed, "rad/s"), "identification" if h.fitted else "validation",
         h.rows, Quantity(h.before, unit), *(Quantity(h.after[name], unit) for name in methods))
        for h in result.held_out)
    note = ("refined: orders are real numbers, from a zoom and variable projection. neighbours: the nearest "
            f"whole numbers of the coarse FFT with their neighbours. The robot file has: {result.method}.")
    header = ("gear", "speed at the output", "set", "rows", "before", *methods)
    return Table("Both methods, by direction, speed and set (RMS)", header, rows, note)


def _alignment_table(result: GearIdentification) -> tuple[Table, ...]:
    if not result.alignments:
        return ()
    rows = []
    for entry in result.alignments:
        for axis, before, after in zip("xyz", entry.before, entry.after):
            rows.append((f"{entry.joint} {entry.side}", axis, Quantity(float(before), "rad/s"),
                         Quantity(float(after), "rad/s")))
    angles = {(e.joint, e.angles) for e in result.alignments}
    turn = lambda angle: f"{1e3 * angle:.2f} mrad".replace("-0.00", "0.00")
    note = "; ".join(f"axis {joint}: {turn(alpha)} about x, {turn(beta)} about y"
                     for joint, (alpha, beta) in sorted(angles))
    return (Table("Alignment of the gyroscope: mean reading", ("gear", "sensor axis", "before", "after"),
                  tuple(rows), note),)


def _ratio_and_disturbances(robot: Robot, gears) -> tuple:
    seen, rows, beside, rest = set(), [], [], []
    for gear in gears:
        if gear.unit == "rad":
            numbers = (Quantity(gear.after[name].rms, gear.unit) for name in ("identification", "validation"))
            left = (Quantity(gear.rest[name].rms, gear.unit) for name in ("identification", "validation"))
            rest.append((f"{gear.joint} {gear.side}",
                         *(cell for pair in zip(numbers, left) for cell in pair)))
    for gear in gears:
        if gear.joint in seen:
            continue
        seen.add(gear.joint)
        e = gear.estimate
        declared = robot.joints[gear.joint - 1].ratio
        rows.append((str(gear.joint), Quantity(declared, "", exact=True),
                     Estimate(e.ratio, e.ratio - _LEVEL * e.ratio_sigma, e.ratio + _LEVEL * e.ratio_sigma)))
        for name, value in zip(gear.samples.disturbance_names, e.disturbance):
            if value and not name.startswith("offset"):
                beside.append((str(gear.joint), name,
                               Quantity(float(value), _disturbance_unit(name, gear.unit))))
    ranges = [profile.range_rev for gear in gears for profile in gear.estimate.profiles.values()]
    note = ("On less than two turns a wheel that runs out, once or twice a turn, looks much like another "
            "ratio: the interval holds what it may be." if min(ranges) < 2.0 else "")
    tables: list = [Table("Ratio", ("axis", "declared", "identified (95 %)"), tuple(rows), note)]
    if beside:
        tables.append(Table(
            "Beside the gear", ("axis", "what", "size"), tuple(beside),
            "Fitted together with the harmonics so that they do not bend them; not taken out of the errors "
            "above (but for the bias) and not in the robot file: `exactarm diagnose` names such effects."))
    if rest:
        header = ("gear", "identification", "identification without", "validation", "validation without")
        note = "RMS of the transmission error after, and without delay, wind-up and friction."
        tables.append(Table("What remains", header, tuple(rest), note))
    return tuple(tables)


def _disturbance_unit(name: str, unit: str) -> str:
    return {"bias": "rad/s", "delay": "s", "wind-up": "rad/Nm"}.get(name, unit)


def _gear_sections(gear: Gear, error: str) -> tuple:
    e, unit = gear.estimate, gear.unit
    title = (f"axis {gear.joint}, "
             f"{'clockwise (the motor angle falls)' if gear.side == 'cw' else 'counter-clockwise'}")
    if not gear.table.order.size:
        nothing = ("No order can be identified on this range" if e.dropped.size
                   else "No order stands out of the noise")
        return (Text(f"Gear of {title}", (f"{nothing}: the constant ratio is all that was found.",)),)
    chosen = gear.samples.side(SIDES[gear.side])
    if np.any(chosen & ~gear.samples.identification):
        chosen = chosen & ~gear.samples.identification
    shown = np.flatnonzero(chosen)
    shown = shown[:: max(1, shown.size // _MOST_SHOWN)]
    angle = gear.samples.angle[shown] / e.scale
    before, after = gear.error_before[shown], gear.error_after[shown]
    stem = f"gear_{gear.joint}_{gear.side}"
    figures = (figure_of_panel(f"{stem}_spectrum", f"Spectrum of the {error}, {title}",
                               partial(_spectrum, gear), 3.3,
                               "Relative amplitude of the ratio over the order, before and after.",
                               f"spectrum of gear {gear.joint}"),
               Figure(f"{stem}_error", f"{error.capitalize()} over the angle, {title}",
                      partial(residual_over_signal, angle, before, after, unit=unit, name=error,
                              signal_name="angle of the output", signal_unit="rad"),
                      "Before (constant ratio) and after (with the harmonics).",
                      f"{error} of gear {gear.joint} over the angle", main=1))
    fit, m = e.tables[gear.side], gear.table.order.size
    sigma = _LEVEL * np.sqrt(np.diag(fit.covariance))
    around = lambda value, half: Estimate(float(value), float(value - half), float(value + half))
    rows = tuple(
        (around(gear.table.order[k], _LEVEL * e.order_sigma[k]), around(gear.table.a[k], sigma[k]),
         around(gear.table.b[k], sigma[m + k]), Quantity(float(np.hypot(gear.table.a[k], gear.table.b[k]))))
        for k in range(m))
    note = (
        "u = ratio (1 + sum a cos(order phi) - b sin(order phi)); estimates with 95 % intervals, relative to "
        "the ratio.")
    return (*figures,
            Table(f"Harmonics, {title}", ("order per output revolution", "a", "b", "amplitude"), rows, note))


def _spectrum(gear: Gear, axes: Axes) -> None:
    profile, table = gear.estimate.profiles[gear.side], gear.estimate.tables[gear.side]
    low = 2.0 / profile.range_rev
    high = max(1.3 * float(gear.table.order.max()), low + 10.0)
    count = int(np.clip(4.0 * profile.range_rev * (high - low), 256, 8192))
    constant = 1.0 if profile.rated else 0.0
    level = np.average(profile.value - constant, weights=profile.weight)
    orders, before = profile.amplitude(profile.value - constant - level, low, high, count)
    _, after = profile.amplitude(table.residual, low, high, count)
    size = np.hypot(gear.table.a, gear.table.b)
    strongest = np.argsort(-size)[:_MOST_MARKS]
    marks = [(float(gear.table.order[k]), f"{gear.table.order[k]:.1f}") for k in sorted(strongest)]
    spectrum(orders, before, after, axes, unit="", name="relative amplitude", marks=marks)
