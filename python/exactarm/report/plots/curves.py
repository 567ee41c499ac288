"""Curves over time or any other abscissa, one panel or one per axis of the robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.plots.style import CYCLE, label_with, legend_above, panel_per_axis, scaled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_POINTS = 2000
LEAST_RANGE = 1e-3  # of the largest value of all axes: an axis that stands still is drawn so


def curves(time: np.ndarray, traces: Mapping[str, np.ndarray], axes: Axes, *, unit: str = "", name: str = "",
           log_y: bool = False) -> None:
    """Traces label -> (N,) over one time (N,) s; long ones are thinned to their envelope."""
    size, shown = scaled(np.concatenate([np.ravel(trace) for trace in traces.values()]), unit)
    for label, trace in traces.items():
        axes.plot(*envelope(time, np.asarray(trace) / size), label=label)
    axes.set(xlabel="time [s]", ylabel=label_with(name, shown), yscale="log" if log_y else "linear")
    axes.margins(x=0.01)
    legend_above(axes)


def curves_per_axis(x: np.ndarray, traces: Mapping[str, np.ndarray], *, unit: str, name: str,
                    x_name: str = "time", x_unit: str = "s", log_x: bool = False,
                    log_y: bool = False) -> Figure:
    """Traces label -> (N, n): one panel per axis of the robot, all of one unit, each with its own range."""
    size, shown = scaled(np.concatenate([np.ravel(trace) for trace in traces.values()]), unit)
    count = next(iter(traces.values())).shape[1]
    largest = max(np.nanmax(np.abs(trace), initial=0.0) for trace in traces.values()) / size
    least = LEAST_RANGE * float(largest)
    figure, panels = panel_per_axis(count, 0.6, 1.75, log_y, label_with(x_name, x_unit),
                                    label_with(name, shown))
    for index, axes in enumerate(panels):
        for (label, trace), colour in zip(traces.items(), CYCLE):
            axes.plot(*envelope(x, trace[:, index] / size), label=label, color=colour, linewidth=1.0)
        axes.set(xscale="log" if log_x else "linear", yscale="log" if log_y else "linear")
        low, high = axes.get_ylim()
        if not log_y and high - low < least:
            axes.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))
    figure.align_ylabels(panels[:: min(count, 3)])
    if len(traces) > 1:
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=len(traces))
    return figure


def envelope(x: np.ndarray, y: np.ndarray, most: int = MOST_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """The same curve with at most `most` points: of each block its lowest and highest, in their order."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    if len(x) <= most:
        return x, y
    blocks = np.array_split(np.arange(len(x)), most // 2)
    kept = np.unique([index for block in blocks
                      for index in (block[np.argmin(y[block])], block[np.argmax(y[block])])])
    return x[kept], y[kept]
