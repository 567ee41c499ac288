"""Accuracy against control effort: errors and bandwidths over a weight, trade-off curves, stacked histories,
a path in space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.plots import style
from exactarm.report.plots.curves import envelope

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_POINTS = 600  # a trace; a report holds many
DRAWN = 1e-6  # of the largest amplitude: below, no spectrum is drawn
MICROMETRE = 1e-6  # one unit for errors that span many decades
MOST_PLAIN = 1e3  # over more decades, three ticks each run into another
_MARKERS = "osDv^P*X"
_FRAMES = 7  # drawn along a path


def over_weight(nu: np.ndarray, errors: Mapping[str, np.ndarray], bandwidth_hz: np.ndarray) -> Figure:
    """Left the errors label -> (K,) m, right the bandwidth (K, n) Hz of each axis (NaN: it does not move),
    over nu (K,)."""
    figure = style.new_figure(3.5)
    left, right = figure.subplots(1, 2)
    for (label, values), colour, marker in zip(errors.items(), style.CYCLE, _MARKERS):
        wide = label == next(iter(errors))  # what lies under another curve is drawn wider
        left.plot(nu, values / MICROMETRE, marker=marker, markersize=7 if wide else 4, color=colour,
                  label=label, linewidth=3.4 if wide else 1.3)
    left.set(xscale="log", yscale="log", ylabel="error of the flange [µm]")
    for axis, (column, colour, marker) in enumerate(zip(bandwidth_hz.T, style.CYCLE, _MARKERS)):
        right.plot(nu, column, marker=marker, markersize=4, color=colour, linewidth=1.0, label=str(axis + 1))
    right.set(xscale="log", yscale="log", ylabel=style.label_with("bandwidth", "Hz"))
    for axes in (left, right):
        axes.set_xlabel("weight ν of the input")
        axes.grid(True, which="major")
    _plain_numbers(left.yaxis)
    _plain_numbers(right.yaxis)
    style.legend_above(left, columns=3)
    handles, labels = right.get_legend_handles_labels()
    right.legend(handles, [f"axis {label}" if label == "1" else label for label in labels], loc="lower left",
                 bbox_to_anchor=(0.0, 1.0), ncols=len(labels), borderaxespad=0.2, columnspacing=1.0,
                 handlelength=1.2)
    return figure


def trade_off(paths: Mapping[str, Mapping[str, tuple[np.ndarray, np.ndarray]]], name: str, x_name: str,
              x_unit: str) -> Figure:
    """Per path and label the points (x (K,), error (K,) m) of a family of plans, joined in their order."""
    figure = style.new_figure(3.4)
    panels = figure.subplots(1, len(paths), squeeze=False, sharey=True)[0]
    for axes, (path, lines) in zip(panels, paths.items()):
        for (label, (x, y)), colour, marker in zip(lines.items(), (style.BLUE, style.RED), _MARKERS):
            axes.plot(x, y / MICROMETRE, marker=marker, markersize=4.5, color=colour, label=label)
        axes.set(xscale="log", yscale="log", xlabel=style.label_with(x_name, x_unit))
        axes.set_title(path)
        _plain_numbers(axes.xaxis)
    panels[0].set_ylabel(style.label_with(name, "µm"))
    _plain_numbers(panels[0].yaxis)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


def spectra_per_axis(frequency: np.ndarray, spectra: Mapping[str, np.ndarray]) -> Figure:
    """Amplitudes label -> (M, n) rad/s^2 over frequency (M,), one panel an axis; the highest of each narrow
    band is drawn."""
    count = next(iter(spectra.values())).shape[1]
    figure, panels = style.panel_per_axis(count, 0.7, 1.85, True, "frequency [Hz]", "amplitude [rad/s²]")
    edges = np.unique(np.searchsorted(frequency, np.geomspace(frequency[0], frequency[-1], 240)))
    top = max(float(np.max(values)) for values in spectra.values())
    for index, axes in enumerate(panels):
        for (label, values), colour in zip(spectra.items(), style.CYCLE):
            axes.plot(frequency[edges], np.maximum.reduceat(values[:, index], edges), label=label,
                      color=colour, linewidth=1.0)
        axes.set(xscale="log", yscale="log", ylim=(DRAWN * top, 2.0 * top))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=len(spectra))
    return figure


def histories(time: np.ndarray, panels: Sequence[tuple[str, str, Mapping[str, np.ndarray]]],
              log_y: bool = False) -> Figure:
    """Panels (name, unit, label -> (N,)) over one time (N,), one below the other. Panels with the same labels
    share a legend."""
    figure = style.new_figure(1.2 + 1.55 * len(panels))
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    shared = all(list(traces) == list(panels[0][2]) for _, _, traces in panels)
    for axes, (name, unit, traces) in zip(rows, panels):
        errors = log_y and unit == "m"
        size, shown = ((MICROMETRE, "µm") if errors
                       else style.scaled(np.concatenate(list(traces.values())), unit))
        for position, ((label, values), colour) in enumerate(zip(traces.items(), style.CYCLE)):
            axes.plot(*envelope(time, values / size, MOST_POINTS), label=label, color=colour, linewidth=1.1,
                      linestyle="--" if label == "desired" else "-", zorder=3 - 0.1 * position)
        axes.set_ylabel(f"{name}\n[{shown}]" if len(panels) > 1 else style.label_with(name, shown))
        axes.set_yscale("log" if log_y else "linear")
        axes.margins(x=0.01)
        if not shared:
            style.legend_above(axes, columns=6)
    rows[-1].set_xlabel("time [s]")
    if shared and len(panels[0][2]) > 1:
        figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper right", ncols=6)
    figure.align_ylabels(rows)
    return figure


def path_in_space(desired: np.ndarray, calculated: np.ndarray, rotation: np.ndarray) -> Figure:
    """Desired and calculated positions (N, 3) m, at some with the flange's axes, rotation (N, 3, 3)."""
    figure = style.new_figure(5.0, 6.2)
    axes = figure.add_subplot(projection="3d")
    every = slice(None, None, max(1, len(desired) // MOST_POINTS))
    axes.plot(*desired[every].T, color=style.GREY, linewidth=3.0, label="desired")
    axes.plot(*calculated[every].T, color=style.BLUE, linewidth=1.2, linestyle="--", label="calculated")
    length = 0.12 * float(np.ptp(desired, axis=0).max())
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(desired, axis=0), axis=1))])
    for row in np.searchsorted(along, np.linspace(0.0, along[-1], _FRAMES)).clip(max=len(desired) - 1):
        for k, colour in enumerate(style.CYCLE[1:4]):
            ends = np.stack([desired[row], desired[row] + length * rotation[row, :, k]])
            axes.plot(*ends.T, color=colour, linewidth=1.3,
                      label=f"{'xyz'[k]} axis of the flange" if row == 0 else None)
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    centre, span = limits.mean(axis=1), np.ptp(limits, axis=1)
    span = np.maximum(span, 0.5 * span.max())  # room for the ticks of a short side
    for k, axis in enumerate("xyz"):
        getattr(axes, f"set_{axis}lim")(centre[k] - 0.5 * span[k], centre[k] + 0.5 * span[k])
        getattr(axes, f"set_{axis}label")(f"{axis} [m]", labelpad=10 if axis == "z" else 12)
    axes.locator_params(nbins=4)
    axes.set_box_aspect(span, zoom=0.85)  # one scale
    axes.tick_params(labelcolor=style.INK, labelsize=8)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def _plain_numbers(axis) -> None:
    """Ticks of a short logarithmic axis as 10, 20, 50; one of many decades keeps its powers."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    if high > MOST_PLAIN * low:
        return
    axis.set_major_locator(LogLocator(base=10.0, subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())
