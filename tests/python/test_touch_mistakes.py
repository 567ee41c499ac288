"""Mistakes in the angles of touches are named, and right touches are accused of nothing, whatever the arm
lacks."""

import re
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from exactarm.cli import main
from exactarm.data.dataset import Dataset, read_dataset
from exactarm.data.fixture import load_fixture
from exactarm.errors import InputError
from exactarm.files.examples import data_path
from exactarm.first_aid.first_aid import first_aid
from exactarm.first_aid.touch_mistakes import unused_distances
from exactarm.identify.closures import require_size
from exactarm.robot_file import load_robot
from test_closures import ECCENTRICITY, touched
from test_contact_starts import touched_blocks

MISTAKES = {
    "the opposite sign of axis 4": lambda q: q * [1, 1, 1, -1, 1, 1, 1][: q.shape[1]],
    "axes 2 and 3 exchanged": lambda q: q[:, [0, 2, 1, *range(3, q.shape[1])]],
    "another zero of axis 3 (by -90 degrees)": lambda q: q + np.pi / 2 * (np.arange(q.shape[1]) == 2),
    "degrees labelled as radians": lambda q: q * 180 / np.pi,
    "radians labelled as degrees": lambda q: q * np.pi / 180,
}
CONTACTS = [("ur10", "bar"), *(
    pytest.param(*each, marks=pytest.mark.slow)
    for each in (("panda", "socket"), ("ur10", "sphere"), ("panda", "plane"), ("panda", "pair")))]


def with_angles(data: Dataset, change) -> Dataset:
    angles = {name: change(values) for name, values in data.joints.items() if name in ("theta", "q")}
    return replace(data, joints=data.joints | angles)


def changed(robot, data):
    """Words of each mistake, and what is said where it was made."""
    return [(words, first_aid(robot, with_angles(data, change))) for words, change in MISTAKES.items()]


def told(found: list) -> list[str]:
    """Mistakes that are not named in one line."""
    return [words for words, lines in found
            if len(lines) != 1 or not lines[0].startswith(f"with {words} the data would fit the robot ")]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "contact"), CONTACTS)
def test_mistakes_in_the_angles_of_touches_are_named(name, contact):
    robot, data = touched(name, contact, 1, count=20)
    assert told(changed(robot.nominal, data)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "contact"), CONTACTS)
def test_another_zero_of_any_size_is_named(name, contact):
    """Axis and angle; the first axis' zero and, but for faces and pairs, the last one's show nowhere."""
    robot, data = touched(name, contact, 1, count=20)
    for axis, angle in ((2, 5.0), (3, -12.0), (4, 30.0)):
        line, = first_aid(robot.nominal, with_angles(data, lambda q: q + np.radians(angle) * (
            np.arange(q.shape[1]) == axis - 1)))
        found = re.match(rf"with another zero of axis {axis} \(by ([-+.0-9]+) degrees\)", line)
        assert found and float(found[1]) == pytest.approx(-angle, abs=0.6)  # the arm's own zeros: 5 mrad each


@pytest.mark.parametrize(("share", "refused"), [(0.4, True), (0.6, False), (1.9, False), (2.1, True)])
def test_touches_that_meet_only_with_another_arm_are_refused(share, refused):
    """An arm of no length touches any face: from a far wrong start a search ends there (0.39 times, where
    axis 4 of `simulate panda --measure closures --contact plane --count 25 --deviation 1 --seed 5` is off by
    30 degrees)."""
    robot = load_robot("ur10")
    data = read_dataset(data_path("ur10") / "series_B.csv", robot)
    found = replace(robot, joints=tuple(replace(joint, a=share * joint.a, d=share * joint.d)
                                        for joint in robot.joints))
    with (pytest.raises(InputError, match=f"only if the arm is {share} times as large as ur10") if refused
          else nullcontext()):
        require_size(robot, found, data)


@pytest.mark.slow
def test_mistakes_are_named_where_a_cube_is_touched():
    """The touches of a whole face of every arm lie in one plane where axis 1 stands still; that is no
    explanation."""
    robot, data = touched_blocks("ur10", 1)
    assert told(changed(robot.nominal, data)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "contact"), CONTACTS)
def test_right_touches_are_accused_of_nothing(name, contact):
    for effects in ((), (ECCENTRICITY,)):
        robot, data = touched(name, contact, 2, *effects, count=20)
        assert first_aid(robot.nominal, data) == ()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dinova_1", *(
    pytest.param(name, marks=pytest.mark.slow) for name in ("panda_3", "panda_6", "panda_7", "dinova_2"))])
def test_the_shipped_arms_are_accused_of_nothing_and_mistakes_in_them_are_named(name):
    robot, folder = load_robot("panda" if "panda" in name else "gen3lite"), data_path("ball_in_socket")
    data = read_dataset(folder / f"{name}.csv", robot, fixture=load_fixture(folder / "fixture.toml"))
    assert first_aid(robot, data) == ()
    assert told(changed(robot, data)) == []


@pytest.mark.slow
def test_a_single_face_and_a_few_touches_accuse_nothing():
    robot, data = touched("ur10", "plane", 3, count=20)
    few = data.select(data.contacts["plane"] == 0).select(np.arange(0, 60, 5))
    assert first_aid(robot.nominal, with_angles(few, MISTAKES["axes 2 and 3 exchanged"])) == ()


@pytest.mark.slow
def test_the_refusal_of_touches_names_the_mistake(tmp_path, capsys):
    lines = (data_path("ball_in_socket") / "panda_7.csv").read_text().splitlines()
    column = next(row for row in lines if not row.startswith("#")).split(",").index("q_4_rad")
    out = []
    for line in lines:
        cells = line.split(",")
        if not line.startswith("#") and cells[column] != "q_4_rad":
            cells[column] = str(-float(cells[column]))
        out.append(",".join(cells))
    (tmp_path / "negated.csv").write_text("\n".join(out) + "\n")
    fixture = str(data_path("ball_in_socket") / "fixture.toml")
    assert main(["calibrate", "panda", str(tmp_path / "negated.csv"), "--fixture", fixture, "--out",
                 str(tmp_path / "out"), "--quiet"]) != 0
    assert "with the opposite sign of axis 4 the data would fit" in capsys.readouterr().err


@pytest.mark.slow
def test_distances_of_seats_that_nobody_touched_are_told():
    """The fixture numbers its seats from 0, the rows theirs from 1: the only known length was lost."""
    robot, data = touched("ur10", "socket", 1, count=12)
    assert data.fixture.distances and not unused_distances(robot.nominal, data)
    seats = data.contacts["socket"]
    one_on = replace(data, contacts={**data.contacts, "socket": np.where(seats >= 0, seats + 1, seats)})
    assert any("name socket 0, 1, the rows touch 1, 2: is one numbered from 0" in line
               for line in first_aid(robot.nominal, one_on))
    faces = replace(data, contacts={"plane": seats})
    (line,) = unused_distances(robot.nominal, faces)
    assert line.words.startswith("the fixture's distances are those of socket, the rows touch plane")
    some = data.select(seats != 1)  # a part of the rows, in which nothing is numbered otherwise
    assert not unused_distances(robot.nominal, some)
