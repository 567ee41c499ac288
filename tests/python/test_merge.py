"""Points of measuring programs as text, and logs of joint angles, as one table of poses."""

import json

import numpy as np
import pytest

import exactarm as ea
from exactarm import cli
from exactarm.data.point_text import read_points
from exactarm.errors import InputError

METRES = np.array([[0.512301, -0.020118, 0.834002], [0.49871, 0.033921, 0.790215], [0.4, 0.1, 0.7]])
NAMES = ("p1", "p2", "p3")
MM = 1e3 * METRES


def lines(form, groups=("monday", "monday", "tuesday")):
    """One line a point; form takes group, name and the three coordinates in mm."""
    return "".join(form(group, name, *(f"{value:.3f}" for value in point)) + "\n"
                   for group, name, point in zip(groups, NAMES, MM))


def written(folder, text, name="points.txt", encoding="utf-8"):
    (folder / name).write_bytes(text.encode(encoding))
    return folder / name


COMMENTS = "// SpatialAnalyzer 2023.1\n// Frame A::WORLD\n//  X, Y, Z\n\n"


@pytest.mark.parametrize("text, group", [
    (COMMENTS + lines(lambda g, n, x, y, z: f"{n}, {x}, {y}, {z}"), ""),
    (COMMENTS + lines(lambda g, n, x, y, z: f"{g} {n}   {x} {y} {z}"), "monday"),
    (COMMENTS + lines(lambda g, n, x, y, z: f"A,{g},{n},{x},{y},{z},"), "A::monday"),
    (lines(lambda g, n, x, y, z: f"A::{g}::{n}\t{x}\t{y}\t{z}"), "A::monday"),
    (lines(lambda g, n, x, y, z: f'"{n}" {x} {y} {z}'), ""),
    (lines(lambda g, n, x, y, z: f"{n};{x};{y};{z}".replace(".", ",")), ""),
    (lines(lambda g, n, x, y, z: f"{n} {x} {y} {z}".replace(".", ",")), ""),
    ("a title\nTarget;Group;X;Y;Z\n" + lines(lambda g, n, x, y, z: f"{n};{g};{x};{y};{z}"), "monday"),
])
def test_layouts_without_a_unit_hold_the_same_points(tmp_path, text, group):
    found = read_points(written(tmp_path, text), unit="mm")
    assert found.names == NAMES and found.groups[0] == group
    np.testing.assert_allclose(found.position, METRES, atol=1e-12)
    with pytest.raises(InputError, match="the unit of x is not in the file; expected --unit m, mm, in"):
        read_points(tmp_path / "points.txt")


def test_a_header_names_columns_and_units(tmp_path):
    text = "Point ID\tX [mm]\tY [mm]\tZ [mm]\tRMS\tNote\n" + lines(
        lambda g, n, x, y, z: f"{n}\t{x}\t{y}\t{z}\t0.012\tok")
    found = read_points(written(tmp_path, text, encoding="utf-16"), columns={"RMS": "rms_mm"})
    np.testing.assert_allclose(found.position, METRES, atol=1e-12)
    assert found.names == NAMES and list(found.extras) == ["rms_mm"] and found.extras["rms_mm"][0] == 0.012
    with pytest.raises(InputError, match="--unit m, but the file says mm of x"):
        read_points(tmp_path / "points.txt", unit="m")


@pytest.mark.parametrize("text, place", [
    ("p1;1.234,500;-20,118;834,002\np2;1.498,710;33,921;790,215\n", "line 1, column x: '1.234,500'"),
    ("p1;512,301;-20,118;834,002\np2;1.498,710;1.033,921;790,215\n", "line 2, column x: '1.498,710'"),
    ("name;x_mm;y_mm;z_mm\np1;512,301;-20,118;-1.834,002\n", "line 2, column z_mm: '-1.834,002'"),
    ("name x_mm y_mm z_mm\np1 1,234.500 -20.118 834.002\n", "line 2, column x_mm: '1,234.500'"),
    ("p1\t512.301\t1'020.118\t834.002\n", 'line 1, column y: "1\'020.118"'),
])
def test_a_mark_between_thousands_is_refused_by_line_and_column(tmp_path, text, place):
    """As in a table. The file had no point, or a line too few numbers."""
    unit = None if "x_mm" in text else "mm"
    with pytest.raises(InputError) as refused:
        read_points(written(tmp_path, text), unit)
    assert f"points.txt, {place} (thousands have a mark, which is not read); expected a number" in str(
        refused.value)


