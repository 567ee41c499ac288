"""What each found effect does: its curve with band over its own signal, and the sizes of all of them at the
tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.numbers import number
from exactarm.report.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS, PANEL_IN, ROW_IN = 2, 2.05, 0.24
_GAP_SHARE = 0.03  # of the signal's range without a measured row, over which no curve is drawn
_TITLE = 44  # characters that fit above a panel
_SPIKE = 0.25  # of the range: a leap there and back
_CLOSE = 5e-3  # of the signal's range, in which a leap counts: a curve's waves are slower
_LEVELS, _SPREAD = 8, 0.15  # a signal of so few values is drawn as levels, so wide beside their distance
_GOLDEN = 0.618034  # multiples of it fill the unit interval evenly: the same points at every run
_SHOWN = 99.0  # percentile of the points that the panel's height holds


@dataclass(frozen=True)
class EffectPanel:
    """One effect: its own signal x (N,) sorted, value and half width of its 95 % band (N,), residual without
    and with it (N,).

    curve: the value is a function of x; else only the residuals are drawn. same: value and residual are of
    one quantity, so that the curve lies in the points.
    """

    title: str
    signal: str
    signal_unit: str
    unit: str
    x: np.ndarray
    value: np.ndarray
    half: np.ndarray
    without: np.ndarray
    with_: np.ndarray
    curve: bool
    same: bool


def effect_panels(panels: Sequence[EffectPanel]) -> Figure:
    """Small multiples, in the order given; each has its own abscissa."""
    columns = min(COLUMNS, len(panels))
    lines = -(-len(panels) // columns)
    figure = style.new_figure(0.45 + PANEL_IN * lines)
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    for place, panel in zip(axes, panels):
        _draw(place, panel)
    for place in axes[len(panels):]:
        place.set_visible(False)
    handles: dict[str, object] = {}
    for place in axes:
        handles |= {label: handle for handle, label in zip(*place.get_legend_handles_labels())
                    if label not in handles}
    figure.legend(handles.values(), handles.keys(), loc="outside upper right", ncols=len(handles),
                  markerscale=2.0)
    return figure


def _draw(axes: Axes, panel: EffectPanel) -> None:
    x_size, x_shown = style.scaled(panel.x, panel.signal_unit)
    size, shown = style.scaled(panel.without if panel.same else panel.value, panel.unit)
    x = panel.x / x_size
    levels, wide = _levels(x)
    spread = x + wide * np.linspace(-1.0, 1.0, len(x))[np.argsort(np.arange(len(x)) * _GOLDEN % 1.0)]
    raster = len(x) > style.RASTER_ABOVE
    if panel.same or not panel.curve:
        axes.plot(spread, panel.without / size, ".", color=style.BEFORE, markersize=3.4, alpha=0.75,
                  markeredgewidth=0.0, rasterized=raster, label="error without it")
    if not panel.curve:
        axes.plot(spread, panel.with_ / size, ".", color=style.AFTER, markersize=3.0, markeredgewidth=0.0,
                  rasterized=raster, label="error with it")
    elif not wide and _spikes(panel.x, panel.value):
        axes.plot(x, panel.value / size, ".", color=style.AFTER, markersize=3.0, markeredgewidth=0.0,
                  rasterized=raster, label="effect")
    elif wide:
        _steps(axes, panel, x, levels, wide, size)
    else:
        _curve(axes, panel, x, size)
    axes.plot(x, np.zeros_like(x), "|", color=style.FLOOR, markersize=5, markeredgewidth=0.5,
              rasterized=raster, label="measured at", transform=axes.get_xaxis_transform(), clip_on=False)
    drawn = np.concatenate([np.abs(panel.without) if panel.same or not panel.curve else np.zeros(1),
                            np.abs(panel.value) + panel.half if panel.curve else np.zeros(1)]) / size
    top = (1.15 * float(max(np.percentile(drawn, _SHOWN),
                            np.max(np.abs(panel.value)) / size if panel.curve else 0.0)) or 1.0)
    before, after = (np.sqrt(np.mean(np.square(values))) for values in (panel.without, panel.with_))
    axes.set(ylim=(-top, top), xlabel=style.label_with(panel.signal, x_shown),
             ylabel=f"[{shown}]" if shown else "")
    if wide:
        axes.set_xticks(levels)
    else:
        axes.locator_params(axis="x", nbins=6)
    rms = f": RMS {number(before / size, 2)} → {number(after / size, 2)} {shown}" if panel.same else ""
    title = panel.title + rms
    axes.set_title(title, fontsize=8.6 * min(1.0, _TITLE / len(title)))


def _spikes(x: np.ndarray, value: np.ndarray) -> bool:
    """Whether values (N,) over their sorted signal x leap there and back between rows that lie close, as of
    an effect with a memory near a reversal: a line through them would be no curve."""
    if len(value) < 3:
        return False
    apart = np.abs(value[1:-1] - np.median([value[:-2], value[1:-1], value[2:]], axis=0))
    close = x[2:] - x[:-2] <= _CLOSE * np.ptp(x)
    return bool(np.any(apart[close] > _SPIKE * np.ptp(value)))


def _levels(x: np.ndarray) -> tuple[np.ndarray, float]:
    """The values of a signal that has few, and half the width to draw them with; 0 for other signals."""
    levels = np.unique(x)
    if not 2 <= len(levels) <= _LEVELS:
        return levels, 0.0
    return levels, _SPREAD * float(np.min(np.diff(levels)))


def _steps(axes: Axes, panel: EffectPanel, x: np.ndarray, levels: np.ndarray, wide: float,
           size: float) -> None:
    """Effect and band at each level of the signal."""
    for place, level in enumerate(levels):
        value, half = (np.mean(values[x == level]) / size for values in (panel.value, panel.half))
        axes.fill_between([level - wide, level + wide], value - half, value + half, color=style.AFTER,
                          alpha=0.25, linewidth=0.0, label="95 % band" if place == 0 else None)
        axes.plot([level - wide, level + wide], [value, value], color=style.AFTER, linewidth=1.4,
                  label="effect" if place == 0 else None)


def _curve(axes: Axes, panel: EffectPanel, x: np.ndarray, size: float) -> None:
    """Curve and band, broken where no row was measured."""
    breaks = np.flatnonzero(np.diff(x) > _GAP_SHARE * max(float(np.ptp(x)), 1e-300)) + 1
    for place, rows in enumerate(np.split(np.arange(len(x)), breaks)):
        low, high = ((panel.value[rows] + side * panel.half[rows]) / size for side in (-1.0, 1.0))
        axes.fill_between(x[rows], low, high, color=style.AFTER, alpha=0.25, linewidth=0.0,
                          label="95 % band" if place == 0 else None)
        axes.plot(x[rows], panel.value[rows] / size, color=style.AFTER, linewidth=1.4,
                  label="effect" if place == 0 else None)


def contribution_bars(labels: Sequence[str], sizes_m: np.ndarray, left_m: float | None, axes: Axes) -> None:
    """What each effect does at the tool (k,) m, in micrometres, as ordered; a line for what is left."""
    rows, sizes = np.arange(len(labels))[::-1], 1e6 * np.asarray(sizes_m)
    axes.barh(rows, sizes, height=0.68, color=style.AFTER)
    for row, value in zip(rows, sizes):
        axes.annotate(f"{value:.0f}", (value, row), (5, 0), textcoords="offset points", va="center",
                      fontsize=8.5, color=style.INK)
    if left_m is not None:
        axes.axvline(1e6 * left_m, color=style.VALIDATION, linestyle="--",
                     label="left with all of them (held-out RMS)")
        style.legend_above(axes, "right")
    axes.set_yticks(rows, labels)
    axes.set(xlabel="median movement of the target [µm]", ylim=(-0.6, len(labels) - 0.4))
    axes.set_xlim(0.0, 1.1 * max(float(np.max(sizes)), 1e6 * (left_m or 0.0)))
    axes.grid(axis="y", visible=False)
