"""The arm in space with the error of every measured pose as an arrow, before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.numbers import number
from exactarm.report.plots.style import INK, SOFT, new_figure, scaled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_ARROWS = 220
_ARROW_SHARE = 0.22  # of the arm's reach: length of the longest arrow
_PERCENTILE = 98.0  # of the error before, that the longest arrow stands for
_VIEW = {"elev": 22.0, "azim": -52.0}


def arm_with_errors(arm: np.ndarray, points: np.ndarray, before: np.ndarray, after: np.ndarray,
                    unit: str = "m") -> Figure:
    """arm (n + 1, 3) m, joint by joint; points (N, 3) m of the target; error vectors before and after (N, 3),
    same scale."""
    from matplotlib.colors import Normalize

    chosen = np.arange(len(points))[:: max(1, -(-len(points) // _MOST_ARROWS))]
    largest = float(np.percentile(np.linalg.norm(before[chosen], axis=1), _PERCENTILE)) or 1e-9
    size, shown = scaled(np.array([largest]), unit)
    span = np.concatenate([arm, points])
    centre, half = (span.max(axis=0) + span.min(axis=0)) / 2.0, np.ptp(span, axis=0).max() / 2.0
    factor = _ARROW_SHARE * 2.0 * half / largest
    figure = new_figure(4.6)
    panels = [figure.add_subplot(1, 2, k + 1, projection="3d") for k in range(2)]
    colours = Normalize(0.0, largest / size)
    for axes, errors, title in zip(panels, (before, after), ("before", "after")):
        length = np.linalg.norm(errors[chosen], axis=1) / size
        axes.plot(*arm.T, color="#B9C0C9", linewidth=7.0, solid_capstyle="round", solid_joinstyle="round",
                  zorder=1)
        axes.plot(*arm.T, "o", color=INK, markersize=4.0, zorder=2)
        shafts = factor * errors[chosen]
        drawn = axes.quiver(*points[chosen].T, *shafts.T, array=None, cmap="viridis", arrow_length_ratio=0.25,
                            linewidth=0.9)
        drawn.set_array(np.concatenate([length, np.repeat(length, 2)]))
        drawn.set_norm(colours)
        rms = float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) / size
        axes.set_title(f"{title}: RMS {number(rms)} {shown}")
        for k, name in enumerate("xyz"):
            getattr(axes, f"set_{name}lim")(centre[k] - half, centre[k] + half)
            getattr(axes, f"set_{name}label")(f"{name} [m]", labelpad=-6)
        axes.set_box_aspect((1.0, 1.0, 1.0), zoom=1.08)
        axes.view_init(**_VIEW)
        axes.tick_params(labelsize=7, pad=-3, labelcolor=SOFT)
        axes.locator_params(nbins=4)
    bar = figure.colorbar(drawn, ax=panels, orientation="horizontal", fraction=0.045, pad=0.02, aspect=50)
    bar.set_label(f"size of the error [{shown}]; arrows are drawn {factor:.0f} times as long")
    return figure