def test_numbers_that_could_be_names_need_a_layout(tmp_path):
    numbered = lambda g, n, x, y, z: f"{n[1]} {x} {y} {z}"
    path = written(tmp_path, lines(numbered))
    with pytest.raises(InputError, match=r"points.txt, line 1: 4 columns, 4 of them numbers.*--layout"):
        read_points(path, unit="mm")
    found = read_points(path, "mm", "name,x,y,z")
    assert found.names == ("1", "2", "3")
    longer = written(tmp_path, lines(lambda g, n, x, y, z: f"{n} {x} {y} {z} 0.1 0.2"))
    with pytest.raises(InputError, match="expected --layout"):
        read_points(longer, unit="mm")
    np.testing.assert_allclose(read_points(longer, "mm", "name,x,y,z").position, METRES, atol=1e-12)
    turned = read_points(longer, "in", "name,y,z,x,-,-").position
    np.testing.assert_allclose(turned, 0.0254 * MM[:, [2, 0, 1]], rtol=1e-12)


def polar(unit, turn=1.0, elevation=False):
    """Lines of name, horizontal angle, angle from the zenith or the horizon, distance in mm."""
    rows, whole = [], {"deg": 360.0, "gon": 400.0, "rad": 2.0 * np.pi}[unit]
    for name, (x, y, z) in zip(NAMES, MM):
        distance = np.sqrt(x**2 + y**2 + z**2)
        up = np.arcsin(z / distance) if elevation else np.arccos(z / distance)
        angles = np.array([turn * np.arctan2(y, x) % (2.0 * np.pi), up]) * whole / (2.0 * np.pi)
        rows.append(f"{name} {angles[0]:.12f} {angles[1]:.12f} {distance:.9f}")
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize("unit", ["deg", "gon", "rad"])
def test_polar_coordinates_are_read_where_their_columns_are_named(tmp_path, unit):
    path = written(tmp_path, polar(unit))
    found = read_points(path, layout=f"name,hz_{unit},v_{unit},distance_mm")
    np.testing.assert_allclose(found.position, METRES, atol=1e-9)
    path = written(tmp_path, polar(unit, -1.0, elevation=True))
    found = read_points(path, layout=f"name,hz_cw_{unit},elevation_{unit},distance_mm")
    np.testing.assert_allclose(found.position, METRES, atol=1e-9)
    assert not found.extras
    named = written(tmp_path, f"Name Hz V D\n{polar(unit)}")
    given = {"Hz": f"hz_{unit}", "V": f"v_{unit}", "D": "distance_mm"}
    np.testing.assert_allclose(read_points(named, columns=given).position, METRES, atol=1e-9)


@pytest.mark.parametrize("layout", ["name,hz_deg,v_deg,-", "name,hz_deg,hz_cw_deg,distance_mm",
                                    "name,hz_deg,v_deg,x", "name,v_deg,elevation_deg,distance_mm"])
def test_half_of_polar_coordinates_is_refused(tmp_path, layout):
    with pytest.raises(InputError, match="points.txt.*polar columns .*expected hz or hz_cw, v or elevation"):
        read_points(written(tmp_path, polar("deg")), layout=layout)


@pytest.mark.parametrize("number, why", [
    ("1.512,301", "line 2, column x: '1.512,301'"), ("1 512,301", "line 2, column x: '1 512,301'"),
    ("512,3O1", "line 2: 4 cells, 2 of them numbers")])
def test_a_first_point_that_cannot_be_read_is_not_taken_for_a_heading(tmp_path, number, why):
    """It was left out."""
    text = f"Name;X;Y;Z\np1;{number};-20,118;834,002\np2;498,710;33,921;790,215\n"
    (tmp_path / "points.txt").write_text(text)
    with pytest.raises(InputError, match=f"points.txt, {why}"):
        read_points(tmp_path / "points.txt", unit="mm")


@pytest.mark.parametrize("old, new, place", [
    ("p2 498.710", "p2", "line 2: 3 cells, 2 of them numbers; expected 4 as in line 1"),
    ("498.710", "498,710,1", "line 2: 4 cells, 2 of them numbers"),
    ("498.710", "1e400", "line 2, column x"),
    ("498.710", "4e12", "line 2: a coordinate beyond"),
])
def test_a_line_that_is_no_point_is_refused_by_its_number(tmp_path, old, new, place):
    path = written(tmp_path, lines(lambda g, n, x, y, z: f"{n} {x} {y} {z}").replace(old, new))
    with pytest.raises(InputError) as error:
        read_points(path, unit="mm")
    assert f"points.txt, {place}" in str(error.value) and "\n" not in str(error.value)


LOG = """Punkt;J1;J2;J3;J4;J5;J6;temperature_degC
p3;7;8;9;1;2;3;21,5
p1;1,5;2;3;4;5;6;21
other;0;0;0;0;1;1;20
"""
MAP = [word for i in range(1, 7) for word in ("--map", f"J{i}=q_{i}_deg")] + ["--map", "Punkt=name"]


