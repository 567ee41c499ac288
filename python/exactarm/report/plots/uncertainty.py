"""How far off the target may be, pose by pose: half axes of the 95 % ellipsoid, shortest to longest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.plots.style import AFTER, from_zero, label_with, marker_size, scaled

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def half_axes_per_pose(half_axes: np.ndarray, axes: Axes) -> None:
    """half_axes (K, 3) m, the longest last."""
    size, shown = scaled(half_axes[:, -1], "m")
    rows = np.arange(1, len(half_axes) + 1)
    axes.vlines(rows, half_axes[:, 0] / size, half_axes[:, -1] / size, color=AFTER, alpha=0.5)
    dots = {"marker": "o", "linestyle": "none", "markersize": marker_size(len(rows))}
    axes.plot(rows, half_axes[:, -1] / size, color=AFTER, **dots)
    axes.set(xlabel="pose", ylabel=label_with("half axes, 95 %", shown), xlim=(0, len(rows) + 1))
    from_zero(axes, half_axes[:, -1] / size)
