"""Found effects as a technician reads them: one line each, their curves, their strongest orders, their sizes
at the tool."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from exactarm.data.kinds import kind_of
from exactarm.diagnose.contribution import Contribution
from exactarm.diagnose.decisions import CREDIBLE, NAMED_AT, ROUNDING
from exactarm.diagnose.diagnosis import Diagnosis, Finding
from exactarm.effects.axis_units import slides
from exactarm.effects.base import Effect
from exactarm.effects.order_source import likely_source
from exactarm.effects.units_in_names import unit_of, words_of
from exactarm.report import Cell, Estimate, Figure, Quantity, Table
from exactarm.report.numbers import quantities, quantity
from exactarm.report.plots.effects import ROW_IN, EffectPanel, contribution_bars, effect_panels
from exactarm.report.plots.style import figure_of_panel
from exactarm.robot.robot import Robot
from exactarm.station import Station

_AT_TOOL = {  # by the unit of the error: of positions, of torques; else of angles
    "m": "At the tool: median, over the {rows} that the effect moves, of what it moves the target and "
    "nothing else in the model makes up for.",
    "Nm": "At the tool: the torque over the stiffness of the joints in the robot file, times the distance of "
    "the flange from their axes, median over the rows; of friction at most so much, for what acts on the "
    "motor's side of the spring does not bend it.",
}
_OF_ANGLES = ("At the tool: the angle error times the distance of the flange from the axis, median over the "
              "rows.")
_MOST_ORDERS = 3  # of one effect
_LEAST_ORDER = 0.25  # of its strongest order: weaker ones are not listed
_MOST_PANELS = 12
_FEW = 12  # parameters that are listed one by one
_PLACES = 5  # of rows left out, that are listed
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven",
            "twelve")


def in_order(
    found: Sequence[tuple[Finding, Contribution | None]]
) -> list[tuple[Finding, Contribution | None]]:
    """In the order of the chain, then of the axes; those less likely than not last."""
    return sorted(found, key=lambda pair: (pair[0].probability < NAMED_AT, pair[0].effect.station,
                                           pair[0].effect.joint or 0))


def on_axes(joints: Sequence[int | None], axes: int) -> str:
    """" of axis 2", " of axes 1 to 4", " of all six axes"; nothing for effects of no single axis."""
    numbers = sorted({joint for joint in joints if joint is not None})
    if not numbers:
        return ""
    if len(numbers) == axes and axes > 1:
        return f" on all {_NUMBERS[axes] if axes < len(_NUMBERS) else axes} axes"
    if len(numbers) == 1:
        return f" on axis {numbers[0]}"
    if len(numbers) > 2 and numbers == list(range(numbers[0], numbers[-1] + 1)):
        return f" on axes {numbers[0]} to {numbers[-1]}"
    return f" on axes {in_words([str(number) for number in numbers])}"


def in_words(items: Sequence[str]) -> str:
    """"a", "a and b", "a, b and c"."""
    return " and ".join(part for part in (", ".join(items[:-1]), *items[-1:]) if part)


def rows_left_out(result: Diagnosis, finding: Finding) -> Quantity | None:
    """The size of an effect that moves nothing but leaves rows out: the median error of those rows."""
    if not finding.effect.excludes_rows() or result.excluded_error is None:
        return None
    return Quantity(result.excluded_error, "m")


def causes_in_words(result: Diagnosis, found: Sequence[tuple[Finding, Contribution | None]],
                    axes: int) -> str:
    """What the model lacked, in one phrase, the largest at the tool first, like ones of several axes
    together; what may be another cause is called probable."""
    groups: dict[str, list[tuple[Finding, Contribution | None]]] = {}
    for finding, contribution in found:
        groups.setdefault(finding.effect.in_plain_words_on(result.robot), []).append((finding, contribution))
    size = lambda members: max((c.at_tool or 0.0 for _, c in members if c is not None), default=0.0)
    told = dict(zip(groups, quantities([size(members) for members in groups.values()], "m")))
    probable = {words for words, members in groups.items()
                if min(finding.probability for finding, _ in members) < CREDIBLE}
    phrases = []
    for words, members in sorted(groups.items(), key=lambda item: -size(item[1])):
        # Of a displacement the width along one turn holds what geometry makes up for, too.
        widths = [c.peak_to_peak[0] for _, c in members if c is not None and c.curve and c.unit == "rad"
                  and c.effect.station is not Station.GEOMETRY]
        sizes = [f"up to {quantity(max(widths), 'rad')} peak to peak"] if widths else []
        # of positions: what the geometry, estimated again, cannot make up for
        after = " after calibration" if result.unit == "m" else ""
        sizes += [f"{told[words]} at the tool{after}"] if size(members) else []
        sizes += [f"{result.excluded} rows, {quantity(left.value, 'm')} off in the median"
                  if result.excluded > 1 else f"1 row, {quantity(left.value, 'm')} off"
                  for finding, _ in members if (left := rows_left_out(result, finding))]
        sure = "" if words not in probable or len(probable) == len(groups) else "probably "
        phrases.append(sure + words + on_axes([f.effect.joint for f, _ in members], axes)
                       + (f" ({', '.join(sizes)})" if sizes else ""))
    return f"{'probably ' if len(probable) == len(groups) else ''}lacked {'; '.join(phrases)}"


def effects_tables(result: Diagnosis, found: Sequence[tuple[Finding, Contribution | None]]) -> list[Table]:
    """The causes, and apart from them what the model holds although it is less likely than not."""
    likely = [pair for pair in found if pair[0].probability >= NAMED_AT]
    rest = [pair for pair in found if pair[0].probability < NAMED_AT]
    parts = (("Causes found", likely), ("Less likely than not, and in robot.toml all the same", rest))
    return [_effects_table(result, part, heading) for heading, part in parts if part]


def _effects_table(result: Diagnosis, found: Sequence[tuple[Finding, Contribution | None]],
                   heading: str) -> Table:
    """One line an effect. Columns that no result fills are left out."""
    header = ["cause", "axis", "measure", "size (95 %)", "at the tool", "own share", "probability",
              "or instead"]
    rows = [_row(result, finding, contribution) for finding, contribution in in_order(found)]
    kept = [k for k in range(len(header)) if any(row[k] not in (None, "") for row in rows)]
    note = _at_tool_note(result, [c for _, c in found if c is not None])
    if any(rows_left_out(result, finding) for finding, _ in found):
        note += ("Of single wrong measurements: the median error of the rows that are left "
                 f"out{listed_places(result.excluded_places)}. ")
    if any(getattr(finding, "own_share", None) is not None for finding, _ in found):
        note += ("Own share: a model without this effect alone, the others estimated again, has a larger "
                 "held-out square sum; so much of it goes with the effect. ")
    note += " ".join(f"{finding.effect.title.capitalize()}: {finding.caveat}."
                     for finding, _ in in_order(found) if getattr(finding, "caveat", ""))
    return Table(heading, tuple(header[k] for k in kept),
                 tuple(tuple(row[k] for k in kept) for row in rows), note.strip())


def listed_places(places: Sequence[str]) -> str:
    """Rows that are left out, in brackets, where they are few."""
    more = f" and {len(places) - _PLACES} more, in `residuals.csv`" if len(places) > _PLACES else ""
    return f" ({', '.join(places[:_PLACES])}{more})" if places else ""


def _what_at_tool(result: Diagnosis) -> str:
    return _AT_TOOL.get(result.unit, _OF_ANGLES).format(rows=kind_of(result.kind).rows)


def _at_tool_note(result: Diagnosis, told: Sequence[Contribution]) -> str:
    """What the column is, or why there is none."""
    note = _what_at_tool(result) + " " if any(c.tool is not None for c in told) else ""
    rigid = [axis for c in told for axis in c.rigid]
    if rigid:
        note += (f"No size at the tool where the robot file declares no stiffness "
                 f"(`spring_linear_Nm_rad`): none{on_axes(rigid, result.robot.axes)}. ")
    return note


def _cause(effect: Effect, robot: Robot) -> str:
    """In plain words, with the name by which pictures, files and documents call it."""
    name, words = effect.name.replace("_", " "), effect.in_plain_words_on(robot)
    return words if name in words or words == effect.title else f"{words} ({name})"


def _row(result: Diagnosis, finding: Finding, contribution: Contribution | None) -> list[Cell]:
    effect = finding.effect
    measure, size = _size(finding, contribution, result.robot)
    at_tool = getattr(finding, "at_tool_um", None)
    tool = (
        1e-6 * at_tool if at_tool is not None else contribution.at_tool if contribution is not None else None)
    if effect.orders() and sum(other.effect.label == effect.label for other in result.findings) > 1:
        measure += f", order {effect.orders()[0][0]:.4g}"  # one axis has several waves
    if left := rows_left_out(result, finding):
        measure = (f"median error of {result.excluded} rows left out" if result.excluded > 1
                   else "error of the row left out")
        tool = left.value
        size = Estimate(left.value, None, None, left.unit)
    share = getattr(finding, "own_share", None)
    others = [other for other in getattr(finding, "set", None) or () if _label(other) != effect.label]
    return [
        _cause(effect, result.robot), "" if effect.joint is None else str(effect.joint), measure, size,
        None if tool is None else Quantity(1e6 * tool, "µm"),
        None if share is None else f"{100.0 * share:.0f} %", percent(finding.probability),
        ", ".join(f"{_label(other).replace('_', ' ')} ({percent(_probability(other))})" for other in others)]


def _label(member: Any) -> str:
    """The name of a member of a credible set, an object or a key of result.json alike."""
    get = member.get if isinstance(member, dict) else lambda key: getattr(member, key, None)
    return f"{get('effect')}" + (f"_{get('joint')}" if get("joint") is not None else "")


def _probability(member: Any) -> float:
    return float(member["probability"] if isinstance(member, dict) else member.probability)


def _size(finding: Finding, contribution: Contribution | None, robot: Robot) -> tuple[str, Cell]:
    """What is told of the effect's size: peak to peak of a curve, the number that the effect names, unless
    its interval holds zero and another's does not; else the first of these, or the largest in its unit. Where
    all hold it, the one that is told best."""
    effect = finding.effect
    if effect.orders() and contribution is not None:
        value, half = contribution.peak_to_peak
        return "peak to peak", Estimate(value, value - half, value + half, contribution.unit)
    free = [(p, v, i) for p, v, i in zip(effect.parameters(), effect.values, finding.intervals)
            if not (p.fixed or np.isnan(i[0]))]
    certain = lambda one: not one[2][0] <= 0.0 <= one[2][1]
    clear = list(filter(certain, free))
    told = [one for one in free if one[0].name == effect.told_by]
    if finding.derived and not any(map(certain, told)):
        name, numbers = next(iter(finding.derived.items()))
        return words_of(name), Estimate(*numbers, unit_of(name))
    if not free:
        return "", None
    # how many times its interval it is; without one it is as sure as a number can be
    times = lambda one: abs(one[1]) / max(one[2][1] - one[2][0], ROUNDING * abs(one[1]), 1e-300)
    surest = max(free, key=times)
    clear = [one for one in told if certain(one)] or clear or told or [surest]
    alike = [one for one in clear if unit_of(one[0].name) == unit_of(clear[0][0].name)]
    parameter, value, (low, high) = max(alike, key=lambda one: abs(one[1]))
    name = effect.in_units_of(robot, parameter.name)
    # a name that is all unit, as rad_per_Nm
    return words_of(name) or "slope", Estimate(float(value), float(low), float(high), unit_of(name))


def percent(probability: float) -> str:
    """0.0005 and less, 0.9995 and more are beyond what a model's probability means."""
    return ("< 0.1 %" if probability < 5e-4 else f"{100 * probability:.1f} %"
            if probability < 0.9995 else "> 99.9 %")


