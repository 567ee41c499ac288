"""Draws the figures of a report once each, as SVG (also put into the page) and as PNG."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from exactarm.progress import SILENT, Progress
from exactarm.report.sections import Figure

DRAWING = "drawing"  # the last step of every command
_ONE_AT_A_TIME = threading.Lock()  # matplotlib's settings belong to the process, not to a thread


@dataclass(frozen=True)
class Drawing:
    """A figure and its SVG text."""

    figure: Figure
    svg: str


def draw(figures: Sequence[Figure], place: Callable[[str], Path],
         progress: Progress = SILENT) -> list[Drawing]:
    """Writes plots/NAME.svg and plots/NAME.png to `place(name)`; the same figure gives the same bytes."""
    if not figures:
        return []
    from exactarm.report.plots.picture import house_style, write_picture

    drawings = []
    progress.stage(DRAWING, total=len(figures))
    with _ONE_AT_A_TIME, house_style():
        for figure in figures:
            vector, raster = place(f"plots/{figure.name}.svg"), place(f"plots/{figure.name}.png")
            write_picture(figure.build(), vector, raster)
            drawings.append(Drawing(figure, vector.read_text(encoding="utf-8")))
            progress.step(note=figure.name)
    return drawings
