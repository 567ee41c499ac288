"""Xacro files patched in place: the elements of the joints that stand in the file, or a refusal by line."""

import re

import numpy as np
import pytest

from exactarm.errors import InputError
from exactarm.export.urdf import patched_urdf
from exactarm.export.xacro_source import expanded
from exactarm.robot.urdf import read_urdf
from test_export import deviated, flange, random_q
from urdf_sample import random_urdf

HEAD = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="sample">'
PLAIN = random_urdf(np.random.default_rng(7), "frrrrrrf").replace('<robot name="sample">', HEAD)


def written(folder, text, name="arm.urdf.xacro"):
    (folder / name).write_text(text)
    return folder / name


def with_property(text):
    """The first number of every origin of joint_3 comes from a property."""
    match = re.search(r'name="joint_3".*?<origin xyz="(\S+) ', text, re.S)
    text = text[: match.start(1)] + "${arm_length / 2}" + text[match.end(1) :]
    value = f'<xacro:property name="arm_length" value="{2.0 * float(match[1])!r}"/>'
    return text.replace(HEAD, f"{HEAD}\n<!-- arm -->\n{value}")


def in_macro(text, calls='<xacro:arm prefix="left_"/>'):
    """All links and joints in a macro with a prefix."""
    inner = text[text.index(HEAD) + len(HEAD) : text.rindex("</robot>")]
    inner = re.sub(r'"(joint_|link_)', r'"${prefix}\1', inner)
    return f'{HEAD}\n<xacro:macro name="arm" params="prefix">{inner}</xacro:macro>\n{calls}\n</robot>\n'


def robot_of(folder, path):
    content = expanded(path, path.read_bytes())
    return read_urdf(written(folder, content.decode(), "expanded.urdf"))


@pytest.mark.parametrize("make", [with_property, in_macro, lambda text: in_macro(with_property(text))])
def test_a_xacro_is_patched_in_place(tmp_path, make):
    text = make(PLAIN)
    if "arm_length" in text and "macro" in text:  # the property belongs into the file, not into the macro
        line = re.search(r"<xacro:property[^>]*>", text)[0]
        text = text.replace(line, "").replace(HEAD, HEAD + line)
    source = written(tmp_path, text)
    robot = deviated(robot_of(tmp_path, source))
    new = patched_urdf(robot, str(source))
    numbers = re.compile(rb'(xyz|rpy)="[^"]*"')
    assert numbers.sub(b"", new) == numbers.sub(b"", source.read_bytes()) and new != source.read_bytes()
    again = robot_of(tmp_path, written(tmp_path, new.decode(), "new.urdf.xacro"))
    q = random_q(robot)
    (here, turn), (there, turned) = flange(robot, q), flange(again, q)
    assert np.abs(here - there).max() < 1e-9 and np.abs(turn - turned).max() < 1e-9


def refused(tmp_path, text, robot=None, ends=""):
    source = written(tmp_path, text)
    with pytest.raises(InputError) as error:
        patched_urdf(robot, f"{source}{ends}")
    assert "\n" not in str(error.value)
    return str(error.value)


def line_of(text, words):
    return text[: text.index(words)].count("\n") + 1


def test_a_macro_that_stands_for_two_arms_is_refused_by_line(tmp_path):
    robot = deviated(read_urdf(written(tmp_path, PLAIN, "plain.urdf")))
    fixed = ('<link name="world"/><joint name="l" type="fixed"><parent link="world"/><child '
             'link="left_link_0"/></joint><joint name="r" type="fixed"><parent link="world"/>'
             '<child link="right_link_0"/></joint>')
    text = in_macro(PLAIN, f'<xacro:arm prefix="left_"/><xacro:arm prefix="right_"/>{fixed}')
    error = refused(tmp_path, text, robot, "#left_link_0:left_link_8")
    line = line_of(text, 'name="${prefix}joint_')
    assert "this element stands for" in error and re.search(r"line (\d+)", error)
    assert line <= int(re.search(r"line (\d+)", error)[1]) <= line + 40


def test_what_is_not_in_the_file_is_refused_by_line(tmp_path):
    robot = deviated(read_urdf(written(tmp_path, PLAIN, "plain.urdf")))
    written(tmp_path, in_macro(PLAIN, ""), "arm.xacro")
    text = f'{HEAD}\n\n<xacro:include filename="arm.xacro"/>\n<xacro:arm prefix="a_"/></robot>'
    error = refused(tmp_path, text, robot)
    line = line_of((tmp_path / "arm.xacro").read_text(), '<joint name="${prefix}joint_2"')
    assert f"line 3: joint a_joint_2 is not written in this file but in arm.xacro line {line}" in error
    # what it says to do does it
    urdf = tmp_path / "robot.urdf"
    urdf.write_bytes(expanded(tmp_path / "arm.urdf.xacro", text.encode()))
    assert "xacro arm.urdf.xacro > robot.urdf, then --source robot.urdf" in error
    new = read_urdf(written(tmp_path, patched_urdf(robot, str(urdf)).decode(), "new.urdf"))
    q = random_q(robot)
    assert np.abs(flange(robot, q)[0] - flange(new, q)[0]).max() < 1e-9
    origin = re.search(r'(name="joint_4".*?)(<origin[^>]*/>)', PLAIN, re.S)
    text = PLAIN[: origin.start(2)] + '\n<xacro:insert_block name="there"/>' + PLAIN[origin.end(2) :]
    text = text.replace(HEAD, f'{HEAD}\n<xacro:property name="there">{origin[2]}</xacro:property>')
    error = refused(tmp_path, text, robot)
    assert f"line {line_of(text, '<xacro:insert_block')}: joint joint_4 holds <xacro:insert_block>" in error
    text = PLAIN.replace(HEAD, HEAD + "\n").replace('rpy="', 'rpy="${nothing} ', 1)
    assert "line " in refused(tmp_path, text, robot) and "nothing" in refused(tmp_path, text, robot)
