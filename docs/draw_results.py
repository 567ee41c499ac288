"""Draws the picture of the README from the results of two commands:

exactarm calibrate ur10 python/exactarm/data/examples/ur10/series_B.csv --out results/calibrate
exactarm diagnose ur10 python/exactarm/data/examples/ur10/series_B.csv --out results/diagnose
python docs/draw_results.py results docs/images/ur10.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas
from matplotlib.backends.backend_agg import FigureCanvasAgg

from exactarm.report.plots.picture import house_style
from exactarm.report.plots.style import AFTER, BEFORE, FLOOR, new_figure


def held_out(folder: Path, column: str) -> np.ndarray:
    """Position errors in mm on the poses that chose and fitted nothing."""
    table = pandas.read_csv(folder / "residuals.csv")
    return 1e3 * table.loc[table["set"] == "validation", column].dropna().to_numpy()


def main(results: Path, picture: Path) -> None:
    curves = (
        ("as the maker describes it", held_out(results / "calibrate", "error_before_m"), BEFORE),
        ("calibrated: geometry and springs", held_out(results / "calibrate", "error_after_m"), AFTER),
        ("with the causes that diagnose found", held_out(results / "diagnose", "error_after"), FLOOR),
    )
    bins = np.linspace(0.0, 1.8, 73)
    with house_style():
        figure = new_figure(height=3.2)
        axes = figure.subplots()
        for name, errors, colour in curves:
            share = 100.0 * np.histogram(errors, bins)[0] / len(errors)
            axes.stairs(share, bins, fill=True, alpha=0.35, color=colour)
            axes.stairs(share, bins, color=colour, linewidth=1.4)
            axes.plot([], [], color=colour, linewidth=6.0, alpha=0.6,
                      label=f"{name}: mean {errors.mean():.2f} mm")
        axes.set(xlim=(0.0, 1.8), ylim=(0.0, None),
                 xlabel="position error on poses that were never fitted [mm]",
                 ylabel="share of the poses [%]", title="UR10 under a laser tracker, series B")
        axes.legend(loc="upper right")
        picture.parent.mkdir(parents=True, exist_ok=True)
        figure.set_dpi(120)
        FigureCanvasAgg(figure).print_png(picture, metadata={"Software": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
