"""Tables and axes read well: steady decimals, numbers to the right, blocks on phones, decades as text."""

from matplotlib.figure import Figure as Canvas

from exactarm.commands.error_sections import geometry_tables
from exactarm.report import Estimate, Highlight, Highlights, Quantity, Report, Table
from exactarm.report.html import render_html
from exactarm.report.numbers import change, format_cells, quantities
from exactarm.report.plots.picture import house_style, readable_decades
from exactarm.report.terminal import columns_of, highlight_texts


def test_logarithmic_axes_are_labelled_in_text_that_a_reader_can_read(tmp_path):
    def labels(low, high):
        with house_style():
            axes = Canvas().subplots()
            axes.plot([0.0, 1.0], [low, high])
            axes.set_yscale("log")
            readable_decades([axes])
            axes.figure.draw_without_rendering()
            return [tick.get_text() for minor in (False, True) for tick in axes.get_yticklabels(minor=minor)
                    if tick.get_text()]

    assert {"10⁻⁴", "10⁰", "10³"} <= set(labels(1e-4, 1e3))
    narrow = labels(2.0e-3, 5.0e-3)  # less than a decade: the lines between are labelled
    assert "3×10⁻³" in narrow and not any(set(text) & set("$\\{}") for text in narrow)
    assert {"0.1", "0.6", "0.03"} <= set(labels(2.8e-2, 0.8))  # no powers of ten where they help nobody


def test_columns_of_text_that_are_numbers_stand_as_numbers():
    table = Table("Sizes", ("a", "b", "c"), (("1,203", "83 %", "axis 2"), ("0.0042", "–", "7")))
    assert columns_of(table)[2] == [True, True, False]


def test_identified_lengths_and_angles_have_the_decimals_of_their_intervals():
    lengths, angles, _ = geometry_tables(
        ["a_1_m", "d_2_m", "alpha_1_rad"], [0.15, 0.0, 1.5], [0.150198, 0.000653187, 1.5013],
        [(0.150179, 0.150217), (0.000561, 0.000745), (1.5012, 1.5014)], ["m", "m", "rad"], [False] * 3)
    header, columns, _ = columns_of(lengths)
    assert header[2] == "identified [mm]" and columns[2] == ["150.198", "0.653"]
    assert columns[3] == ["0.198 ± 0.019", "0.653 ± 0.092"]
    header, columns, _ = columns_of(angles)
    assert header[1:4] == ["declared [deg]", "identified [deg]", "change (95 %) [deg]"]
    assert columns[2] == ["86.0182"] and columns[3] == ["0.0745 ± 0.0057"]


def test_on_a_phone_every_cell_carries_the_name_of_its_column():
    page = render_html(Report("t", "v", (Table("Sizes", ("axis", "size", "<share>"), (("1", "2", "3"),)),)))
    assert 'class="stack"' in page and 'data-name="size"' in page and 'data-name="&lt;share&gt;"' in page


def test_numbers_that_a_sentence_compares_share_a_prefix_unless_far_apart():
    assert quantities([1.76e-4, 7.84e-5], "m") == ["0.176 mm", "0.0784 mm"]
    assert change(5.62e-4, 6.5e-5, "rad") == "falls from 0.562 mrad to 0.0650 mrad"
    assert quantities([3.9e-4, 5.37e-5], "rad") == ["0.390 mrad", "0.0537 mrad"]
    assert quantities([None, 4.47e-4], "m") == ["–", "0.447 mm"]
    assert change(1.14e-3, 7.3e-9, "m") == "falls from 1.14 mm to 7.30 nm"


def test_numbers_of_one_unit_share_a_prefix_in_a_column_of_several_units():
    cells = [Estimate(1.443e-4, 1.38e-4, 1.50e-4, "rad"), Estimate(2.98e-3, 2.95e-3, 3.01e-3, "s"),
             Estimate(4.88e-5, 4.5e-5, 5.3e-5, "rad"), Quantity(2e-8, "rad"), None]
    assert [text.rsplit(" ", 1)[-1] for text in format_cells(cells)] == ["mrad", "ms", "mrad", "µrad", "–"]


