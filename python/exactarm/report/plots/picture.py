"""From a drawing to files: matplotlib's settings of the house style, text on logarithmic axes, SVG, PNG."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.ticker import LogFormatterSciNotation

from exactarm.report.plots.style import CYCLE, INK, SOFT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PNG_DOTS_PER_INCH = 110

SETTINGS = {
    "figure.constrained_layout.use": True,
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": matplotlib.cycler(color=CYCLE),
    "axes.unicode_minus": True,
    "grid.color": "#E3E5E8",
    "grid.linewidth": 0.7,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "legend.handletextpad": 0.5,
    "legend.columnspacing": 1.4,
    "lines.linewidth": 1.4,
    "text.parse_math": False,  # a column may be called cost_$: its name is no formula
    "svg.hashsalt": "exactarm",
    "svg.fonttype": "path",
}


@contextmanager
def house_style() -> Iterator[None]:
    with matplotlib.rc_context(SETTINGS):
        yield


class _Decades(LogFormatterSciNotation):
    """Labels of a logarithmic axis as text, 10³ and 2×10⁻⁴: `text.parse_math` is off, theirs are formulae."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        found = re.search(r"mathdefault\{(?:(.*)\\times)?(-?)10\^\{(-?\d+)\}\}", super().__call__(x, pos))
        if not found:
            return ""
        times, sign, exponent = found.groups()
        head = f"{times}×" if times else ""
        return f"{head}{sign}10{exponent.translate(_RAISED)}".replace("-", "−")


class _Plain(_Decades):
    """The same labels as 0.2 and 30."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f"{x:g}" if super().__call__(x, pos) else ""


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN = (1e-2, 1e4)  # an axis within these needs no powers of ten


def readable_decades(panels: Sequence[Axes]) -> None:
    """Logarithmic axes are labelled in text."""
    for axes in panels:
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_scale() == "log" and type(axis.get_major_formatter()) is LogFormatterSciNotation:
                low, high = axis.get_view_interval()
                labels = _Plain if _PLAIN[0] <= low and high <= _PLAIN[1] else _Decades
                axis.set_major_formatter(labels())
                axis.set_minor_formatter(labels(labelOnlyBase=False))


def write_picture(picture: Figure, vector: Path, raster: Path) -> None:
    """SVG and PNG from one layout, drawn once each: `savefig` would draw and lay out each one twice."""
    readable_decades(picture.axes)
    picture.set_dpi(PNG_DOTS_PER_INCH)
    FigureCanvasAgg(picture).print_png(raster, metadata={"Software": None})
    picture.set_layout_engine("none")
    FigureCanvasSVG(picture).print_svg(vector, metadata={"Date": None, "Creator": None})
