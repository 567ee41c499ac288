"""What a stranger types in the first ten minutes: one clear line that says what was meant, or it simply
works."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import exactarm as ea
from exactarm import cli
from exactarm.commands.effect_sections import _size
from exactarm.effects import effect_from_table
from exactarm.report.plots.effects import EffectPanel, _spikes, effect_panels
from exactarm.report.plots.errors import error_histogram
from exactarm.report.plots.style import on_one_panel
from exactarm.report.sections import Report, Text
from exactarm.report.terminal import render_text

HEAD = "q_1_rad,q_2_rad,q_3_rad,q_4_rad,q_5_rad,q_6_rad,x_mm,y_mm,z_mm\n"
ROWS = "".join(f"0.{i},-1.{i},1.2,0.3,0.4,{i},{500 + i}.25,100,300\n" for i in range(6))
TABLE = HEAD + ROWS


def excel(text):
    """As Excel saves it in countries with a decimal comma."""
    return text.replace(",", ";").replace(".", ",").replace("\n", "\r\n")


@pytest.mark.parametrize("content", [
    TABLE.replace("\n", "\r\n").encode(), b"\xef\xbb\xbf" + excel(TABLE).encode(),
    ("sep=;\r\n" + excel(TABLE)).encode(), b"\xef\xbb\xbf" + ("sep=;\r\n" + excel(TABLE)).encode(),
    ("# made by a camera\n# lengths in mm\n" + TABLE).encode(), ("# made by NumPy\n# " + TABLE).encode(),
    ("#" + TABLE).encode(), ('"' + HEAD.strip().replace(",", '", "') + '"\n' + ROWS).encode(),
])
def test_tables_as_other_programs_write_them_are_read(tmp_path, content):
    (tmp_path / "my poses.csv").write_bytes(content)
    data = ea.read(tmp_path / "my poses.csv", "ur10")
    np.testing.assert_allclose(data.position[:, 0], 1e-3 * (500.25 + np.arange(6)), atol=1e-12)


@pytest.mark.parametrize("content, words", [
    (b"PK\x03\x04" + TABLE.encode(), "is an Excel workbook or another archive; expected a CSV file in UTF-8"),
    (b"\xd0\xcf\x11\xe0" + TABLE.encode(), "is an Excel workbook; expected a CSV file"),
    (TABLE.encode("utf-16"), "is text in UTF-16; expected a CSV file in UTF-8"),
    (TABLE.replace("z_mm", "z_mm,temp °C").encode("latin-1"), "first line is no text in UTF-8"),
    (TABLE.replace("x_mm", "x [mm]").encode(), "column x: column missing; expected it beside column y_mm; "
                                               "did you mean it with x [mm]?"),
])
def test_what_is_no_such_table_is_named(tmp_path, capsys, content, words):
    (tmp_path / "poses.csv").write_bytes(content)
    assert cli.main(["evaluate", "ur10", str(tmp_path / "poses.csv"), "--out", str(tmp_path / "o")]) == 2
    told = capsys.readouterr().err
    assert words in told and told.count("\n") == 1


@pytest.mark.parametrize("robot, words", [
    ("poses.csv", "poses.csv: is measured data; expected a robot before it"),
    ("ur10/series_B", "ur10/series_B: is measured data; expected a robot before it"),
    ("Universal Robots UR10", "did you mean ur10?"), ("comau racer-7-14", "did you mean racer-7-1.4?"),
    ("ur1O", "did you mean ur10?"), ("tx_40", "did you mean tx40?"),
])
def test_a_robot_that_is_none_is_answered_with_what_was_meant(tmp_path, monkeypatch, capsys, robot, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "poses.csv").write_text(TABLE)
    assert cli.main(["calibrate", robot, "ur10", "--out", "o"]) == 2
    told = capsys.readouterr().err
    assert words in told and told.count("\n") == 1


def test_a_name_like_none_is_answered_with_all_of_them(tmp_path, capsys):
    assert cli.main(["plan", "line", "racer-7-1.4", "--out", str(tmp_path / "o")]) == 2
    told = capsys.readouterr().err
    assert "expected one of gen3lite, kr300" in told and "did you mean" not in told


def test_help_of_a_command_by_its_name(capsys):
    assert cli.main(["help", "merge"]) == 0  # failed before: it left the process
    assert "usage: exactarm merge" in capsys.readouterr().out


# -- what pages and terminals show ----------------------------------------------------------------------
def test_a_number_is_not_parted_from_its_unit():
    report = Report("t", "x " * 34 + "the first 70 % of the run identify, 2.5 mm of it")
    for width in range(60, 110):
        lines = render_text(report, width).splitlines()
        assert not any(line.lstrip().startswith(("%", "mm")) for line in lines)
    paragraph = Report("t", "v", (Text("h", ("word " * 12 + "is 0.35 mrad off.",)),))
    assert "0.35 mrad" in render_text(paragraph, 66)


def test_a_value_with_a_memory_is_drawn_as_points_and_a_curve_as_a_line():
    speed = np.linspace(-1.0, 1.0, 900)
    wave, step = np.sin(40.0 * speed), np.where(speed < 0.0, 1.0, -1.0)
    lagging = np.where((np.abs(speed) < 0.2) & (np.arange(900) % 9 == 0), -step, step)
    assert not _spikes(speed, wave) and not _spikes(speed, step) and _spikes(speed, lagging)
    assert not _spikes(speed[:2], step[:2]) and not _spikes(np.arange(5.0), np.zeros(5))
    few = speed[::15]  # three rows a wave leap, and are a curve all the same
    assert not _spikes(few, np.sin(60.0 * few))
    panel = lambda value: EffectPanel("t", "speed", "rad/s", "rad", speed, value, 0.1 * np.ones(900), value,
                                      0.1 * value, True, True)
    for value, style in ((step, "-"), (lagging, "None")):
        (axes,) = effect_panels([panel(value)]).axes
        (effect,) = (line for line in axes.lines if line.get_label() == "effect")
        assert effect.get_linestyle() == style


def test_every_size_has_a_name():
    """A base that gives way has one number whose name is all unit, rad_per_Nm."""
    effect = effect_from_table({"effect": "base_compliance", "rad_per_Nm": 1e-6})
    finding = SimpleNamespace(effect=effect, intervals=[(0.9e-6, 1.1e-6)], derived={})
    measure, size = _size(finding, None, ea.load_robot("ur10"))
    assert measure == "slope" and (size.value, size.unit) == (1e-6, "rad/Nm")


def test_a_long_title_ends_within_its_panel():
    """As of the gear harmonics of a KR300: "... of axis 2: RMS 0.062 → 0.023 mrad" lost its last letter."""
    x = np.linspace(0.0, 6.0, 50)
    panel = EffectPanel("Gear harmonics of axis 2", "phase of axis 2, order 826.3", "rad", "rad", x,
                        6.2e-5 * np.sin(x), 1e-6 * np.ones(50), 8.8e-5 * np.sin(x), 3.3e-5 * np.cos(x), True,
                        True)
    figure = effect_panels([panel, panel])
    figure.canvas.draw()
    for axes in figure.axes:
        assert axes.title.get_window_extent().x1 <= figure.bbox.x1 - 1


def test_numbers_beside_a_plot_keep_their_digits():
    figure = on_one_panel(partial(error_histogram, np.full(9, 1.0337e-3), np.full(9, 3.8e-4), "m"))
    told = [text.get_text() for text in figure.legends[0].get_texts()] if figure.legends else [
        text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert told == ["before: mean 1.03 mm", "after: mean 0.380 mm"]


def test_an_axis_that_stands_still_has_no_bandwidth():
    result = ea.plan("racer-7-1.4", "line", rate_hz=200, duration_s=2.0)
    (table,) = (section for section in result.report.sections if getattr(section, "heading", "") == "Axes")
    assert [row[1].unit for row in table.rows] == ["deg/s"] * 6  # as in the plots below
    still = [row[0] for row in table.rows if row[3].value is None]
    assert still == ["4"] and table.note.endswith("An axis that stands still has none.")
    assert all(row[1].value is None and row[2].value is None for row in table.rows if row[0] in still)
