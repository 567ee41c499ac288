"""Parameters with their intervals, singular values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW_IN, PANEL_FRAME_IN = 0.23, 0.75
LONG_LABEL = 22


def parameter_forest(labels: Sequence[str], values: np.ndarray, low: np.ndarray, high: np.ndarray,
                     units: Sequence[str]) -> Figure:
    """Changes of the parameters (k,) with 95 % intervals; one panel per unit, two in a line; zero = as
    declared. Angles are in degrees, as in the tables of a calibration."""
    rows_of = {unit: [index for index, other in enumerate(units) if other == unit]
               for unit in dict.fromkeys(units)}
    wide = [unit for unit, rows in rows_of.items() if max(len(labels[index]) for index in rows) > LONG_LABEL]
    narrow = [unit for unit in rows_of if unit not in wide]
    lines = [narrow[first:first + 2] for first in range(0, len(narrow), 2)] + [[unit] for unit in wide]
    heights = [PANEL_FRAME_IN + ROW_IN * max(len(rows_of[unit]) for unit in line) for line in lines]
    figure = style.new_figure(sum(heights))
    bands = figure.subfigures(len(lines), 1, height_ratios=heights, squeeze=False)[:, 0]
    for band, line in zip(bands, lines):
        for axes, unit in zip(band.subplots(1, len(line), squeeze=False)[0], line):
            chosen = rows_of[unit]
            _forest_panel(axes, [labels[index] for index in chosen], values[chosen], low[chosen],
                          high[chosen], unit)
    return figure


def _forest_panel(axes, labels, values, low, high, unit) -> None:
    size, shown = (np.pi / 180.0, "deg") if unit == "rad" else style.scaled(values, unit, low, high)
    rows = np.arange(len(values))[::-1]
    certain = (low > 0.0) | (high < 0.0)
    axes.axvline(0.0, color=style.INK, linewidth=0.8)
    for mask, colour in ((certain, style.AFTER), (~certain, style.GREY)):
        axes.hlines(rows[mask], low[mask] / size, high[mask] / size, color=colour, linewidth=2.0)
        axes.plot(values[mask] / size, rows[mask], "o", color=colour, markersize=4.5)
    axes.set_yticks(rows, labels)
    axes.set(xlabel=style.label_with("change", shown), ylim=(-0.7, len(values) - 0.3))
    axes.grid(axis="y", visible=False)


def singular_values(values: np.ndarray, rank: int, axes: Axes) -> None:
    """Singular values (k,) in falling order; those beyond `rank` cannot be identified."""
    number = np.arange(1, len(values) + 1)
    floor = np.finfo(float).eps * float(values[0]) if len(values) else 1.0
    drawn = np.maximum(values, floor)
    axes.semilogy(number[:rank], drawn[:rank], "o", color=style.AFTER, markersize=5,
                  label=f"identifiable: {rank}")
    axes.semilogy(number[rank:], drawn[rank:], "X", color=style.VALIDATION, markersize=6,
                  label=f"not identifiable: {len(values) - rank}")
    axes.axvline(rank + 0.5, color=style.BEFORE, linestyle="--", linewidth=1.0)
    axes.set(xlabel="number", ylabel="singular value (scaled columns)", xlim=(0, len(values) + 1))
    style.legend_above(axes)
