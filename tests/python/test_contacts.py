"""Contacts and fixtures: derivatives, known lengths, what a file may hold."""

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout
from exactarm.data.columns import CONTACTS
from exactarm.data.dataset import NO_CONTACT, Dataset, read_dataset
from exactarm.data.fixture import Distance, Fixture, Radius, load_fixture
from exactarm.errors import InputError
from exactarm.identify.declared import geometry_layout
from exactarm.measurement.closures import cleared_of_pairs, device_of, predict_closures, touches
from exactarm.measurement.contacts import TOUCHED, Bar, Plane, Socket, Sphere
from exactarm.measurement.known_lengths import known_lengths
from exactarm.measurement.target import Target
from spoiled_rows import HEADER, PANDA, POSE, assert_refused

RANDOM = np.random.default_rng(1)


def contacts():
    q = np.linalg.qr(RANDOM.normal(size=(3, 3)))[0]
    frame = ((0.4, 0.1, 0.2), *(tuple(float(x) for x in row) for row in q))
    return (
        Socket(None, (0.5, 0.1, 0.2), 1, 0), Socket(None, (0.5, 0.15, 0.2), 1, 1),
        Plane(None, (0.1, -0.2, 0.01), 1, 0, reference=frame),
        Plane(None, (0.08, -0.2, 0.06), 1, 1, reference=frame),
        Sphere(None, (0.3, 0.2, 0.1, 0.02), 1, 0), Bar(None, (0.1, 0.6, 0.2, 0.01), 1, 0),
        Target(None, (0.01, 0.02, 0.1), (1,)),
    )


def rows_of_every_contact(each: int = 3) -> Dataset:
    """Rows that touch each of `contacts`, a pair, and rows of a tracker."""
    touched = [("socket", 0), ("socket", 1), ("plane", 0), ("plane", 1), ("sphere", 0), ("bar", 0),
               ("pair", 0), ("pair", 1)]
    count = each * len(touched)
    columns = {name: np.full(count, NO_CONTACT) for name in CONTACTS}
    for place, (name, number) in enumerate(touched):
        columns[name][each * place : each * (place + 1)] = number
    q = RANDOM.uniform(-1.2, 1.2, (count, 7))
    return Dataset.of_arrays("closures", {"q": q}, contacts=columns, length=np.full(count, 0.4))


@pytest.mark.slow
def test_derivatives_by_every_parameter_agree_with_differences():
    layout = Layout.of(contacts()).joined(geometry_layout(PANDA))
    data = rows_of_every_contact()
    prediction = predict_closures(PANDA, layout, data)
    at = lambda x: predict_closures(PANDA, layout.at(x), data, tangents=False).residual[:, :3]
    assert_derivative(at, layout.values, -prediction.jacobian[:, :3], 1e-4, relative=1e-6)


def test_response_to_a_displacement_of_the_target_is_that_of_its_tool():
    """The tool point's own columns, taken through `through`, are those of the Jacobian."""
    layout, data = Layout.of(contacts()), rows_of_every_contact()
    prediction = predict_closures(PANDA, layout, data)
    tool = layout.names.index("session_1.tool_x_m")
    columns = prediction.view.target_by("tool")[:, :, :3]
    np.testing.assert_allclose(prediction.through(columns)[:, :3],
                               prediction.jacobian[:, :3, tool : tool + 3], atol=1e-12)


def test_known_lengths_and_their_derivatives():
    layout = Layout.of(contacts())
    fixture = Fixture(
        (Distance("socket", (0, 1), 0.05), Distance("plane", (0, 1), 0.02), Distance("socket", (0, 7), 1.0)),
        (Radius("sphere", 0, 0.02), Radius("ball", None, 0.003)),
    )
    known = known_lengths(layout, fixture)
    assert [k.name.split(" of ")[0] for k in known] == ["socket 0 to 1", "plane 0 to 1", "radius"]
    np.testing.assert_allclose(known[0].residual, 0.0, atol=1e-15)
    np.testing.assert_allclose(known[2].residual, 0.003, atol=1e-15)
    at = lambda x: np.array([k.residual for k in known_lengths(layout.at(x), fixture)])
    assert_derivative(at, layout.values, -np.stack([k.row for k in known]), 1e-5, relative=1e-6)


def test_the_width_between_two_faces_is_that_of_the_tip_centres_less_two_radii():
    frame = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    layout = Layout.of((Plane(None, (0.0, 0.0, 0.0), 1, 0, reference=frame),
                        Plane(None, (0.0, 0.0, 0.056), 1, 1, reference=frame)))
    fixture = Fixture((Distance("plane", (0, 1), 0.05),), (Radius("ball", None, 0.003),))
    assert abs(known_lengths(layout, fixture)[0].residual) < 1e-15