def parameters_table(found: Sequence[tuple[Finding, Contribution | None]], robot: Robot) -> Table:
    """All numbers of the effects that have few of them."""
    rows = []
    for finding, _ in in_order(found):
        effect = finding.effect
        free = [(p, v, i) for p, v, i in zip(effect.parameters(), effect.values, finding.intervals)
                if i[0] < i[1] or not (p.fixed or np.isnan(i[0]))]
        if len(free) <= _FEW and not (effect.orders() and len(free) > 3):
            names = [effect.in_units_of(robot, p.name) for p, _, _ in free]
            rows += [(effect.title, name, Estimate(float(v), float(low), float(high), unit_of(name)))
                     for name, (_, v, (low, high)) in zip(names, free)]
    return Table("Their parameters", ("effect", "parameter", "estimate (95 %)"), tuple(rows))


def orders_table(found: Sequence[tuple[Finding, Contribution | None]], robot: Robot) -> Table:
    """The strongest orders of every error that repeats, with what usually turns so; of an axis that slides,
    whose waves are counted in 2 pi m of its way, how long each is."""
    rows: list[tuple[Cell, ...]] = []
    for finding, _ in in_order(found):
        effect = finding.effect
        orders, way = sorted(effect.orders(), key=lambda pair: -pair[1]), slides(robot, effect.joint)
        geared = effect.joint is not None and robot.joints[effect.index].has_gear
        ratio = float(robot.ratios[effect.index]) if geared and not way else None
        for order, amplitude in orders[:_MOST_ORDERS]:
            if amplitude >= _LEAST_ORDER * orders[0][1]:
                each = f"every {quantity(2.0 * np.pi / order, 'm')}" if way else Quantity(order)
                rows.append((str(effect.joint), each, Quantity(amplitude, "m" if way else "rad"),
                             "" if way else likely_source(order, ratio)))
    return Table("Strongest orders", ("axis", "per output turn", "amplitude", "usual source"), tuple(rows),
                 "The source is what usually turns so often in such a gear, not a measurement.")


