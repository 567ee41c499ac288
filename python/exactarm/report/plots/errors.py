"""Error of every pose (or run) before and after, and how often which error occurs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.numbers import number
from exactarm.report.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def error_per_pose(before: np.ndarray, after: np.ndarray, validation: np.ndarray, unit: str, axes: Axes, *,
                   name: str = "position error", row: str = "pose") -> None:
    """Magnitudes before, after (N,) against the row; `validation` (N,) bool marks what was never fitted.
    Where after is before, nothing was changed: one series."""
    size, shown = style.scaled(before, unit, after)
    rows = np.arange(1, len(before) + 1)
    fitted, dots = ~np.asarray(validation, bool), style.marker_size(len(rows))
    how = {"markersize": dots, "rasterized": len(rows) > style.RASTER_ABOVE, "linestyle": "none"}
    when = "" if np.array_equal(before, after) else "after, "
    if when:
        axes.plot(rows, before / size, marker="o", color=style.BEFORE, label="before", alpha=0.75, **how)
    for chosen, marker, colour, label in ((fitted, "o", style.AFTER, "fitted"),
                                          (~fitted, "D", style.VALIDATION, "not fitted")):
        if chosen.any():
            axes.plot(rows[chosen], after[chosen] / size, marker=marker, color=colour, label=when + label,
                      **how)
    axes.set(xlabel=row, ylabel=style.label_with(name, shown), xlim=(0, len(rows) + 1))
    style.from_zero(axes, before / size, after / size)
    style.legend_above(axes, marker_scale=4.5 / dots)


def error_histogram(before: np.ndarray, after: np.ndarray, unit: str, axes: Axes, *,
                    name: str = "position error", of: str = "validation poses") -> None:
    """How many rows have which error, before and after, in the same bins."""
    size, shown = style.scaled(before, unit, after)
    largest = float(max(np.max(before, initial=0.0), np.max(after, initial=0.0))) / size or 1.0
    bins = np.linspace(0.0, largest, int(np.clip(2.0 * np.sqrt(len(before)), 12, 60)) + 1)
    changed = not np.array_equal(before, after)
    both = (before, style.BEFORE, "before: "), (after, style.AFTER, "after: ")
    for values, colour, label in both[not changed :]:
        mean, label = float(np.mean(values)) / size, label if changed else ""
        axes.hist(values / size, bins, color=colour, alpha=0.7, edgecolor="white", linewidth=0.4,
                  label=f"{label}mean {number(mean)} {shown}")
    axes.set(xlabel=style.label_with(name, shown), ylabel=f"number of {of}", xlim=(0.0, largest))
    axes.yaxis.get_major_locator().set_params(integer=True)
    style.legend_above(axes)
