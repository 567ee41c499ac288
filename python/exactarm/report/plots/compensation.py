"""What a compensation moved by how much: arrows in the work space, and the size of each target's
correction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.plots import style
from exactarm.report.plots.curves import envelope
from exactarm.report.plots.workspace import VIEWS, with_base

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_DRAWN = 1000  # targets: more are a blot, and a vector picture of all takes longer than their correction
LONGEST_ARROW = 0.12  # of the width of the plot
ROUND = np.array([1.0, 2.0, 5.0, 10.0])


def shift_view(points: np.ndarray, shifts: np.ndarray) -> Figure:
    """Points (N, 3) m of the flange in the base frame; shifts (N, 3) m of their commands, drawn longer."""
    every = -(-len(points) // MOST_DRAWN)
    drawn = np.unique([*range(0, len(points), every), int(np.argmax(np.linalg.norm(shifts, axis=1)))])
    points, shifts = points[drawn], shifts[drawn]
    figure = style.new_figure(4.2)
    panels = figure.subplots(1, 2)
    span = max(float(np.ptp(np.vstack([points, np.zeros(3)]), axis=0).max()), 0.2)  # the base is drawn too
    longest = float(np.linalg.norm(shifts, axis=1).max()) or 1.0
    factor = LONGEST_ARROW * span / longest
    decade = 10.0 ** np.floor(np.log10(factor))
    factor = decade * ROUND[ROUND <= factor / decade].max()
    for axes, (_, i, j) in zip(panels, VIEWS):
        axes.plot(points[:, i], points[:, j], "o", color=style.SOFT,
                  markersize=style.marker_size(len(points)),
                  label="target" if every == 1 else f"target (one in {every} drawn)")
        axes.quiver(points[:, i], points[:, j], factor * shifts[:, i], factor * shifts[:, j],
                    color=style.AFTER, angles="xy", scale_units="xy", scale=1.0, width=0.004,
                    label=f"correction, {factor:.0f} times as long", zorder=3)
        ends = points + factor * shifts
        axes.plot(ends[:, i], ends[:, j], linestyle="none")  # so that no arrow is cut off
        axes.margins(0.15)
    with_base(figure, panels)
    return figure


def shift_per_target(sizes: np.ndarray, axes: Axes) -> None:
    """Size (N,) m of the correction of each target in the order of the programs; NaN: not corrected."""
    size, unit = style.scaled(np.nan_to_num(sizes), "m")
    number, left = np.arange(1, len(sizes) + 1), np.isnan(sizes)
    x, y = envelope(number[~left], sizes[~left] / size)
    axes.plot(x, y, "o", color=style.AFTER, markersize=style.marker_size(len(x)))
    if left.any():
        x = number[left][:: -(-left.sum() // MOST_DRAWN)]
        axes.plot(x, np.zeros(len(x)), "x", color=style.VALIDATION, markersize=5, label="not corrected",
                  clip_on=False)
        style.legend_above(axes)
    axes.set(xlabel="target", ylabel=style.label_with("correction", unit))
    axes.xaxis.get_major_locator().set_params(integer=True)
    style.from_zero(axes, sizes / size)
