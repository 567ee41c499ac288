"""Robot files: exact round trip, and one line that names the key for everything that is wrong."""

import dataclasses

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from exactarm.effects import effect_from_table
from exactarm.errors import InputError
from exactarm.robot.keys import JOINT_KEYS
from exactarm.robot.robot import Controller, GearTable, Joint, Link, Placement, Robot, frame_of
from exactarm.robot_file import load_robot, read_robot, shipped_robots, write_robot

numbers = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(1e-12, 1e12)
many = settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def same(left, right) -> bool:
    """Equal to the last bit, arrays and nested dataclasses included."""
    if dataclasses.is_dataclass(left):
        names = [item.name for item in dataclasses.fields(left) if item.compare]
        return type(left) is type(right) and all(same(getattr(left, n), getattr(right, n)) for n in names)
    if isinstance(left, np.ndarray):
        return left.shape == right.shape and left.tobytes() == right.tobytes()
    if isinstance(left, (list, tuple)):
        return len(left) == len(right) and all(map(same, left, right))
    if isinstance(left, float):
        return isinstance(right, float) and left.hex() == right.hex()
    return left == right


# What a robot file takes: what is larger are degrees, or another unit of gravity.
frame_angles = st.floats(-12.5, 12.5)
triples = st.lists(st.floats(-14.0, 14.0), min_size=3, max_size=3).map(np.array)
gravities = st.just(np.zeros(3)) | triples.filter(lambda gravity: 1.5 < np.linalg.norm(gravity) < 25.0)


def arrays(count: int):
    return st.lists(numbers, min_size=count, max_size=count).map(np.array)


@st.composite
def gear_tables(draw) -> GearTable:
    count = draw(st.integers(0, 4))
    return GearTable(*(draw(arrays(count)).astype(float) for _ in range(3)))


@st.composite
def joints(draw) -> Joint:
    fields = {"type": draw(st.sampled_from(["revolute", "prismatic"])),
              "sign": draw(st.sampled_from([1.0, -1.0]))}
    for name in ("d", "a", "q_offset", "spring_cubic"):
        fields[name] = draw(numbers)
    for name in ("zero", "alpha"):
        fields[name] = draw(frame_angles)
    fields["ratio"] = draw(st.none() | positive | positive.map(lambda value: -value))
    for name in ("spring_linear", "rotor_inertia", "coulomb", "viscous", "q_ddot_max", "torque_max"):
        fields[name] = draw(st.none() | positive)
    fields["q_dot_max"] = draw(st.none() | positive.map(lambda value: min(value, 100.0)))
    fields["controller_offset"] = draw(st.none() | numbers)
    if draw(st.booleans()):
        fields["q_min"], fields["q_max"] = -min(draw(positive), 80.0), min(draw(positive), 80.0)
    if draw(st.booleans()):
        fields["beta"], fields["d"] = draw(frame_angles), 0.0
    if fields["ratio"] is not None:
        fields |= {"controller_ratio": draw(st.none() | positive), "cw": draw(st.none() | gear_tables())}
        fields["ccw"] = draw(st.none() | gear_tables())
    return Joint(**fields)


@st.composite
def links(draw) -> Link:
    half = draw(arrays(9)).reshape(3, 3) / 4
    return Link(draw(positive), draw(arrays(3)), half + half.T)


@st.composite
def robots(draw) -> Robot:
    axes = draw(st.lists(joints(), min_size=1, max_size=4))
    seed = draw(st.integers(0, 2**31))
    place = lambda k: Placement(Rotation.random(random_state=seed + k).as_matrix(), draw(arrays(3)))
    text = st.text(st.characters(codec="utf-8"), max_size=12)
    record = st.dictionaries(text, text | st.booleans() | st.integers(-(2**60), 2**60) | numbers
                             | st.lists(text), max_size=3)
    return Robot(
        draw(text),
        tuple(axes),
        draw(st.none() | st.lists(links(), min_size=len(axes), max_size=len(axes)).map(tuple)),
        draw(gravities),
        place(0),
        place(1),
        draw(st.booleans()),
        (),
        draw(st.dictionaries(text, st.tuples(numbers, numbers).map(sorted).map(tuple), max_size=3)),
        draw(record),
        draw(controllers(axes, place)),
    )


@st.composite
def controllers(draw, axes, place) -> Controller:
    count = len(axes)
    frames = [dataclasses.replace(draw(joints()), type=axis.type) for axis in axes]
    names = st.lists(st.text(st.characters(codec="utf-8"), max_size=5), min_size=count, max_size=count,
                     unique=True)
    coupling = st.lists(st.tuples(st.integers(1, count), st.integers(1, count), numbers),
                        max_size=2).map(tuple)
    return Controller(
        tuple(map(frame_of, frames)) if draw(st.booleans()) else (),
        place(2),
        place(3),
        draw(st.sampled_from(["nominal", "calibrated"])),
        draw(st.booleans()),
        draw(st.none() | coupling),
        tuple(draw(st.just(()) | st.lists(positive, min_size=count, max_size=count).map(tuple))),
        tuple(draw(st.just(()) | names.map(tuple))),
    )


