"""A residual against the signal that it follows, and its spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.numbers import number
from exactarm.report.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BINS = 24


def residual_over_signal(signal: np.ndarray, before: np.ndarray, after: np.ndarray, *, unit: str,
                         name: str, signal_name: str, signal_unit: str = "") -> Figure:
    """Signed residuals (N,) over a signal (N,), before beside after, with means of equal-count bins."""
    size, shown = style.scaled(before, unit, after)
    x_size, x_shown = style.scaled(signal, signal_unit)
    figure = style.new_figure(3.5)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    both = (before, "before", style.BEFORE), (after, "after", style.AFTER)
    for axes, (values, title, colour) in zip(panels, both):
        _points_and_bins(axes, signal / x_size, values / size, colour)
        rms = float(np.sqrt(np.mean(np.square(values)))) / size
        axes.set_title(f"{title}: RMS {number(rms)} {shown}")
        axes.set_xlabel(style.label_with(signal_name, x_shown))
    panels[0].set_ylabel(style.label_with(name, shown))
    style.legend_above(panels[-1], "right")
    return figure


def left_over_signal(signal: np.ndarray, left: np.ndarray, axes: Axes, *, unit: str, name: str,
                     signal_name: str, signal_unit: str = "") -> None:
    """What a model leaves (N,) over a signal (N,), with means of equal-count bins."""
    size, shown = style.scaled(left, unit)
    x_size, x_shown = style.scaled(signal, signal_unit)
    _points_and_bins(axes, signal / x_size, left / size, style.BEFORE)
    axes.set(xlabel=style.label_with(signal_name, x_shown), ylabel=style.label_with(name, shown))
    style.legend_above(axes, "right")


def _points_and_bins(axes: Axes, signal: np.ndarray, values: np.ndarray, colour: str) -> None:
    axes.plot(signal, values, "o", color=colour, alpha=0.55, markeredgewidth=0.0,
              markersize=0.8 * style.marker_size(len(signal)), rasterized=len(signal) > style.RASTER_ABOVE)
    centre, mean, half = binned_mean(signal, values)
    axes.errorbar(centre, mean, half, color=style.INK, linewidth=1.5, marker="o", markersize=3.5, capsize=0,
                  elinewidth=1.2, label="mean of a bin, ± 95 %")
    axes.axhline(0.0, color=style.INK, linewidth=0.7)


def binned_mean(signal: np.ndarray, values: np.ndarray,
                bins: int = BINS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centre, mean, half width of its 95 % interval in bins of equal count; few values: one bin each."""
    distinct = np.unique(signal)
    if len(distinct) <= bins // 2:
        groups = [np.flatnonzero(signal == value) for value in distinct]
    else:
        wanted = int(np.clip(len(signal) // 8, 2, bins))
        groups = [group for group in np.array_split(np.argsort(signal, kind="stable"), wanted) if len(group)]
    centre = np.array([signal[group].mean() for group in groups])
    mean = np.array([values[group].mean() for group in groups])
    half = np.array([1.96 * values[group].std(ddof=1) / np.sqrt(len(group)) if len(group) > 1 else 0.0
                     for group in groups])
    return centre, mean, half


def spectrum(order: np.ndarray, before: np.ndarray, after: np.ndarray, axes: Axes, *, unit: str, name: str,
             marks: Sequence[tuple[float, str]] = ()) -> None:
    """Amplitudes (N,) over orders (N,) per output revolution; `marks` name peaks."""
    size, shown = style.scaled(before, unit, after)
    axes.plot(order, before / size, color=style.BEFORE, linewidth=1.2, label="before")
    axes.plot(order, after / size, color=style.AFTER, linewidth=1.2, label="after")
    top = float(np.nanmax(before)) / size if len(before) else 1.0
    for position, text in _spread(marks, float(np.ptp(order)) * 0.05 if len(order) else 1.0):
        height = float(np.interp(position[0], order, before)) / size
        axes.annotate(text, (position[0], height), (position[1], top * 1.12), ha="center", va="bottom",
                      fontsize=8.5, color=style.VALIDATION,
                      arrowprops={"arrowstyle": "-", "color": style.VALIDATION, "linewidth": 0.7})
    axes.set(xlabel="order [per output revolution]", ylabel=style.label_with(name, shown),
             ylim=(0.0, top * (1.28 if len(marks) else 1.08) or 1.0))
    if len(order):
        axes.set_xlim(float(order[0]), float(order[-1]))
    style.legend_above(axes)


def _spread(marks: Sequence[tuple[float, str]], gap: float) -> list[tuple[tuple[float, float], str]]:
    """Places of the texts, moved apart to at least `gap`."""
    placed, last = [], -np.inf
    for position, text in sorted(marks):
        last = max(position, last + gap)
        placed.append(((position, last), text))
    return placed
