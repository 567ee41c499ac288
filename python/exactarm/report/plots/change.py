"""A daily check: the statistic of the test against its boundary, and how far the poses have moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST = 1e-3  # of the statistic that is drawn
MOST = 1e12
MOST_NAMED = len(style.CYCLE)  # poses with a colour of their own


def statistic_over_days(statistic: np.ndarray, boundary: float, moved: np.ndarray, noise: float,
                        alarm: int | None, since: tuple[int, int] | None) -> Figure:
    """statistic (T,); moved (T, K) m, NaN where a pose was not measured; alarm, since: days from 0."""
    figure = style.new_figure(5.2)
    upper, lower = figure.subplots(2, 1, sharex=True)
    _statistic(statistic, boundary, alarm, upper)
    _moved(moved, noise, since, lower)
    return figure


def _statistic(statistic: np.ndarray, boundary: float, alarm: int | None, axes: Axes) -> None:
    days = np.arange(1, len(statistic) + 1)
    shown = np.clip(statistic, LEAST, MOST)
    axes.semilogy(days, shown, "o-", color=style.AFTER, markersize=3.5, label="evidence of a change")
    axes.axhline(boundary, color=style.FLOOR, linestyle="--",
                 label="boundary: one false alarm a year at most")
    if alarm is not None:
        axes.plot(alarm + 1, shown[alarm], "D", color=style.VALIDATION, markersize=7, label="alarm")
    axes.set(ylabel="statistic")
    style.legend_above(axes)


def _moved(moved: np.ndarray, noise: float, since: tuple[int, int] | None, axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    size, unit = style.scaled(moved, "m", np.array([noise]))
    days = np.arange(1, len(moved) + 1)
    if since is not None:
        axes.axvspan(since[0] + 0.5, since[1] + 1.5, color=style.VALIDATION, alpha=0.15, linewidth=0.0,
                     label="began here (95 %)")
    many = moved.shape[1] > MOST_NAMED
    for k, values in enumerate(moved.T):
        look = ({"color": style.AFTER, "alpha": 0.4, "label": "every pose" if k == 0 else None} if many
                else {"label": f"pose {k + 1}"})
        axes.plot(days, values / size, "o-", markersize=3.0, linewidth=1.0, **look)
    axes.axhline(noise / size, color=style.FLOOR, linestyle="--", label="noise")
    axes.set(xlabel="day of NEW", ylabel=style.label_with("moved since BEFORE", unit))
    axes.set_ylim(bottom=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    style.legend_above(axes, columns=5)
