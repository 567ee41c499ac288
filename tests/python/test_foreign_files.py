"""Files that nobody would write, but somebody sends: each is refused with one line that names the file."""

import pytest

from exactarm import cli
from exactarm.errors import InputError
from exactarm.files.examples import data_path
from exactarm.files.table import read_table
from exactarm.plan.path_file import load_path
from exactarm.robot.keys import MOST_AXES
from exactarm.robot_file import load_robot
from exactarm.simulate.virtual_robot import parse_effect

HUGE = 10**400
JOINT = 'name = "one"\n[[joints]]\n'
DIGITS = "9" * 5000


def urdf_chain(count: int, kind: str) -> str:
    links = "".join(f'<link name="l{i}"/>' for i in range(count + 1))
    joints = "".join(
        f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/></joint>'
        for i in range(count)
    )
    last = (
        f'<link name="tip"/><joint name="last" type="revolute"><parent link="l{count}"/><child '
        'link="tip"/></joint>'
    )
    return f'<robot name="long">{links}{joints}{last}</robot>'


@pytest.mark.parametrize(
    "content, words",
    [
        ("a = " + "[" * 100_000, "is nested too deeply"),
        ("a." * 200 + "a = 1", "is nested deeper than 32 tables"),
        (f"{JOINT}a_m = {DIGITS}", "a number or date that cannot be read"),
        (f"{JOINT}a_m = {HUGE}", "whole number of 333 hexadecimal digits"),
        ("when = 2024-13-45", "no valid TOML"),
        (f"{JOINT}[[effects]]\neffect = {{}}", "no effect named {}"),
        (f"{JOINT}[[effects]]\neffect = []", "no effect named []"),
        (f"links = [[]]\n{JOINT}", "key links: expected one [[links]]"),
        (f"{JOINT}type = []", 'expected "revolute" or "prismatic"'),
        ('name = "many"\n' + "[[joints]]\n" * (MOST_AXES + 1), f"expected at most {MOST_AXES}"),
    ],
)
def test_a_robot_file_of_nonsense_is_refused(tmp_path, content, words):
    path = tmp_path / "robot.toml"
    path.write_text(content)
    with pytest.raises(InputError) as error:
        load_robot(path)
    assert (
        str(error.value).startswith(str(path)) and words in str(error.value) and len(str(error.value)) < 1200
    )


@pytest.mark.parametrize(
    "content, words",
    [
        ("kind = []", "key kind"),
        ("kind = {}", "key kind"),
        (f"kind = {HUGE}", "whole number"),
        ('kind = "line"\nstart_m = ["0", "0", "0"]\nend_m = [0, 0, 1]', "key start_m"),
        ('kind = "line"\nstart_m = [true, false, true]\nend_m = [0, 0, 1]', "key start_m"),
        ('kind = "line"\nstart_m = [[0], [0], [0]]\nend_m = [0, 0, 1]', "key start_m"),
        ('kind = "points"\npoints_m = []', "at least two points"),
        ("a = " + "[" * 100_000, "is nested too deeply"),
    ],
)
def test_a_path_file_of_nonsense_is_refused(tmp_path, content, words):
    path = tmp_path / "path.toml"
    path.write_text(content)
    with pytest.raises(InputError) as error:
        load_path(path)
    assert (
        str(error.value).startswith(str(path)) and words in str(error.value) and len(str(error.value)) < 1200
    )


@pytest.mark.parametrize(
    "content, words",
    [
        (urdf_chain(3000, "revolute"), "3001 joints move between base and tip"),
        ('<?xml version="1.0" encoding="utf-99"?><robot/>', "encoding"),
        ("<robot>" + "<link>" * 50_000, "no valid XML"),
    ],
)
def test_a_urdf_of_nonsense_is_refused(tmp_path, content, words):
    path = tmp_path / "robot.urdf"
    path.write_text(content)
    with pytest.raises(InputError) as error:
        load_robot(path)
    assert (
        str(error.value).startswith(str(path)) and words in str(error.value) and len(str(error.value)) < 1200
    )


def test_a_urdf_of_thousands_of_fixed_links_is_read(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(urdf_chain(3000, "fixed"))
    assert load_robot(path).axes == 1


@pytest.mark.parametrize(
    "content, words",
    [
        (b"q_1_rad,q_2_rad\r1,2\r3,4\r", "carriage return alone"),
        (b"\nq_1_rad,q_2_rad\n1,2\n", "first line is empty"),
        (b'"' + b"a" * 200_000 + b'"\n1\n', "no header row"),
        (b"a,b\n1," + b"9" * 200_000 + b"x\n", "expected a number"),
    ],
)
def test_a_table_of_nonsense_is_refused(tmp_path, content, words):
    path = tmp_path / "data.csv"
    path.write_bytes(content)
    with pytest.raises(InputError) as error:
        read_table(path)
    assert (
        str(error.value).startswith(str(path)) and words in str(error.value) and len(str(error.value)) < 1200
    )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "  ",
        "backlash",
        "backlash joint",
        "backlash joint=9",
        "payload mass_kg=nan",
        "backlash joint=1 width_rad=x",
    ],
)
def test_an_effect_of_nonsense_is_refused(text):
    with pytest.raises(InputError, match="^--effect"):
        parse_effect(text, 6)


@pytest.mark.parametrize(
    "words, file",
    [
        (["calibrate", "kr300", str(data_path("ur10/series_B.csv"))], ""),
        (["plan", "kr300", "line"], "kr300: robot"),
        (["simulate", "kr300", "--measure", "motion"], "kr300: robot"),
        (["simulate", "ur10", "--measure", "gear"], "ur10: robot"),
        (["identify", "tx40", str(data_path("ur10/series_B.csv"))], "series_B.csv"),
        (["diagnose", "nobody", str(data_path("ur10/series_B.csv"))], "nobody: no robot of that name"),
        (
            ["simulate", "racer-7-1.4", str(data_path("racer/thesis_poses.csv")), "--measure", "tracked"],
            "thesis_poses.csv: ",
        ),
    ],
)
def test_a_refusal_names_the_file(tmp_path, capsys, words, file):
    assert cli.main([*words, "--out", str(tmp_path / "out"), "--quiet"]) == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1 and file in errors
