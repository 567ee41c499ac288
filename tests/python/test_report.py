"""What a person reads: numbers, terminal text, the page, and pictures that come out the same every time."""

import re
from functools import partial
from xml.etree import ElementTree

import numpy as np
import pytest

from exactarm.effects.units_in_names import unit_of
from exactarm.report import (
    Estimate,
    Figure,
    Highlight,
    Highlights,
    Link,
    Quantity,
    Report,
    Table,
    Text,
    Warnings,
)
from exactarm.report.html import render_html
from exactarm.report.numbers import choose_scale, estimate, format_cells, number, quantity
from exactarm.report.plots import arm, curves, design, effects, parameters, residual, workspace
from exactarm.report.plots.errors import error_histogram, error_per_pose
from exactarm.report.plots.files import draw
from exactarm.report.plots.picture import house_style
from exactarm.report.plots.style import on_one_panel
from exactarm.report.terminal import columns_of, render_text

pytestmark = pytest.mark.drawn  # what the files of figures hold is looked at
RANDOM = np.random.default_rng(11)


@pytest.mark.parametrize("value, unit, text", [
    (0.000382, "m", "0.382 mm"),
    (0.0000312, "m", "31.2 µm"),
    (1.25, "m", "1250 mm"),
    (0.0, "m", "0 mm"),
    (-0.00123, "rad", "−1.23 mrad"),
    (1.5708, "rad", "1.57 rad"),
    (2.5e-5, "rad", "25.0 µrad"),
    (812345.0, "Nm/rad", "812 kNm/rad"),
    (3.4e-7, "rad/Nm", "340 nrad/Nm"),
    (2.5e-4, "m/h", "250 µm/h"),
    (12.0, "Nm", "12.0 Nm"),
    (0.97, "", "0.970"),
    (4.2e-9, "", "4.20e−9"),
    (None, "m", "–"),
    (float("nan"), "m", "–"),
])
def test_a_quantity_chooses_its_prefix_and_digits(value, unit, text):
    assert quantity(value, unit) == text


@pytest.mark.parametrize("value, half, unit, text", [
    (0.0004, 0.00002, "rad", "0.400 ± 0.020 mrad"),
    (0.61234567, 0.000012, "m", "612.346 ± 0.012 mm"),
    (120.4, 33.0, "Nm", "120 ± 33 Nm"),
    (0.00051, 0.0, "m", "0.510 mm"),
    (0.00051, float("inf"), "m", "0.510 mm"),
    (-1e-9, 1.0e-3, "m", "0.0 ± 1.0 mm"),
])
def test_an_estimate_has_the_digits_that_its_interval_allows(value, half, unit, text):
    assert estimate(value, value - half, value + half, unit) == text


def test_an_estimate_at_its_bound_shows_the_ends_of_its_interval():
    assert estimate(0.0, 0.0, 1.2e-4, "rad") == "0 (0 to 120) µrad"


@pytest.mark.parametrize("name, unit", [
    ("width_rad", "rad"), ("linear_rad_per_Nm", "rad/Nm"), ("cubic_rad_per_Nm3", "rad/Nm³"),
    ("rad_per_Nm", "rad/Nm"),
    ("coefficient_Nm_sqrt_s", "Nm √s"), ("growth_1_per_degC", "1/°C"), ("zero_rad_per_h", "rad/h"),
    ("x_m_per_row", "m/row"),
    ("relative_s_per_rad", "s/rad"), ("a_1", ""), ("order_per_rev", ""), ("coupling_rad_per_rad", "rad/rad"),
])
def test_a_unit_is_read_off_the_name(name, unit):
    assert unit_of(name) == unit


def test_a_column_shares_one_prefix():
    cells = [Quantity(0.00193, "m"), Quantity(0.000378, "m"), None, "none"]
    assert format_cells(cells) == ["1.930 mm", "0.378 mm", "–", "none"]


def test_a_declared_number_keeps_its_digits():
    cells = [Quantity(np.pi / 2, "rad", exact=True), Quantity(0.163941, "m", exact=True),
             Quantity(-0.0, "m", exact=True)]
    assert format_cells(cells) == ["1.5708 rad", "163.941 mm", "0 mm"]


