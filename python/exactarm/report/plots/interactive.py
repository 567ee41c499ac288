"""Figures of a report for a person at a prompt or in a notebook: made by pyplot, or drawn on axes that
exist."""

from matplotlib.axes import Axes

from exactarm.report.plots.style import drawn_by, house_style, readable_decades
from exactarm.report.sections import Figure


def draw_figure(figure: Figure, ax: Axes | None) -> Axes | list[Axes]:
    """Draws on `ax`, or makes a figure of pyplot; returns the axes, a list where there are several."""
    with house_style():
        if ax is not None:
            if figure.panel is None:
                raise ValueError(f"figure {figure.name} has several panels; expected no ax")
            figure.panel(ax)
            readable_decades([ax])
            return ax
        import matplotlib.pyplot

        with drawn_by(matplotlib.pyplot.figure):
            axes = list(figure.build().axes)
        readable_decades(axes)
    return axes[0] if len(axes) == 1 else axes
