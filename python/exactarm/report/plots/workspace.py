"""Poses in the workspace, seen from above and from the side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.plots.style import AFTER, INK, VALIDATION, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

VIEWS = (("from above", 0, 1), ("from the side", 0, 2))
AXIS_NAMES = ("x [m]", "y [m]", "z [m]")


def poses_view(points: np.ndarray, validation: np.ndarray) -> Figure:
    """Measured points (N, 3) in the robot's base frame; `validation` (N,) bool are drawn as diamonds."""
    fitted, figure = ~validation, new_figure(4.0)
    panels = figure.subplots(1, 2)
    for axes, (_, i, j) in zip(panels, VIEWS):
        axes.plot(points[fitted, i], points[fitted, j], "o", color=AFTER, markersize=4,
                  label="identification")
        if not fitted.all():
            axes.plot(points[~fitted, i], points[~fitted, j], "D", color=VALIDATION, markersize=4,
                      label="validation")
    with_base(figure, panels)
    return figure


def with_base(figure: Figure, panels: Sequence[Axes]) -> None:
    """The robot's base, names and one legend on the two views."""
    for axes, (title, i, j) in zip(panels, VIEWS):
        axes.plot(0.0, 0.0, "+", color=INK, markersize=11, markeredgewidth=1.6, label="robot base")
        axes.set(title=title, xlabel=AXIS_NAMES[i], ylabel=AXIS_NAMES[j])
        axes.set_aspect("equal", adjustable="datalim")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))