def test_a_column_of_several_units_is_read_row_by_row():
    cells = [Quantity(0.6, "m"), Quantity(0.0005, "rad"), Quantity(1.5708, "rad"), Quantity(0.0, "rad")]
    assert format_cells(cells) == ["600 mm", "0.500 mrad", "1.57 rad", "0 mrad"]


def test_a_scale_is_found_for_every_size():
    for exponent in range(-15, 10):
        assert choose_scale([10.0**exponent], "m").size in (1.0, 1e-3, 1e-6, 1e-9)
    assert number(10.0) == "10.0" and number(0.09996, 2) == "0.10" and number(0.9996) == "1.00"


def picture():
    axes_values = np.array([1.0, 2.0, 4.0])
    return alone(curves.curves, axes_values, {"a": axes_values * 1e-3}, unit="m", name="error")


REPORT = Report(
    "Calibration of ur10",
    "The mean position error on poses that were never fitted falls from 1.93 mm to 0.378 mm, "
    "which is about what the measurement allows.",
    (
        Highlights((
            Highlight("validation, mean", Quantity(0.378e-3, "m"), Quantity(1.93e-3, "m")),
            Highlight("noise", Quantity(31e-6, "m")),
        )),
        Table("Position error", ("", "poses", "mean", "maximum"), (
            ("before", 60, Quantity(1.95e-3, "m"), Quantity(3.3e-3, "m")),
            ("after", 60, Quantity(0.378e-3, "m"), Quantity(0.98e-3, "m")),
        ), note="Drawn at random (seed 1).", emphasis=1),
        Warnings(("`spring_3` is at its bound: axis 3 looks rigid on this data & cannot be told from a rigid "
                  "one.",)),
        Table("Parameters", ("parameter", "change"), (
            ("d_1", Estimate(-0.54e-3, -0.78e-3, -0.30e-3, "m")),
            ("alpha_1", Estimate(0.6021e-3, 0.5171e-3, 0.6871e-3, "rad")),
            ("a_2", None),
        )),
        Table("Nothing", ("parameter",), ()),
        Table("Marks", ("parameter", ""), (("d_1", ""),)),
        Table("Not identified", ("parameter", "why"), (
            ("d_2", "It moves the tool as d_3 does: axes 2 and 3 are parallel, so that only the sum of both "
                    "can be seen."),
            ("d_1", "The base frame absorbs it."),
        )),
        Text("What stays", ("The residual follows axis 2; `exactarm diagnose` says why.",)),
        Figure("curve", "A curve", picture, "It rises.", 'A "rising" curve'),
    ),
    tone="good",
    details={"robot": "ur10", "files": "<b>.csv"},
)

GOLDEN = """\
Calibration of ur10
===================

The mean position error on poses that were never fitted falls from 1.93 mm to 0.378 mm, which is
about what the measurement allows.

  validation, mean  1.930 mm → 0.378 mm
  noise             31.0 µm

Position error
          poses  mean [mm]  maximum [mm]
  before     60      1.950         3.300
  after      60      0.378         0.980
  Drawn at random (seed 1).

Parameters
  parameter              change
  d_1           −0.54 ± 0.24 mm
  alpha_1    0.602 ± 0.085 mrad
  a_2                         –

Marks
  parameter
  d_1

Not identified
  parameter  why
  d_2        It moves the tool as d_3 does: axes 2 and 3 are parallel, so that only the sum of both
             can be seen.
  d_1        The base frame absorbs it.

What stays
  The residual follows axis 2; `exactarm diagnose` says why.

warning: `spring_3` is at its bound: axis 3 looks rigid on this data & cannot be told from a rigid
  one.
"""


def test_the_terminal_shows_verdict_then_numbers_then_warnings():
    assert render_text(REPORT) == GOLDEN


def test_a_long_table_is_cut_on_the_terminal_only():
    table = Table("Many", ("n",), tuple((row,) for row in range(100)))
    report = Report("T", "V.", (table,))
    assert "... 60 more in report.html" in render_text(report)
    assert "<td class=\"number\">99</td>" in render_html(report)


