"""Tables as other programs write them: semicolons, tabs, decimal commas, columns by other names."""

import json

import numpy as np
import pytest

import exactarm as ea
from exactarm import cli
from exactarm.data.columns import parse_column
from exactarm.errors import InputError
from exactarm.files.table import read_table
from exactarm.robot.robot import Joint, Robot

PLAIN = "q_1_rad,q_2_rad,x_mm,y_mm,z_mm\n0.1,-2.5e-3,512.25,1,3\n0.2,1,1000.5,-0.5,4\n"
TWO = Robot("two", (Joint(), Joint()))


def written(folder, text, name="poses.csv"):
    (folder / name).write_text(text)
    return folder / name


def semicolons(text, comma=True):
    text = text.replace(",", ";")
    return text.replace(".", ",") if comma else text


@pytest.mark.parametrize(
    "text",
    [
        semicolons(PLAIN),
        semicolons(PLAIN, False),
        PLAIN.replace(",", "\t"),
        semicolons(PLAIN).replace(";", "\t"),
        semicolons(PLAIN).replace("\n", "\r\n"),
    ],
)
def test_every_dialect_holds_the_same_numbers(tmp_path, text):
    expected, found = (read_table(written(tmp_path, each)).columns for each in (PLAIN, text))
    assert list(found) == list(expected)
    for name in expected:
        np.testing.assert_array_equal(found[name], expected[name])


@pytest.mark.parametrize(
    "old, new, place",
    [
        ("512,25", "1.512,25", "row 1, column x_mm: '1.512,25' (thousands have a mark, which is not read)"),
        ("512,25", f"5.2{'9' * 40}", f"row 1, column x_mm: '5.2{'9' * 9}...{'9' * 13}' (a point, with"),
        ("512,25", "512.25", "row 1, column x_mm"),
        ("1000,5", "1,000,5", "row 2, column x_mm"),
        ("1000,5", "", "row 2, column x_mm: empty cell"),
        ("1000,5", "far", "row 2, column x_mm: 'far'"),
        ("-0,5;4", "-0,5", "row 2, column z_mm: only 4 cells"),
    ],
)
def test_what_could_mean_two_numbers_is_refused_by_row_and_column(tmp_path, old, new, place):
    path = written(tmp_path, semicolons(PLAIN).replace(old, new))
    with pytest.raises(InputError) as error:
        read_table(path)
    assert f"poses.csv, {place}" in str(error.value) and "\n" not in str(error.value)


def test_a_comma_file_with_a_semicolon_in_a_cell_stays_a_comma_file(tmp_path):
    with pytest.raises(InputError, match="row 1, column q_1_rad: '0;1'; expected a number"):
        read_table(written(tmp_path, PLAIN.replace("0.1", "0;1")))


def test_columns_by_other_names_are_read_as_ours(tmp_path):
    path = written(tmp_path, "J1;J2;X;Y;Z\n90,0;45;1000,5;2;3\n")
    names = {"J1": "q_1_deg", "J2": "q_2_deg", "X": "x_mm", "Y": "y_mm", "Z": "z_mm"}
    data = ea.read(path, TWO, columns=names)
    np.testing.assert_allclose(data.joints["q"], [[np.pi / 2, np.pi / 4]])
    np.testing.assert_allclose(data.position, [[1.0005, 0.002, 0.003]])


@pytest.mark.parametrize(
    "names, said",
    [
        ({"J3": "q_1_deg"}, "column J3: --map names a column that is not there; expected one of J1"),
        ({"J1": "q_1_feet"}, r"column J1 \(q_1_feet\): unknown unit 'feet'; expected q_1_rad or q_1_deg"),
        ({"J1": "x_mm", "X": "x_mm"}, "column x_mm: the same quantity as column x_mm"),
    ],
)
def test_a_wrong_map_is_refused_by_its_column(tmp_path, names, said):
    path = written(tmp_path, "J1,J2,X,Y,Z\n90,45,1,2,3\n")
    with pytest.raises(InputError, match=said):
        ea.read(path, TWO, columns=names)


@pytest.mark.slow
def test_the_command_maps_columns_and_tells_the_file(tmp_path, capsys):
    rows = ea.example("ur10/series_B").read_text().splitlines()[:400]
    theirs = [f"J{i}" for i in range(1, 7)]
    header = rows[0].split(",")
    header[1:7] = theirs
    text = (
        "\n".join([";".join(header), *(row.replace(",", ";").replace(".", ",") for row in rows[1:])]) + "\n"
    )
    path = written(tmp_path, text, "theirs.csv")
    ours = written(tmp_path, "\n".join(rows) + "\n", "ours.csv")
    maps = [word for i in range(1, 7) for word in ("--map", f"J{i}=q_{i}_rad")]
    for file, more in ((ours, []), (path, maps)):
        assert (
            cli.main(["evaluate", "ur10", str(file), *more, "--out", str(tmp_path / file.stem), "--quiet"])
            == 0
        )
    one, other = (json.loads((tmp_path / name / "result.json").read_text()) for name in ("ours", "theirs"))
    assert (
        other["error"] == one["error"]
        and other["inputs"][0]["file"] == str(path)
        and other["inputs"][0]["rows"] == 399
    )
    assert cli.main(["evaluate", "ur10", str(path), "--map", "J1", "--out", str(tmp_path / "o")]) == 2
    assert "expected the file's name and ours, as J1=q_1_deg" in capsys.readouterr().err


@pytest.mark.parametrize("name, expected", [
    ("payload_lb", "unknown unit 'lb'; expected payload_kg"), ("payload", "no unit; expected payload_kg"),
    ("payload_g", "unknown unit 'g'; expected payload_kg"),
    ("temperature_degF", "unknown unit 'degF'; expected temperature_degC"),
    ("temp_motor_F", "unknown unit 'F'; expected temp_motor_degC"),
    ("motor_temp_K", "unknown unit 'K'; expected motor_temp_degC"),
    ("oil_degF", "unknown unit 'degF'; expected oil_degC"), ("temperature_degC", ""), ("humidity", ""),
    ("payload_id", ""),
])
def test_a_load_or_temperature_in_another_unit_is_no_covariate(name, expected):
    if not expected:
        assert parse_column(name, "poses.csv").quantity == "covariate"
        return
    with pytest.raises(InputError) as told:
        parse_column(name, "poses.csv")
    assert str(told.value) == f"poses.csv, column {name}: {expected}"


def test_a_table_in_the_code_page_of_windows_says_how_to_save_it(tmp_path):
    path = tmp_path / "poses.csv"
    path.write_bytes((PLAIN.replace("3\n", "3\u00e4\n")).encode("cp1252"))
    with pytest.raises(InputError, match=r"poses.csv, row 1: is not UTF-8 text \(Excel: save as CSV UTF-8\)"):
        read_table(path)
