"""How far off the target may be, pose by pose: half axes of the 95 % ellipsoid, shortest to longest."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from exactarm.report.plots.style import AFTER, from_zero, label_with, marker_size, on_one_panel, scaled


def half_axes_per_pose(half_axes: np.ndarray) -> Figure:
    """half_axes (K, 3) m, the longest last."""
    return on_one_panel(partial(half_axes_per_pose_panel, half_axes), 3.6)


def half_axes_per_pose_panel(half_axes: np.ndarray, axes: Axes) -> None:
    """The same on given axes."""
    size, shown = scaled(half_axes[:, -1], "m")
    rows = np.arange(1, len(half_axes) + 1)
    axes.vlines(rows, half_axes[:, 0] / size, half_axes[:, -1] / size, color=AFTER, alpha=0.5)
    dots = {"marker": "o", "linestyle": "none", "markersize": marker_size(len(rows))}
    axes.plot(rows, half_axes[:, -1] / size, color=AFTER, **dots)
    axes.set(xlabel="pose", ylabel=label_with("half axes, 95 %", shown), xlim=(0, len(rows) + 1))
    from_zero(axes, half_axes[:, -1] / size)