@pytest.mark.slow
@many
@given(robot=robots())
def test_writing_and_reading_keeps_every_bit(tmp_path, robot):
    write_robot(tmp_path / "robot.toml", robot)
    assert same(read_robot(tmp_path / "robot.toml"), robot)


EFFECTS = [
    {"effect": "joint_compliance", "joint": 2, "linear_rad_per_Nm": 1 / 3e5, "cubic_rad_per_Nm3": 1e-13 / 3},
    {"effect": "backlash", "joint": 1, "width_rad": 4e-4 / 3, "friction_Nm": 10.0},
    {"effect": "payload", "mass_kg": 5 / 3, "moment_x_kg_m": 0.1, "moment_y_kg_m": -0.2,
     "moment_z_kg_m": 0.3},
    {"effect": "thermal_drift", "growth_1_per_degC": 1.2e-5, "form": "growth", "driver": "temperature_degC"},
]


@pytest.mark.parametrize("table", EFFECTS, ids=lambda table: table["effect"])
def test_effects_come_back(tmp_path, table):
    effect = effect_from_table(table)
    write_robot(tmp_path / "robot.toml", Robot("two", (Joint(), Joint()), effects=(effect,)))
    back = read_robot(tmp_path / "robot.toml").effects
    assert same(back, (effect,)) and back[0].to_table() == table


def test_degrees_and_millimetres_by_hand(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text('name = "r"\n[[joints]]\nalpha_deg = -90\nd_mm = 127.3\nq_max_deg = 10\nq_dot_max_deg_s '
                    '= 180.0\n')
    joint = load_robot(path).joints[0]
    np.testing.assert_allclose([joint.alpha, joint.d, joint.q_max], [-np.pi / 2, 0.1273, np.pi / 18],
                               rtol=1e-15)
    np.testing.assert_allclose(joint.q_dot_max, np.pi, rtol=1e-15)


VALID = """\
name = "r"
[tool]
position_m = [0.0, 0.0, 0.1]
[[joints]]
alpha_rad = 0.5
ratio = 100.0
[joints.gear_cw]
order_per_output_rev = [1.0]
a = [0.0]
b = [0.0]
[[links]]
mass_kg = 1.0
centre_of_mass_m = [0.0, 0.0, 0.0]
inertia_kg_m2 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
[intervals]
d_1_m = [0.1, 0.2]
"""


def test_the_sample_is_valid(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text(VALID)
    assert read_robot(path).intervals == {"d_1_m": (0.1, 0.2)}


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('name = "r"', "", ["key name", "is missing"]),
        ('name = "r"', "name = 3", ["key name", "expected a name"]),
        ('name = "r"', 'name = "r"\nmass = 1', ["key mass", "not known"]),
        ('name = "r"', 'name = "r"\nformat = 2', ["key format", "expected 1"]),
        ('name = "r"', 'name = "r"\ngravity_m_s2 = [0, 0]', ["key gravity_m_s2", "three numbers"]),
        ('name = "r"', 'name = "r', ["no valid TOML", "line 1"]),
        ("[[joints]]", "[joints]", ["key joints", "[[joints]]"]),
        ("alpha_rad = 0.5", "alpha_rad = '0.5'", ["joints[1].alpha_rad", "expected a number"]),
        ("alpha_rad = 0.5", "alpha_rad = nan", ["joints[1].alpha_rad", "expected a number"]),
        ("alpha_rad = 0.5", "alpha_rad = true", ["joints[1].alpha_rad", "expected a number"]),
        ("alpha_rad = 0.5", "alpha = 0.5", ["joints[1].alpha:", "expected alpha_rad"]),
        ("alpha_rad = 0.5", "alpha_rad = 0.5\nalpha_deg = 3", ["joints[1].alpha_deg", "one of the two"]),
        ("alpha_rad = 0.5", "sign = 2", ["joints[1].sign", "1 or -1"]),
        ("alpha_rad = 0.5", "q_min_rad = 2\nq_max_rad = 1", ["joints[1].q_max_rad", "more than 2"]),
        ("alpha_rad = 0.5", 'type = "ball"', ["joints[1].type", "revolute"]),
        ("alpha_rad = 0.5", "coulomb_Nm = -1", ["joints[1].coulomb_Nm", "0 or above"]),
        ("alpha_rad = 0.5", "spring_linear_Nm_rad = 0", ["joints[1].spring_linear_Nm_rad", "above 0"]),
        ("ratio = 100.0", "ratio = 0.0", ["joints[1].ratio", "other than 0"]),
        ("ratio = 100.0", "", ["joints[1].ratio", "is missing"]),
        ("a = [0.0]", "a = [0.0, 1.0]", ["joints[1].gear_cw.a", "expected 1"]),
        ("a = [0.0]", "", ["joints[1].gear_cw.a", "is missing"]),
        ("position_m = [0.0, 0.0, 0.1]", "rotation = [[1,0,0],[0,1,0],[0,0,2]]",
         ["tool.rotation", "orthonormal"]),
        ("position_m = [0.0, 0.0, 0.1]", "rotation = [[1,0,0],[0,1,0],[0,0,-1]]",
         ["tool.rotation", "right-handed"]),
        ("mass_kg = 1.0", "", ["links[1].mass_kg", "expected a number"]),
        ("mass_kg = 1.0", "mass_kg = -1", ["links[1].mass_kg", "0 or above"]),
        ("[[1.0, 0.0, 0.0], ", "[[1.0, 0.5, 0.0], ", ["links[1].inertia_kg_m2", "symmetric"]),
        ("[intervals]", "[[links]]\nmass_kg = 1\n[intervals]", ["key links", "2 links; expected 1"]),
        ("d_1_m = [0.1, 0.2]", "d_1_m = [0.2, 0.1]", ["intervals.d_1_m", "low before high"]),
        ("d_1_m = [0.1, 0.2]", "d_1_m = 0.2", ["intervals.d_1_m", "[low, high]"]),
        ("[intervals]", '[[effects]]\neffect = "magic"\n[intervals]',
         ["effects[1].effect", "no effect named"]),
        ("[intervals]", "[[effects]]\njoint = 1\n[intervals]", ["effects[1].effect", "is missing"]),
    ],
)
def test_what_is_wrong_is_refused_by_its_key(tmp_path, old, new, words):
    path = tmp_path / "robot.toml"
    assert old in VALID
    path.write_text(VALID.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        read_robot(path)
    message = str(caught.value)
    assert "\n" not in message and str(path) in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("table", EFFECTS, ids=lambda table: table["effect"])
def test_a_faulty_effect_is_refused(tmp_path, table):
    path = tmp_path / "robot.toml"
    write_robot(path, Robot("two", (Joint(), Joint()), effects=(effect_from_table(table),)))
    text = path.read_text()
    key = next(name for name, value in table.items() if isinstance(value, float))
    line = f"{key} = {table[key]!r}"
    faults = [(line, f"{key}x = 0.5", key), (line, f'{key} = "much"', "does not fit"),
              (line, f"{line}\nother = 1", "other")]
    faults += [(line, f"{key} = nan", rf"{key}: nan; expected a finite number")]
    if "joint" in table:
        joint = f"joint = {table['joint']}"
        faults += [(joint, "", "joint: is missing"),
                   (joint, "joint = 3", "joint: 3; expected an axis from 1 to 2")]
    else:
        faults += [(line, f"joint = 1\n{line}", "of no single axis")]
    for old, new, word in faults:
        assert old in text
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError, match=word):
            read_robot(path)