def merged(tmp_path, log, points, *words):
    joints = written(tmp_path, log, "joints.csv")
    path = written(tmp_path, points)
    words = [str(joints), str(path), *words, "--out", str(tmp_path / "out"), "--quiet"]
    code = cli.main(["merge", "ur10", *words])
    out = tmp_path / "out/result.json"
    return code, json.loads(out.read_text()) if out.exists() else None


def test_points_and_joint_angles_are_merged_by_name(tmp_path):
    text = COMMENTS + lines(lambda g, n, x, y, z: f"{g} {n} {x} {y} {z}")
    code, result = merged(tmp_path, LOG, text, "--unit", "mm", *MAP)
    assert code == 0 and result["by"] == "name" and result["rows"] == 2
    assert result["without_point"] == ["other"] and result["without_angles"] == ["p2"]
    data = ea.read(tmp_path / "out/poses.csv", "ur10")
    np.testing.assert_allclose(data.position, METRES[[2, 0]], atol=1e-12)
    np.testing.assert_allclose(np.degrees(data.joints["q"][1]), [1.5, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(data.covariates["temperature_degC"], [21.5, 21.0])
    assert {entry["file"] for entry in result["inputs"]} >= {str(tmp_path / "points.txt")}


def test_rows_are_merged_in_order_where_there_are_as_many(tmp_path, capsys):
    text = lines(lambda g, n, x, y, z: f"{x},{y},{z}")
    log = "\n".join(line.partition(";")[2] for line in LOG.splitlines()) + "\n"
    code, result = merged(tmp_path, log, text, "--unit", "mm", *MAP[:-2])
    assert code == 0 and result["by"] == "row" and result["rows"] == 3
    np.testing.assert_allclose(ea.read(tmp_path / "out/poses.csv", "ur10").position, METRES, atol=1e-12)
    code, _ = merged(tmp_path, log, text.split("\n", 1)[1], "--unit", "mm", *MAP[:-2])
    assert code == 2 and "points.txt: 2 points, but" in capsys.readouterr().err


def test_names_that_are_in_two_groups_need_the_group(tmp_path, capsys):
    text = lines(lambda g, n, x, y, z: f"{g} p1 {x} {y} {z}", ("a", "b", "c"))
    assert merged(tmp_path, LOG, text, "--unit", "mm", *MAP)[0] == 2
    error = capsys.readouterr().err
    assert "points.txt, line 2: point 'p1' is on line 1 too, in group a; expected --group" in error
    code, result = merged(tmp_path, LOG, text, "--unit", "mm", "--group", "b", *MAP)
    assert code == 0 and result["rows"] == 1
    np.testing.assert_allclose(ea.read(tmp_path / "out/poses.csv", "ur10").position, METRES[1:2], atol=1e-12)
    log = LOG.replace("J1", "group;J1").replace("p3;", "p1;c;").replace("p1;1,5", "p1;a;1,5")
    log = log.replace("other;", "x;a;")
    code, result = merged(tmp_path, log, text, "--unit", "mm", *MAP)
    assert code == 0 and result["rows"] == 2
    again = ea.read(tmp_path / "out/poses.csv", "ur10")
    np.testing.assert_allclose(again.position, METRES[[2, 0]], atol=1e-12)


@pytest.mark.parametrize("log, points, words, said", [
    (LOG.replace("p3", "p1"), "p1 1 2 3\n", [], "joints.csv, row 2, column name: 'p1' is in row 1 too"),
    (LOG, "q1 1 2 3\n", [], "none of the names of"),
    (LOG, "1 2 3\n", [], "the points have no names; expected --by row"),
    (LOG, "p1 1 2 3\n", ["--map", "Q=x_mm"], "--map Q=x_mm: no such column in"),
    (LOG, "p1 1 2 3\n", ["--group", "b"], "--group b: no such group; expected one of (none)"),
    (LOG.replace("J6", "J7"), "p1 1 2 3\n", ["--map", "J7=q_7_deg"], "--map J6=q_6_deg: no such column"),
    (LOG, "nothing here\n", [], "points.txt: no point was found"),
])
def test_what_does_not_belong_together_is_refused_in_one_line(tmp_path, capsys, log, points, words, said):
    code, result = merged(tmp_path, log, points, "--unit", "mm", *MAP, *words)
    error = capsys.readouterr().err.strip()
    assert code == 2 and result is None and said in error and "\n" not in error


def test_the_example_of_the_page_is_read(tmp_path):
    from pathlib import Path

    page = (Path(__file__).parents[2] / "docs/tracker-exports.md").read_text()
    text = page.split("```text\n")[1].split("```")[0]
    found = read_points(written(tmp_path, text), unit="mm")
    assert found.names == NAMES[:2] and found.groups == ("monday", "monday")
    np.testing.assert_allclose(found.position, METRES[:2], atol=1e-12)
