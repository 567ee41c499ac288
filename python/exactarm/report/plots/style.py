"""The house style: one look for all plots, colours that colour-blind eyes tell apart (Okabe and Ito).

Grey is before, blue is after, orange is what was never fitted (validation), green a noise floor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.numbers import choose_scale
from exactarm.report.sections import Figure as FigureSection

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY = (
    "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#868C94")
INK, SOFT = "#222222", "#555555"
BEFORE, AFTER, VALIDATION, FLOOR = GREY, BLUE, RED, GREEN
CYCLE = (BLUE, RED, GREEN, ORANGE, PURPLE, SKY, INK)
WIDTH_IN, HEIGHT_IN = 8.4, 3.5
RASTER_ABOVE = 4000  # more markers than this are drawn as an image inside the SVG

_MAKER: ContextVar[Callable[..., Figure] | None] = ContextVar("maker of figures", default=None)


@contextmanager
def drawn_by(maker: Callable[..., Figure]) -> Iterator[None]:
    """Figures are made by `maker` (pyplot's, to be shown) in place of one that belongs to no window."""
    token = _MAKER.set(maker)
    try:
        yield
    finally:
        _MAKER.reset(token)


def new_figure(height: float = HEIGHT_IN, width: float = WIDTH_IN) -> Figure:
    """Of the maker that was asked for, else one that belongs to no window."""
    from matplotlib.figure import Figure

    return (_MAKER.get() or Figure)(figsize=(width, height))


def on_one_panel(panel: Callable[[Axes], None], height: float = HEIGHT_IN) -> Figure:
    """A figure of one panel."""
    figure = new_figure(height)
    panel(figure.subplots())
    return figure


def panel_per_axis(count: int, height: float, line: float, share_y: bool, x_label: str,
                   y_label: str) -> tuple[Figure, list[Axes]]:
    """A panel for each axis of a robot, three in a line; height in inches, and that of each line."""
    columns = min(count, 3)
    lines = -(-count // columns)
    figure = new_figure(height + line * lines)
    grid = figure.subplots(lines, columns, sharex=True, sharey=share_y, squeeze=False)
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    for index, axes in enumerate(grid.flat[:count]):
        axes.set_title(f"axis {index + 1}")
        if index >= count - columns:
            axes.set_xlabel(x_label)
            axes.tick_params(labelbottom=True)
    for axes in grid[:, 0]:
        axes.set_ylabel(y_label)
    return figure, list(grid.flat[:count])


def figure_of_panel(name: str, heading: str, panel: Callable[[Axes], None], height: float, caption: str,
                    alt: str) -> FigureSection:
    """Of a report: its one panel may be drawn on other axes too."""
    return FigureSection(name, heading, partial(on_one_panel, panel, height), caption, alt, panel)


def scaled(values: Sequence[float] | np.ndarray, unit: str, *others: np.ndarray | None) -> tuple[float, str]:
    """Size and name of the unit that suits the largest of all arrays; large angles become degrees."""
    arrays = [np.ravel(np.asarray(array, dtype=float)) for array in (values, *others) if array is not None]
    numbers = np.concatenate(arrays) if arrays else np.zeros(0)
    finite = np.abs(numbers[np.isfinite(numbers)])
    largest = finite.max() if finite.size else 0.0
    if unit in ("rad", "rad/s") and largest > 0.2:
        return np.pi / 180.0, unit.replace("rad", "deg")
    scale = choose_scale([largest], unit)
    return scale.size, scale.unit


def label_with(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def legend_above(axes: Axes, side: str = "left", columns: int = 4, marker_scale: float = 1.0,
                 lifted_in: float = 0.0) -> None:
    """The legend over the plot, where it hides no data; lifted: over a title."""
    from matplotlib.transforms import ScaledTranslation

    handles, labels = axes.get_legend_handles_labels()
    if handles:
        lifted = ScaledTranslation(0.0, lifted_in, axes.get_figure().dpi_scale_trans)
        axes.legend(handles, labels, loc=f"lower {side}", bbox_to_anchor=(float(side == "right"), 1.0),
                    bbox_transform=axes.transAxes + lifted, ncols=columns, borderaxespad=0.2,
                    markerscale=marker_scale)


def from_zero(axes: Axes, *arrays: np.ndarray | None) -> None:
    """The y axis from zero to a little above the largest value."""
    largest = max((np.nanmax(array) for array in arrays if array is not None and np.size(array)), default=1.0)
    axes.set_ylim(0.0, 1.06 * largest if largest > 0.0 else 1.0)


def marker_size(count: int) -> float:
    """Markers shrink where there are many."""
    return float(np.clip(60.0 / np.sqrt(max(count, 1)), 1.5, 5.0))