def test_a_killed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "robot.toml"
    write_robot(path, Robot("old", (Joint(),)))
    with pytest.raises(AttributeError):
        write_robot(path, Robot("new", (None,)))
    assert read_robot(path).name == "old" and [file.name for file in tmp_path.iterdir()] == ["robot.toml"]


def test_unknown_names_are_answered_with_the_known_ones(tmp_path):
    with pytest.raises(InputError) as caught:
        load_robot("racer")
    for name in shipped_robots():
        assert name in str(caught.value)
    assert "did you mean racer-7-1.4?" in str(caught.value)
    with pytest.raises(InputError, match="no such file"):
        load_robot(tmp_path / "none.toml")
    with pytest.raises(InputError, match="cannot be read"):
        load_robot(tmp_path)


def test_every_number_of_a_joint_has_a_key():
    told = {key.field for key in JOINT_KEYS} | {"type", "cw", "ccw"}
    assert told == {item.name for item in dataclasses.fields(Joint)}


def test_each_form_of_an_effect_says_whether_it_has_an_axis(tmp_path):
    """A drift of one axis' zero is read back as it was written; a drift of the whole arm takes no axis."""
    robot = load_robot("ur10")
    zero = effect_from_table({"effect": "thermal_drift", "form": "zero", "driver": "time", "joint": 2,
                              "zero_rad_per_h": 1e-5})
    write_robot(tmp_path / "zero.toml", dataclasses.replace(robot, effects=(zero,)))
    assert load_robot(str(tmp_path / "zero.toml")).effects == (zero,)
    growth = 'effect = "thermal_drift"\nform = "growth"\ndriver = "time"\njoint = 2\ngrowth_1_per_h = 1e-5\n'
    text = (tmp_path / "zero.toml").read_text()
    (tmp_path / "growth.toml").write_text(text[: text.index("[[effects]]")] + "[[effects]]\n" + growth)
    with pytest.raises(InputError, match="joint: 2; expected none"):
        load_robot(str(tmp_path / "growth.toml"))
