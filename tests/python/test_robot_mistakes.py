"""Robot files in wrong units: refused by their key, or told as a contradiction by every command."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm import cli
from exactarm.errors import InputError
from exactarm.first_aid.first_aid import first_aid
from exactarm.first_aid.robot_mistakes import robot_mistakes
from exactarm.robot.robot import Robot
from exactarm.robot.urdf import read_urdf, urdf_text
from exactarm.robot.writer import robot_text
from exactarm.robot_file import load_robot, shipped_robots


@pytest.fixture(scope="module")
def racer() -> Robot:
    return load_robot("racer-7-1.4")


def every_joint(robot: Robot, field: str, factor: float) -> Robot:
    return replace(robot, joints=tuple(
        replace(joint, **{field: factor * value}) if (value := getattr(joint, field)) else joint
        for joint in robot.joints))


def grams(robot: Robot) -> Robot:
    return replace(robot, links=tuple(replace(link, mass=1e3 * link.mass) for link in robot.links))


def millimetres(robot: Robot) -> Robot:
    return replace(robot, links=tuple(replace(link, centre_of_mass=1e3 * np.asarray(link.centre_of_mass))
                                      for link in robot.links))


WRONG = {
    "masses in g": (grams, "to hold the links that the robot file declares"),
    "centres of mass in mm": (millimetres, "to hold the links that the robot file declares"),
    "torques in kNm": (lambda r: every_joint(r, "torque_max", 1e-3), "to hold the links"),
    "springs in kNm": (lambda r: every_joint(r, "spring_linear", 1e-3), "the spring of axis 2 gives way by"),
    "rotors in kg cm2": (lambda r: every_joint(r, "rotor_inertia", 1e4), "the rotor of axis 4 alone needs"),
}


@pytest.mark.parametrize("name", WRONG)
def test_values_that_contradict_each_other_are_told(racer, name):
    change, words = WRONG[name]
    assert any(words in line for line in robot_mistakes(change(racer)))


def test_shipped_robots_and_their_changes_are_not_suspected(racer):
    assert {name: robot_mistakes(load_robot(name)) for name in shipped_robots()} == dict.fromkeys(
        shipped_robots(), ())
    heavier = replace(racer, links=tuple(replace(link, mass=2.0 * link.mass) for link in racer.links))
    assert robot_mistakes(heavier) == ()


def test_every_command_with_a_robot_says_so_once(racer, tmp_path):
    wrong = every_joint(racer, "spring_linear", 1e-3)
    told = [line for line in ea.simulate(wrong, count=8)["warnings"] if "gives way" in line]
    (tmp_path / "robot.toml").write_text(robot_text(wrong))
    words = ["plan", str(tmp_path / "robot.toml"), "line", "--rate", "20", "--out", str(tmp_path / "out")]
    assert cli.main([*words, "--quiet"]) == 0
    planned = (tmp_path / "out/result.json").read_text().count("gives way")
    assert (len(told), planned) == (1, 1)


@pytest.mark.parametrize("before, after, words", [
    ("alpha_rad = 1.57", "alpha_rad = 90", "alpha_rad: 90; expected a number of at most 12.6 rad"),
    ("alpha_rad = 1.57", "zero_rad = -180", "zero_rad: -180; expected a number of at most 12.6 rad"),
    ("q_min_rad = -3.0", "q_min_rad = -165", "q_min_rad: -165; expected a number of at most 81 rad"),
    ("q_dot_max_rad_s = 3.8", "q_dot_max_rad_s = 220", "220; expected a number above 0, at most 100 rad/s"),
    ("gravity_m_s2 = [0, 0, -9.81]", "gravity_m_s2 = [0, 0, -9810]", "9810 m/s²; expected about 9.81"),
    ("gravity_m_s2 = [0, 0, -9.81]", "gravity_m_s2 = [0, 0, -1]", "1 m/s²; expected about 9.81"),
])
def test_degrees_as_radians_and_gravity_in_other_units_are_refused(before, after, words, tmp_path):
    content = ('name = "r"\ngravity_m_s2 = [0, 0, -9.81]\n[[joints]]\nalpha_rad = 1.57\nq_min_rad = -3.0\n'
               "q_max_rad = 3.0\nq_dot_max_rad_s = 3.8\n")
    path = tmp_path / "robot.toml"
    path.write_text(content)
    assert load_robot(path).axes == 1
    path.write_text(content.replace(before, after))
    with pytest.raises(InputError) as error:
        load_robot(path)
    assert str(error.value).startswith(f"{path}: ") and words in str(error.value)


def test_no_gravity_and_a_sliding_axis_have_no_such_bounds(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text('name = "r"\ngravity_m_s2 = [0, 0, 0]\n[[joints]]\ntype = "prismatic"\nq_min_m = -60\n'
                    "q_max_m = 60\nq_dot_max_m_s = 120\n")
    assert load_robot(path).joints[0].q_max == 60.0


def test_limits_of_a_urdf_that_stand_for_none_are_none(tmp_path):
    path = tmp_path / "robot.urdf"
    text = urdf_text(load_robot("ur10"))
    joint = load_robot("ur10").joints[0]
    assert f'lower="{joint.q_min!r}"' in text and f'velocity="{joint.q_dot_max!r}"' in text
    path.write_text(text.replace(f'lower="{joint.q_min!r}"', 'lower="-1e16"', 1)
                    .replace(f'velocity="{joint.q_dot_max!r}"', 'velocity="1000"', 1))
    read = read_urdf(path).joints
    assert (read[0].q_min, read[0].q_max, read[0].q_dot_max) == (None, None, None)
    assert read[1].q_min == pytest.approx(joint.q_min)


def test_no_gravity_beside_a_motion_that_shows_one_is_told():
    robot, data = load_robot("tx40"), ea.read(ea.example("tx40/motion"), "tx40")
    (line,) = first_aid(replace(robot, gravity=np.zeros(3)), data)
    assert line.startswith("with gravity along -z of the base")
