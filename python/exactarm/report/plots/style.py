"""The house style: one look for all plots, colours that colour-blind eyes tell apart (Okabe and Ito)."""

from __future__ import annotations

from contextlib import contextmanager
from typing import Iterator

import matplotlib

matplotlib.use("Agg")

BLUE, ORANGE, GREEN, RED, PURPLE, SKY, YELLOW, GREY = (
    "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#F0E442", "#8A8F98",
)
BEFORE, AFTER = GREY, BLUE
CYCLE = (BLUE, RED, GREEN, ORANGE, PURPLE, SKY, "#000000")
WIDTH_IN, HEIGHT_IN = 7.2, 3.4

SETTINGS = {
    "figure.figsize": (WIDTH_IN, HEIGHT_IN),
    "figure.constrained_layout.use": True,
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.labelcolor": "#222222",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": matplotlib.cycler(color=CYCLE),
    "grid.color": "#E3E5E8",
    "grid.linewidth": 0.7,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "xtick.labelcolor": "#222222",
    "ytick.labelcolor": "#222222",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.4,
    "svg.hashsalt": "exactarm",
    "svg.fonttype": "path",
}


@contextmanager
def house_style() -> Iterator[None]:
    with matplotlib.rc_context(SETTINGS):
        yield