def test_headline_numbers_of_one_unit_have_one_prefix():
    pair = lambda label, after, before: Highlight(label, Quantity(after, "m"), Quantity(before, "m"))
    section = Highlights((pair("mean", 7.6e-5, 8.1e-5), pair("maximum", 1.76e-4, 1.9e-4),
                          Highlight("poses", Quantity(9, "", exact=True))))
    assert highlight_texts(section) == [
        ("mean", "0.0760 mm", "0.0810 mm"), ("maximum", "0.176 mm", "0.190 mm"), ("poses", "9", None)]


def test_statistics_of_one_error_stand_in_one_unit():
    table = Table("Error", ("", "rows", "mean", "RMS", "maximum", "std. dev."),
                  (("after", 9, *(Quantity(x, "m") for x in (7.2e-5, 7.8e-5, 1.34e-4, 3.1e-5))),))
    assert columns_of(table)[0] == ["", "rows", "mean [mm]", "RMS [mm]", "maximum [mm]", "std. dev. [mm]"]


def test_on_a_phone_a_number_that_heads_a_block_says_what_it_is():
    page = render_html(Report("T", "v", (Table("Axes", ("axis", "rate", "load", "error"),
                                               (("1", "2", "3", "4"),)),)), [])
    assert '<td data-name="axis" class="number">1</td>' in page
    assert '.stack td.number:first-child::before { content: attr(data-name) " "; }' in page


def test_a_study_shows_its_errors_in_one_unit():
    """7 nm stood over 0.2 mm in one column."""
    from types import SimpleNamespace

    import numpy as np

    from exactarm.commands import study_report

    def case(nu, error):
        played = SimpleNamespace(knots=np.full(3, error), between=np.full(3, 2.0 * error))
        plan = SimpleNamespace(tracking=SimpleNamespace(position_rms=error),
                               solver=SimpleNamespace(iterations=3))
        return SimpleNamespace(nu=nu, played=played, plan=plan, widest=19.8, ringing=np.array([0.9]))

    cases = [case(1e-14, 7.3e-9), case(1e-9, 1.92e-4)]
    table = study_report._table("line", {"acceleration": cases})
    header, columns, numeric = columns_of(table)
    assert header[2] == "knots, RMS [µm]" and columns[2] == ["0.00730", "192"] and numeric[2]
    assert study_report._verdict("line", cases) == (
        "line: between the knots of its plan the flange is off by 14.6 nm RMS with the smallest weight "
        "(ν = 10⁻¹⁴), by 0.384 mm with the largest (ν = 10⁻⁹).")


def test_the_picture_of_a_calibration_has_the_unit_of_its_table():
    import numpy as np

    from exactarm.report.plots.parameters import parameter_forest

    change = np.array([-1.46e-3, 2e-4])
    figure = parameter_forest(["alpha_3", "a_1"], change, change - 1e-4, change + 1e-4, ["rad", "m"])
    assert [axes.get_xlabel() for axes in figure.axes] == ["change [deg]", "change [mm]"]


def test_highlights_show_one_number_where_nothing_changed():
    from exactarm.commands.error_sections import highlights
    from exactarm.identify.statistics import summarise

    same = {"identification": summarise([1e-3]), "validation": summarise([1e-3, 2e-3])}
    lower = same | {"validation": summarise([1e-4])}
    assert [item.before for item in highlights(same, same, "m").items] == [None] * 3
    assert all(item.before is not None for item in highlights(same, lower, "m").items)


def test_an_axis_that_stands_still_is_drawn_so():
    """1e-4 deg/s of axis 4 filled its panel, beside 28 deg/s of axis 1."""
    import numpy as np

    from exactarm.report.plots.curves import LEAST_RANGE, curves_per_axis

    time = np.linspace(0.0, 1.0, 50)
    rates = np.stack([0.5 * np.sin(6.0 * time), 2e-6 * np.sin(6.0 * time), 0.5 + 0.0 * time], axis=1)
    first, still, steady = curves_per_axis(time, {"motor": rates}, unit="rad/s", name="rate").axes
    largest = np.degrees(np.abs(rates).max())
    for axes in (still, steady):
        assert np.ptp(axes.get_ylim()) >= 0.999 * LEAST_RANGE * largest
    assert still.get_ylim()[0] < 0.0 < still.get_ylim()[1] and np.ptp(first.get_ylim()) > largest
