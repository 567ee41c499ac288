"""Figures of a report for a person at a prompt or in a notebook: made by pyplot, or drawn on axes that
exist."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure as Drawing

from exactarm.errors import InputError
from exactarm.report.plots.picture import house_style, readable_decades
from exactarm.report.plots.style import drawn_by, legend_above
from exactarm.report.sections import Figure

_TITLE_IN = 0.24  # height of a title over its panel


def draw_figure(figure: Figure, ax: Axes | None) -> Axes | list[Axes]:
    """Draws on `ax` (of several panels the main one), or makes a figure of pyplot; returns the axes, a list
    where there are several."""
    with house_style():
        if ax is not None:
            if figure.panel is not None:
                figure.panel(ax)
            else:
                _MainPanel(figure, ax).draw()
            readable_decades([ax])
            return ax
        import matplotlib.pyplot

        with drawn_by(matplotlib.pyplot.figure):
            axes = list(figure.build().axes)
        readable_decades(axes)
    return axes[0] if len(axes) == 1 else axes


class _MainPanel:
    """Stands for a drawing of several panels while it is made: its main panel lies on axes that exist, the
    others on drawings that nobody sees. It has the methods of matplotlib's Figure that our plots call."""

    def __init__(self, figure: Figure, ax: Axes):
        self.figure, self.ax, self.made = figure, ax, 0
        self.beside: tuple[Any, Any] = ((), ())  # panels of its column and of its row

    def draw(self) -> None:
        with drawn_by(lambda **_: self):  # type: ignore[arg-type]
            self.figure.build()
        for axis, shared in zip("xy", self.beside):  # a label that panels share stands at one of them
            label = next((text for each in shared if (text := getattr(each, f"get_{axis}label")())), "")
            if not getattr(self.ax, f"get_{axis}label")():
                getattr(self.ax, f"set_{axis}label")(label)

    def subplots(self, lines: int = 1, columns: int = 1, *, squeeze: bool = True, **shared: Any) -> Any:
        grid = Drawing().subplots(lines, columns, squeeze=False, **shared)
        line, column = divmod(self.figure.main - self.made, columns)
        self.made += grid.size
        if 0 <= line < lines:
            self.beside = (grid[:, column].tolist(), grid[line].tolist())
            grid[line, column] = self.ax
        return (grid.item() if grid.size == 1 else grid.squeeze()) if squeeze else grid

    def subfigures(self, lines: int, columns: int, **_: Any) -> np.ndarray:
        return np.full((lines, columns), self, object)

    def add_subplot(self, *_: int, projection: str = "rectilinear") -> Axes:
        self.made += 1
        if self.made != self.figure.main + 1:
            return Drawing().add_subplot(projection=projection)
        if self.ax.name != projection:
            raise InputError(f"figure {self.figure.name} is drawn in space; expected axes made with "
                             f"projection={projection!r}")
        return self.ax

    def colorbar(self, drawn: ScalarMappable, ax: Any, **look: Any) -> Any:
        return self.ax.get_figure().colorbar(ScalarMappable(drawn.norm, drawn.cmap), ax=self.ax, **look)

    def legend(self, *_: Any, ncols: int = 4, markerscale: float = 1.0, **__: Any) -> None:
        titled = bool(self.ax.get_title(loc="left"))
        legend_above(self.ax, columns=ncols, marker_scale=markerscale, lifted_in=_TITLE_IN * titled)

    def align_ylabels(self, _: Any) -> None:
        """One panel alone is aligned."""