@pytest.mark.parametrize("cls", TOUCHED.values())
def test_a_contact_starts_where_it_was_touched(cls):
    direction = RANDOM.normal(size=(60, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    centre, normal = np.array([0.3, 0.1, 0.2]), np.array([0.6, 0.0, 0.8])
    flat = direction - np.outer(direction @ normal, normal)
    points = {"socket": np.tile(centre, (60, 1)),
              "plane": centre + flat}.get(cls.contact, centre + 0.2 * direction)
    found = cls(None, (), 1, 0).start(points, None)
    np.testing.assert_allclose(found.touch(points)[0], 0.0, atol=1e-12)


def test_a_face_counted_anew_is_the_same_and_turns_by_its_tilts_again():
    turned = Plane(None, (40.0, -25.0, 0.03), 1, 0, reference=contacts()[2].reference)
    anew, points = turned.counted_anew(), RANDOM.normal(size=(5, 3))
    assert anew.values == (0.0, 0.0, 0.03)
    np.testing.assert_allclose(anew.touch(points)[0], turned.touch(points)[0], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(anew.normal[1], axis=0), 1.0)
    assert np.linalg.norm(turned.normal[1], axis=0).max() < 0.05


def test_the_mean_of_a_pair_is_taken_off():
    values = RANDOM.normal(size=(5, 2))
    cleared = cleared_of_pairs(values, np.array([0, NO_CONTACT, 0, 1, 1]))
    np.testing.assert_array_equal(cleared[1], values[1])
    np.testing.assert_allclose(cleared[[0, 2]].sum(axis=0), 0.0, atol=1e-15)
    np.testing.assert_allclose(cleared[3] - cleared[4], values[3] - values[4], atol=1e-15)




def written(path, text: str):
    path.write_text(text)
    return path


def test_a_row_may_touch_several_contacts_and_carry_a_tracker_reading(tmp_path):
    file = written(tmp_path / "mixed.csv", f"socket,plane,x_mm,y_mm,z_mm,{HEADER}\n"
                   f"0,,,,,{POSE}\n-1,2,500,0,300,{POSE}\n,,501,0,300,{POSE}\n1,3,,,,{POSE}\n")
    data = read_dataset(file, PANDA)
    assert data.kind == "closures"
    rows = touches(data)
    assert list(zip(rows.row, device_of(rows))) == [
        (1, "socket"), (2, "plane"), (2, "tracker"), (3, "tracker"), (4, "socket"), (4, "plane")]
    assert list(device_of(touches(rows))) == list(device_of(rows))
    np.testing.assert_allclose(rows.position[2], [0.5, 0.0, 0.3])


def test_a_tracker_file_and_a_file_of_planes_are_one_data_set(tmp_path):
    planes = written(tmp_path / "planes.csv", f"session,plane,{HEADER}\n1,0,{POSE}\n")
    tracked = written(tmp_path / "tracked.csv", f"session,x_m,y_m,z_m,{HEADER}\n2,0.5,0,0.3,{POSE}\n")
    for files in ([planes, tracked], [tracked, planes]):
        data = read_dataset(files, PANDA)
        assert data.kind == "closures" and sorted(device_of(touches(data))) == ["plane", "tracker"]


@pytest.mark.parametrize(("text", "words"), [
    (f"socket,{HEADER}\n0.5,{POSE}\n", "a whole number from 0, or -1"),
    (f"socket,{HEADER}\n-2,{POSE}\n", "a whole number from 0, or -1"),
    (f"socket,{HEADER}\n0,{POSE}\n,{POSE}\n", "row 2, column socket: neither a contact nor x, y, z"),
    (f"session,{HEADER}\n,{POSE}\n", "empty cell; expected a number"),
])
def test_wrong_contacts_are_refused(tmp_path, text, words):
    assert_refused(tmp_path / "wrong.csv", text, words)


def test_an_empty_cell_of_another_column_is_still_a_fault(tmp_path):
    file = written(tmp_path / "gap.csv", f"socket,{HEADER}\n0,,{POSE[4:]}\n")
    with pytest.raises(InputError, match="row 1, column q_1_rad: empty cell"):
        read_dataset(file, PANDA)


def test_a_fixture_file_is_read(tmp_path):
    text = '''
[[distances]]
contact = "plane"
between = [0, 1]
length_mm = 100.0
sigma_mm = 0.002
session = 3
[[radii]]
contact = "ball"
radius_mm = 6.35
[[bars]]
number = 2
zero = "free"
'''
    fixture = load_fixture(written(tmp_path / "fixture.toml", text))
    assert fixture.distances == (Distance("plane", (0, 1), 0.1, 2e-6, 3),)
    assert fixture.radius_of("ball", None, 9).length == pytest.approx(6.35e-3)
    assert fixture.radius_of("sphere", 0, 1) is None and fixture.free_bars == {2}


@pytest.mark.parametrize(("text", "words"), [
    ('[[distances]]\ncontact = "pair"\nbetween = [0, 1]\nlength_mm = 5',
     "contact = 'pair'; expected one of socket"),
    ('[[distances]]\ncontact = "socket"\nbetween = [0, 0]\nlength_mm = 5', "two different numbers"),
    ('[[distances]]\ncontact = "socket"\nbetween = [0, 1]', "length_mm missing"),
    ('[[distances]]\ncontact = "socket"\nbetween = [0, 1]\nlength_mm = -5', "a length above 0"),
    ('[[radii]]\ncontact = "sphere"\nradius_mm = 5', "number missing"),
    ('[[balls]]\nradius_mm = 5', "unknown table"),
    ('distances = 3', "no list of tables"),
])
def test_wrong_fixtures_are_refused(tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        load_fixture(written(tmp_path / "fixture.toml", text))
