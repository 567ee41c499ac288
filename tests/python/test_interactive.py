"""Figures on axes that exist: one panel as it is, of several the main one."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from matplotlib.figure import Figure as Drawing
from matplotlib.text import Text

from exactarm.errors import InputError
from exactarm.report import Figure
from exactarm.report.plots import (
    arm,
    change,
    compensation,
    curves,
    effects,
    parameters,
    residual,
    weighting,
    workspace,
    workspace_error,
)
from exactarm.report.plots.interactive import draw_figure
from exactarm.report.plots.picture import house_style

RANDOM = np.random.default_rng(11)
COUNT = 60
SIGNAL, NOISE = np.sort(RANDOM.uniform(-3, 3, COUNT)), RANDOM.normal(0, 1e-4, COUNT)
MAGNITUDE = np.abs(RANDOM.normal(1e-3, 2e-4, COUNT))
PANEL = effects.EffectPanel("Gear harmonics of axis 1", "angle of axis 1", "rad", "rad", SIGNAL,
                            1e-3 * np.sin(SIGNAL), np.full(COUNT, 1e-4), 1e-3 * np.sin(SIGNAL) + NOISE, NOISE,
                            True, True)
PLACES = np.outer(MAGNITUDE, [1e3, -5e2, 3e2])
OF_SEVERAL_PANELS = {
    "forest": lambda: parameters.parameter_forest(["d_1", "alpha_1"], NOISE[:2], NOISE[:2] - 1e-4,
                                                  NOISE[:2] + 1e-4, ["m", "rad"]),
    "effect_panels": lambda: effects.effect_panels([PANEL, replace(PANEL, curve=False)]),
    "residual": lambda: residual.residual_over_signal(SIGNAL, NOISE, NOISE / 2, unit="m", name="residual",
                                                      signal_name="angle", signal_unit="rad"),
    "curves_per_axis": lambda: curves.curves_per_axis(
        np.arange(9.0), {"a": np.ones((9, 7)), "b": np.zeros((9, 7))}, unit="Nm", name="torque"),
    "poses_view": lambda: workspace.poses_view(PLACES, MAGNITUDE > 1e-3),
    "error_over_workspace": lambda: workspace_error.error_over_workspace(PLACES, 2 * MAGNITUDE, MAGNITUDE),
    "shift_view": lambda: compensation.shift_view(PLACES, np.outer(NOISE, [1, 2, 3])),
    "statistic_over_days": lambda: change.statistic_over_days(
        10.0 ** np.arange(5), 365.0, np.outer(MAGNITUDE[:5], [1, 2]), 1e-4, 3, (1, 2)),
    "over_weight": lambda: weighting.over_weight(
        10.0 ** np.arange(-14.0, -10.0), {"RMS": MAGNITUDE[:4]}, 10.0 + np.arange(24.0).reshape(4, 6)),
    "trade_off": lambda: weighting.trade_off(
        {path: {"jerk": (1.0 + np.arange(3.0), MAGNITUDE[:3])} for path in ("line", "spiral")}, "error",
        "width", "Hz"),
    "spectra of a study": lambda: weighting.spectra_per_axis(
        np.arange(1.0, 9.0), {"nu = 1e-14": np.ones((8, 6)), "nu = 1e-6": np.full((8, 6), 1e-3)}),
    "histories": lambda: weighting.histories(
        np.arange(COUNT), [("joint error", "rad", {"axis 1": NOISE}), ("error", "m", {"x": MAGNITUDE})]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OF_SEVERAL_PANELS)
def test_of_several_panels_the_main_one_is_drawn_on_axes_that_exist(name):
    build, bars = OF_SEVERAL_PANELS[name], int(name == "error_over_workspace")  # of colours
    with house_style():
        titles = [axes.get_title(loc="left") for axes in build().axes if axes.get_visible()]
    last = len(titles) - bars - 1
    assert last > 0
    for main in (0, last):
        drawing = Drawing()
        other, given = drawing.subplots(2, 1)
        assert draw_figure(Figure(name, name, build, "", "", main=main), given) is given
        assert given.has_data() and not other.has_data() and len(drawing.axes) == 2 + bars
        assert given.get_title(loc="left") == titles[main] and given.get_xlabel()
        assert given.get_ylabel() or given.get_yticklabels()
        drawing.draw_without_rendering()
        title, legend = given.get_title(loc="left"), given.get_legend()
        words = given.findobj(lambda artist: isinstance(artist, Text) and artist.get_text() == title)
        assert not title or legend is None or not legend.get_window_extent().overlaps(
            words[0].get_window_extent())
    assert all(label.get_visible() for label in (*other.get_xticklabels(), *given.get_xticklabels()))


def test_what_is_drawn_in_space_needs_axes_in_space():
    points, errors_ = RANDOM.random((COUNT, 3)), RANDOM.normal(0.0, 1e-3, (COUNT, 3))
    build = partial(arm.arm_with_errors, points[:7], points, errors_, errors_ / 4.0)
    figure = Figure("arm", "arm", build, "", "", main=1)
    with pytest.raises(InputError, match="figure arm is drawn in space; expected axes .*projection='3d'"):
        draw_figure(figure, Drawing().subplots())
    given = Drawing().add_subplot(projection="3d")
    assert draw_figure(figure, given) is given and given.get_figure().axes[1:]  # the bar of colours
    assert given.get_title().startswith("after: RMS")
