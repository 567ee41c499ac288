"""Errors over the work space, before and after on one scale: seen from above and from the side; and errors of
distances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = "cividis_r"  # tells apart in grey print and for colour-blind eyes; light is good
_HEIGHT_IN = 5.4


def error_over_workspace(points: np.ndarray, before: np.ndarray, after: np.ndarray) -> Figure:
    """Points (N, 3) in the robot's base frame, errors (N,) in m, largest on top."""
    size, unit = style.scaled(before, "m", after)
    top = float(np.quantile(np.concatenate([before, after]) / size, 0.98)) or 1.0
    figure = style.new_figure(_HEIGHT_IN)
    panels = figure.subplots(2, 2)
    dots = {"s": 1.6 * style.marker_size(len(points)) ** 2, "linewidths": 0.0,
            "rasterized": len(points) > style.RASTER_ABOVE}
    for row, (title, horizontal, vertical, names) in zip(panels, _views(points)):
        for axes, error, when in zip(row, (before, after), ("before", "after")):
            order = np.argsort(error)
            drawn = axes.scatter(horizontal[order], vertical[order], c=error[order] / size, cmap=COLOURS,
                                 vmin=0.0, vmax=top, **dots)
            axes.set(title=f"{when}, {title}", xlabel=names[0], ylabel=names[1] if when == "before" else "")
            axes.set_aspect("equal", adjustable="datalim")
    bar = figure.colorbar(drawn, ax=panels, extend="max", shrink=0.8, aspect=30)
    bar.set_label(style.label_with("position error", unit))
    return figure


def _views(points: np.ndarray) -> tuple:
    radius = np.hypot(points[:, 0], points[:, 1])
    return (("from above", points[:, 0], points[:, 1], ("x [m]", "y [m]")),
            ("from the side", radius, points[:, 2], ("distance from axis 1 [m]", "z [m]")))


def distance_error(length: np.ndarray, before: np.ndarray, after: np.ndarray, axes: Axes) -> None:
    """Error of the distance of two poses against the distance: median and the middle nine tenths of each
    tenth of the pairs."""
    size, unit = style.scaled(before, "m", after)
    order = np.argsort(length)
    parts = [part for part in np.array_split(order, min(10, len(order))) if part.size]
    middle = np.array([np.median(length[part]) for part in parts])
    for error, colour, label in ((before, style.BEFORE, "before"), (after, style.AFTER, "after")):
        low, half, high = np.array([np.quantile(error[part] / size, [0.05, 0.5, 0.95]) for part in parts]).T
        axes.fill_between(middle, low, high, color=colour, alpha=0.25, linewidth=0.0)
        axes.plot(middle, half, "o-", color=colour, markersize=3.5,
                  label=f"{label}: median, and nine tenths of the pairs")
    axes.set(xlabel="distance of two poses [m]", ylabel=style.label_with("error of the distance", unit))
    style.legend_above(axes)