def test_a_link_leads_to_a_file_beside_the_page():
    report = Report("T", "V.",
                    (Table("Steps", ("", "report"), (("one", Link("one/report.html", "open & see")),)),))
    assert '<a href="one/report.html">open &amp; see</a>' in render_html(report)
    assert "  one  one/report.html\n" in render_text(report)


def test_a_table_refuses_rows_of_another_length():
    with pytest.raises(ValueError, match="row 1: 1 cells, expected 2"):
        Table("T", ("a", "b"), ((1, 2), (1,)))


@pytest.fixture
def page(tmp_path):
    def place(name):
        (tmp_path / "plots").mkdir(exist_ok=True)
        return tmp_path / name

    return render_html(REPORT, draw(REPORT.figures, place))


def test_the_page_needs_nothing_but_itself(page):
    addresses = set(re.findall(r"https?://[^\s\"'<>]+", page))
    assert all(address.startswith("http://www.w3.org/") for address in addresses)
    assert not re.search(r"<script|<link|<img|@import|src=", page)


def test_the_page_is_well_formed_and_escapes_what_it_is_told(page):
    body = page[page.index("<main>"):page.index("</main>") + len("</main>")]
    root = ElementTree.fromstring(body)
    assert root.find(".//h1").text == "Calibration of ur10"
    assert "<b>.csv" in "".join(root.itertext()) and "&lt;b&gt;.csv" in page
    (drawing,) = root.iter("{http://www.w3.org/2000/svg}svg")
    assert drawing.get("aria-label") == 'A "rising" curve' and drawing.get("width") is None
    assert [code.text for code in root.iter("code")] == ["spring_3", "exactarm diagnose"]