def curves_figure(found: Sequence[tuple[Finding, Contribution | None]]) -> list[Figure]:
    """One panel an effect, over its own signal, in the order of the chain; what does not lower its own error
    is not drawn."""
    drawn = [(c.rms[1] / c.rms[0], panel) for _, c in in_order(found)
             if c is not None and c.rms[1] < c.rms[0] for panel in _panels(c)][:_MOST_PANELS]
    panels = [panel for _, panel in drawn]
    if not panels:
        return []
    grey = any(panel.same or not panel.curve for panel in panels)  # else the error is in another unit
    return [Figure(
        "effects", "Every cause over its own signal", partial(effect_panels, panels),
        ("Grey: the error that is left when this one cause is taken out of the model, on the fitted rows. "
         if grey else "")
        + "Blue: the cause as estimated, a line with its 95 % band, or points where it depends on the motion "
        "before; drawn only where something was measured. Green ticks: what was measured."
        + (" RMS of the grey points, and of what is left with the cause." if grey else "")
        + (" Over a phase: without what changes more slowly than a wave." if any(
            c.fast for _, c in found if c is not None) else ""),
        "one panel for each effect found: its curve with band over its own signal, and the error without it",
        main=int(np.argmin([left for left, _ in drawn])))]


def _panels(c: Contribution) -> list[EffectPanel]:
    """One of the effect beside the error, or one of each thing that it does."""
    if c.own:
        nothing = np.zeros_like(c.x)
        return [EffectPanel(curve.title, str(c.signal), c.signal_unit, curve.unit, c.x, curve.value,
                            curve.deviation, nothing, nothing, curve=True, same=False) for curve in c.own]
    return [_panel(c)]


def _panel(c: Contribution) -> EffectPanel:
    same = c.unit == c.residual_unit
    measured = c.direction.axis is not None and not c.direction.turns
    where = f" on {c.direction}" if c.effect.joint is None and measured else ""
    return EffectPanel(_title(c.effect) + where, str(c.signal), c.signal_unit, c.unit, c.x, c.value, c.half,
                       c.without, c.with_, c.curve, same)


def _title(effect: Effect) -> str:
    return effect.title[:1].upper() + effect.title[1:]


def sizes_figure(result: Diagnosis, found: Sequence[tuple[Finding, Contribution | None]],
                 left: float) -> list[Figure]:
    """Bars of what each effect moves the target, in the order of the chain; left: what is left."""
    told = [(_title(finding.effect), c.at_tool) for finding, c in in_order(found)
            if c is not None and c.at_tool is not None]
    if len(told) < 2:
        return []
    labels, sizes = [label for label, _ in told], np.array([size for _, size in told])
    panel = partial(contribution_bars, labels, sizes, left if result.unit == "m" else None)
    return [figure_of_panel("contributions", "Which cause moves the tool how far", panel,
                            0.95 + 1.3 * ROW_IN * len(labels), _what_at_tool(result),
                            "bars of the movement at the tool by cause")]
