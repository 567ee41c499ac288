"""How an exchange of poses raises the observability."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from exactarm.report.plots.style import AFTER, CYCLE, label_with, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def observability_over_steps(values: np.ndarray, axes: Axes, *, name: str = "O1",
                             references: Mapping[str, float] | None = None) -> None:
    """Index (N,) after each exchange step; `references` are other pose sets as dashed lines."""
    axes.plot(np.arange(len(values)), values, color=AFTER, drawstyle="steps-post", label="exchange")
    for (label, level), colour in zip((references or {}).items(), CYCLE[1:]):
        axes.axhline(level, color=colour, linestyle="--", linewidth=1.2, label=label)
    axes.set(xlabel="exchange step", ylabel=label_with(f"observability {name}", ""))
    axes.margins(x=0.01)
    legend_above(axes)