def test_the_ids_of_all_drawings_differ_and_are_found(tmp_path):
    figures = tuple(Figure(name, name, picture, "", name) for name in ("one", "two"))
    (tmp_path / "plots").mkdir()
    html = render_html(Report("T", "V.", figures), draw(figures, lambda name: tmp_path / name))
    ids = re.findall(r'\bid="([^"]+)"', html)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]+)"', html)) | set(re.findall(r"url\(#([^)]+)\)", html)) <= set(ids)


def test_the_same_figure_gives_the_same_files(tmp_path):
    files = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        (folder / "plots").mkdir(parents=True)
        draw(REPORT.figures, lambda name: folder / name)
        files.append({path.name: path.read_bytes() for path in (folder / "plots").iterdir()})
    assert files[0] == files[1] and set(files[0]) == {"curve.svg", "curve.png"}


COUNT = 60
SIGNAL, NOISE = RANDOM.uniform(-3, 3, COUNT), RANDOM.normal(0, 1e-4, COUNT)
MAGNITUDE, MASK = np.abs(RANDOM.normal(1e-3, 2e-4, COUNT)), RANDOM.random(COUNT) < 0.3
NAMES, UNITS = ["d_1", "alpha_1", "a_2"], ["m", "rad", "m"]


def panel(curve):
    x = np.sort(SIGNAL)
    return effects.EffectPanel("Gear harmonics of axis 1", "angle of axis 1", "rad", "rad", x,
                               1e-3 * np.sin(x),
                               np.full(COUNT, 1e-4), 1e-3 * np.sin(x) + NOISE, NOISE, curve, True)


def alone(plot, *values, **options):
    return on_one_panel(partial(plot, *values, **options))


PLOTS = {
    "error_per_pose": lambda: alone(error_per_pose, 2 * MAGNITUDE, MAGNITUDE, MASK, "m"),
    "error_per_pose, none held out": lambda: alone(error_per_pose, MAGNITUDE, MAGNITUDE,
                                                   np.zeros(COUNT, bool), "m"),
    "error_histogram": lambda: alone(error_histogram, 2 * MAGNITUDE, MAGNITUDE, "m"),
    "error_histogram of zeros": lambda: alone(error_histogram, np.zeros(3), np.zeros(3), "m"),
    "forest": lambda: parameters.parameter_forest(
        NAMES, np.array([1e-3, 2e-3, 0]), np.array([0, 1e-3, -1e-3]), np.array([2e-3, 3e-3, 1e-3]), UNITS),
    "effect_panels": lambda: effects.effect_panels([panel(curve=True), panel(curve=False),
                                                    panel(curve=True)]),
    "contribution_bars": lambda: alone(effects.contribution_bars, ["backlash of axis 2", "payload"],
                                       np.array([1e-4, 3e-4]), 9e-5),
    "singular_values": lambda: alone(parameters.singular_values, np.array([3.0, 1.0, 0.0]), 2),
    "residual": lambda: residual.residual_over_signal(SIGNAL, NOISE, NOISE / 2, unit="m", name="residual",
                                                      signal_name="angle", signal_unit="rad"),
    "residual of few": lambda: residual.residual_over_signal(np.sign(SIGNAL), NOISE, NOISE, unit="m",
                                                             name="residual",
                                                             signal_name="direction"),
    "left over": lambda: alone(residual.left_over_signal, SIGNAL, NOISE, unit="rad", name="a turn",
                               signal_name="angle", signal_unit="rad"),
    "spectrum": lambda: alone(residual.spectrum, np.arange(COUNT), MAGNITUDE, MAGNITUDE / 2, unit="rad",
                              name="amplitude", marks=[(3.0, "3"), (4.0, "4")]),
    "curves": lambda: alone(curves.curves, 1.0 + np.arange(COUNT), {"a": MAGNITUDE, "b": SIGNAL**2},
                            log_y=True),
    "curves_per_axis": lambda: curves.curves_per_axis(np.arange(9.0),
                                                      {"a": np.ones((9, 7)), "b": np.zeros((9, 7))},
                                                      unit="Nm", name="torque"),
    "spectra_per_axis": lambda: curves.curves_per_axis(
        np.arange(1.0, 9.0), {"nu = 1e-14": np.ones((8, 6)), "nu = 1e-6": np.full((8, 6), 1e-3)},
        unit="rad/s²", name="amplitude", x_name="frequency", x_unit="Hz", log_x=True, log_y=True),
    "poses_view": lambda: workspace.poses_view(RANDOM.random((COUNT, 3)), MASK),
    "observability": lambda: alone(design.observability_over_steps, np.arange(5.0), references={"all": 2.0}),
}


@pytest.mark.parametrize("name", PLOTS)
def test_every_plot_names_its_axes_and_overlaps_no_text(name):
    with house_style():
        drawing = PLOTS[name]()
        drawing.draw_without_rendering()
        for axes in filter(lambda axes: axes.get_visible(), drawing.axes):
            assert axes.get_xlabel() or axes not in drawing.axes[-3:]
            boxes = [label.get_window_extent() for label in axes.get_xticklabels()
                     if label.get_text()
                     and axes.get_xlim()[0] <= label.get_position()[0] <= axes.get_xlim()[1]]
            assert all(right.x0 >= left.x1 for left, right in zip(boxes, boxes[1:])), "tick labels overlap"
        assert (
            drawing.axes[0].get_ylabel() or [label.get_text() for label in drawing.axes[0].get_yticklabels()]
        )


def test_the_arm_has_an_arrow_for_every_error_in_one_scale_before_and_after():
    points, errors_ = RANDOM.random((COUNT, 3)), RANDOM.normal(0.0, 1e-3, (COUNT, 3))
    with house_style():
        drawing = arm.arm_with_errors(RANDOM.random((7, 3)), points, errors_, errors_ / 4.0)
        drawing.draw_without_rendering()
    before, after = (next(c for c in axes.collections if hasattr(c, "_segments3d"))
                     for axes in drawing.axes[:2])
    longest = [max(np.linalg.norm(s[1] - s[0]) for s in c._segments3d[:COUNT]) for c in (before, after)]
    # a shaft and two strokes of the head
    assert len(before._segments3d) == len(after._segments3d) == 3 * COUNT
    assert longest[0] == pytest.approx(4.0 * longest[1]) and "times as long" in drawing.axes[2].get_xlabel()


def test_an_envelope_keeps_the_extremes():
    x = np.arange(100000.0)
    y = RANDOM.normal(size=x.size)
    thin_x, thin_y = curves.envelope(x, y)
    assert len(thin_x) <= curves.MOST_POINTS
    assert thin_y.max() == y.max() and thin_y.min() == y.min() and np.all(np.diff(thin_x) > 0)


def test_binned_means_cover_a_known_line():
    centre, mean, half = residual.binned_mean(SIGNAL, 2.0 * SIGNAL)
    assert np.allclose(mean, 2.0 * centre) and np.all(half > 0)
    centre, mean, _ = residual.binned_mean(np.array([-1.0, 1.0, -1.0, 1.0]), np.array([1.0, 3.0, 2.0, 5.0]))
    assert list(centre) == [-1.0, 1.0] and list(mean) == [1.5, 4.0]


def test_columns_that_are_compared_have_one_prefix():
    header = ("axis", "before", "after", "noise")
    rows = (("1", Quantity(0.5e-3, "rad"), Quantity(60e-6, "rad"), Quantity(1e-6, "rad")),)
    names, columns, _ = columns_of(Table("Error", header, rows))
    assert names == ["axis", "before [mrad]", "after [mrad]", "noise [µrad]"]
    assert columns[2] == ["0.0600"]


def test_nothing_is_called_before_where_nothing_changed():
    same, marked = np.array([1e-3, 2e-3, 3e-3]), np.array([False, True, True])
    legend = lambda figure: [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert legend(alone(error_per_pose, same, same, marked, "m")) == ["fitted", "not fitted"]
    assert legend(alone(error_per_pose, same, same, np.ones(3, bool), "m")) == ["not fitted"]
    changed = legend(alone(error_per_pose, 2.0 * same, same, marked, "m"))
    assert changed == ["before", "after, fitted", "after, not fitted"]
    assert legend(alone(error_histogram, same, same, "m")) == ["mean 2.00 mm"]


NASTY = 'a"><img src=x onerror=alert(1)>../$\\frac{'


def test_a_name_from_outside_is_text_and_nothing_else(tmp_path):
    def place(name):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        return tmp_path / name

    def drawn():
        return alone(curves.curves, np.arange(3.0), {NASTY: np.arange(3.0)}, unit=NASTY, name=NASTY)

    figure = Figure(f"error_{NASTY}", NASTY, drawn, NASTY, NASTY)
    report = Report(NASTY, NASTY,
                    (Table(NASTY, (NASTY,), ((NASTY,),), NASTY), Text(NASTY, (f"`{NASTY}`",)), figure, figure,
                                   Warnings((NASTY,))), details={NASTY: NASTY})
    page = render_html(report, draw(report.figures, place))
    assert "<img src=x" not in page.replace("<!-- ", "").replace(" -->", "")
    assert {path.parent for path in tmp_path.rglob("*.svg")} == {tmp_path / "plots"}
    assert len(list(tmp_path.rglob("*.svg"))) == 2, "figures of one name do not overwrite each other"
    names = re.findall(r'\bid="([^"]*)"', page)
    assert names and all(re.fullmatch(r"[\w.-]+", name) for name in names)


def test_the_page_lets_nothing_run_and_nothing_be_fetched(page):
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)[1]
    assert "default-src 'none'" in policy and "script-src" not in policy
    assert page.index("Content-Security-Policy") < page.index("<style>")


def test_an_effect_of_two_sides_is_drawn_as_two_levels_that_one_can_see():
    side = np.repeat([-1.0, 1.0], 20)
    two = effects.EffectPanel("Hysteresis of axis 2", "approach of axis 2", "", "rad", side, 3e-4 * side,
                              np.full(40, 3e-5), 3e-4 * side, np.zeros(40), True, True)
    (axes,) = effects.effect_panels([two]).axes
    bars = [line for line in axes.lines if len(line.get_xdata()) == 2]
    assert [np.ptp(bar.get_xdata()) > 0.3 for bar in bars] == [True, True]
    assert list(axes.get_xticks()) == [-1.0, 1.0]
    points = axes.lines[0].get_xdata()
    assert len(np.unique(points)) == 40 and np.abs(points - side).max() < 0.5
