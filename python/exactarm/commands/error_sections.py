"""What every command shows of errors before and after: headline numbers, table, per-row plot, histogram."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from exactarm.identify.statistics import ErrorSummary
from exactarm.report import Estimate, Figure, Highlight, Highlights, Quantity, Table
from exactarm.report.numbers import interval_decimals
from exactarm.report.plots.errors import error_histogram, error_per_pose
from exactarm.report.plots.style import figure_of_panel

SETS = ("identification", "validation")


def error_table(before: Mapping[str, ErrorSummary], after: Mapping[str, ErrorSummary], unit: str,
                quantity: str, note: str = "") -> Table:
    """Train and held-out side by side, before and after."""
    rows = []
    for when, sets in (("before", before), ("after", after)):
        for name in SETS:
            s = sets[name]
            if s.n:
                numbers = (Quantity(s.mean, unit), Quantity(s.rms, unit), Quantity(s.max, unit),
                           Quantity(s.std, unit))
                rows.append((f"{when}, {name}", s.n, *numbers))
    return Table(quantity, ("", "rows", "mean", "RMS", "maximum", "std. dev."), tuple(rows), note,
                 len(rows) - 1)


def highlights(before: Mapping[str, ErrorSummary], after: Mapping[str, ErrorSummary],
               unit: str) -> Highlights:
    """Mean and maximum of the rows that judge: validation if there are any. One number if nothing changed."""
    judge = "validation" if after["validation"].n else "identification"
    return Highlights(tuple(
        Highlight(f"{judge}, {name}", Quantity(getattr(after[judge], field), unit),
                  None if before == after else Quantity(getattr(before[judge], field), unit))
        for name, field in (("mean", "mean"), ("RMS", "rms"), ("maximum", "max"))))


def error_figures(before: np.ndarray, after: np.ndarray, identification: np.ndarray, unit: str, name: str,
                  row: str, order: str = "", part: str = "fit or choice") -> tuple[Figure, Figure]:
    """Error of every row, and its histogram on the rows that were never fitted; order: of the rows, said;
    part: in what the rows that judge took none."""
    validation = ~identification
    shown = validation if validation.any() else np.ones(len(before), bool)
    which = f"{'validation' if validation.any() else 'identification'} {row}s"
    changed = "" if np.array_equal(before, after) else ", before and after"
    return (
        figure_of_panel("error_per_row", f"{name.capitalize()} of every {row}",
                        partial(error_per_pose, before, after, validation, unit, name=name, row=row), 3.6,
                        f"Validation {row}s are marked: they took no part in any {part}.{order}",
                        f"{name} before and after against the {row} number"),
        figure_of_panel("error_histogram", f"Distribution of the {name}",
                        partial(error_histogram, before[shown], after[shown], unit, name=name, of=which), 3.0,
                        f"Number of {which} by their error{changed}.", f"histogram of the {name}"))


def parameter_table(names, start, values, intervals, units, at_bound=None) -> Table:
    """Name, declared value, estimate with its 95 % interval."""
    rows = tuple(
        (name, Quantity(float(s), unit, exact=True), Estimate(float(v), float(low), float(high), unit),
         "at its bound" if at_bound is not None and at_bound[i] else "")
        for i, (name, s, v, (low, high), unit) in enumerate(zip(names, start, values, intervals, units)))
    return Table("Parameters", ("parameter", "declared", "estimate (95 %)", ""), rows)


def geometry_tables(names, start, values, intervals, units, at_bound) -> tuple[Table, ...]:
    """Lengths in mm, angles in degrees, the rest as it is; decimals of a table's narrowest interval."""
    tables = []
    for unit, heading, shown, size in (("m", "Lengths", "mm", 1e-3), ("rad", "Angles", "deg", np.pi / 180.0)):
        halves = [0.5 * float(high - low) / size for (low, high), own in zip(intervals, units) if own == unit]
        decimals = interval_decimals(halves)
        rows = [
            (name, Quantity(float(s) / size, shown, exact=True),
             Quantity(float(v) / size, shown, decimals=decimals),
             Estimate(*(float(x - s) / size for x in (v, low, high)), shown), "at its bound" if bound else "")
            for name, s, v, (low, high), own, bound in zip(names, start, values, intervals, units, at_bound)
            if own == unit]
        tables.append(Table(heading, ("parameter", "declared", "identified", "change (95 %)", ""),
                            tuple(rows)))
    other = [k for k, unit in enumerate(units) if unit not in ("m", "rad")]
    pick = lambda items: [items[k] for k in other]
    rest = parameter_table(pick(names), pick(start), pick(values), pick(intervals), pick(units),
                           pick(at_bound))
    return (*tables, replace(rest, heading="Springs, ratios and others"))
