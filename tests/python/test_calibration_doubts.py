"""What a calibration says of files that contradict each other, of coarse readings and of a length far from
the robot file's."""

from dataclasses import replace

import numpy as np
import pytest

import exactarm as ea
from exactarm.commands.next_steps import HEADING
from exactarm.data.dataset import read_dataset
from exactarm.errors import InputError
from exactarm.files.examples import data_path
from exactarm.identify.calibration_doubts import (
    FAR_FROM_DRAWING,
    FAR_ZERO_RAD,
    contradicting,
    far_from_drawing,
)
from exactarm.identify.closures import calibrate_closures
from exactarm.robot_file import load_robot
from test_closures import touched


@pytest.fixture(scope="module")
def ur10():
    robot = load_robot("ur10")
    data = read_dataset(data_path("ur10/series_B.csv"), robot)
    return robot, data.select(np.arange(0, len(data), 10))


def on_grid(values, step):
    return np.round(values / step) * step


def told(robot, data):
    return [line for line in ea.calibrate(robot, data).warnings
            if "rounded to" in line or "comes out" in line]


@pytest.mark.slow
def test_rounded_readings_are_told_with_their_step(ur10):
    robot, data = ur10
    assert told(robot, data) == []
    (line,) = told(robot, replace(data, position=on_grid(data.position, 0.01)))
    assert line.startswith("x, y, z are rounded to 10 mm, which alone leaves 4.1 of the ")  # z: few planes
    half = np.radians(0.5)
    (line,) = told(robot, replace(data, joints=data.joints | {"q": on_grid(data.joints["q"], half)}))
    assert line.startswith("joint angles are rounded to 0.5 degrees, which alone leaves ")


@pytest.mark.slow
def test_touches_that_leave_more_than_arms_miss_by_are_told():
    """A motor that also turns the next axis, of which the robot file does not know: it passed without a
    word. The seed is the first tried."""
    robot, data = touched("ur10", "socket", 3, count=20)
    lines = lambda data: [w for w in ea.calibrate(robot.nominal, data).warnings if "(RMS) are left" in w]
    assert lines(data) == []
    angles = data.joints["theta"]
    coupled = angles.copy()
    coupled[:, 2] += 0.03 * angles[:, 1]
    (line,) = lines(replace(data, joints=data.joints | {"theta": coupled}))
    assert "does the robot file lack a coupling of its motors" in line


@pytest.mark.slow
def test_angles_that_were_commanded_on_a_grid_are_not_rounded(ur10):
    """Positions that follow them are those of the grid."""
    robot, data = ur10
    grid = on_grid(data.joints["q"], np.radians(1.0))
    noise = np.random.default_rng(3).normal(0.0, 3e-4, data.position.shape)
    assert told(robot, replace(data, joints={"q": grid}, position=robot.fk(grid).position + noise,
                               rotation=None)) == []


@pytest.mark.slow
def test_a_length_with_two_digits_exchanged_is_told(ur10):
    robot, data = ur10
    joints = list(robot.joints)
    joints[2] = replace(joints[2], a=-0.5273)  # for -0.5723
    assert told(robot, data) == []
    (line,) = told(replace(robot, joints=tuple(joints)), data)
    assert line.startswith("a_3 comes out 4") and "from the -527.3 mm of the robot file" in line


@pytest.mark.parametrize("share, count", [(0.9, 0), (1.1, 1)])
def test_how_far_a_length_may_be_off(ur10, share, count):
    robot = ur10[0]
    joints = list(robot.joints)
    joints[1] = replace(joints[1], a=joints[1].a + share * FAR_FROM_DRAWING * robot.reach)
    assert len(list(far_from_drawing(robot, replace(robot, joints=tuple(joints))))) == count


@pytest.mark.parametrize("share, count", [(0.9, 0), (-0.9, 0), (1.1, 1), (-1.1, 1)])
def test_how_far_a_zero_may_be_off(ur10, share, count):
    robot = ur10[0]
    joints = list(robot.joints)
    joints[3] = replace(joints[3], q_offset=joints[3].q_offset + share * FAR_ZERO_RAD)
    lines = list(far_from_drawing(robot, replace(robot, joints=tuple(joints))))
    assert len(lines) == count and all(line.startswith("the zero of axis 4 comes out") for line in lines)

@pytest.mark.slow
def test_zeros_of_the_shipped_arms_are_less_than_half_as_far_off():
    """What the limit rests on: 1.41 degrees at most, of five arms with a ball in two seats."""
    folder, off = data_path("ball_in_socket"), []
    for name in ("panda_3", "panda_6", "panda_7", "dinova_1", "dinova_2"):
        robot = load_robot("panda" if "panda" in name else "gen3lite")
        data = ea.read(folder / f"{name}.csv", robot, fixture=folder / "fixture.toml")
        found = calibrate_closures(robot, data)
        off += [new.q_offset - old.q_offset for old, new in zip(robot.joints, found.robot.joints)]
    assert 0.024 < np.max(np.abs(off)) < 0.5 * FAR_ZERO_RAD


def two_arms():
    """Touches of two arms at two tables, both of place 1, and touches of one of them alone."""
    files = [data_path(f"ball_in_socket/panda_{number}.csv") for number in (6, 7)]
    both = ea.read(files, "panda", fixture=data_path("ball_in_socket/fixture.toml"))
    both = both.select(np.flatnonzero(both.session == 1)[::2])
    return both, both.select(both.file_index == 0)


@pytest.mark.slow
def test_files_of_two_arms_that_are_refused_contradict_each_other():
    both, alone = two_arms()
    with pytest.raises(InputError, match="the 2 files contradict each other: .* of one number in two files "
                                         ".*Of all together: robot and data do not match"):
        ea.calibrate("panda", both)
    assert ea.calibrate("panda", alone).report.tone == "good"


@pytest.mark.slow
def test_files_that_leave_much_together_contradict_each_other(ur10):
    robot, data = ur10
    files = np.arange(len(data)) % 2
    q = data.joints["q"] + np.outer(files, [0.0, 0.0, 0.05, 0.0, -0.05, 0.0])
    result = ea.calibrate(robot, replace(data, sources=2 * data.sources, file_index=files,
                                            joints={"q": q}))
    line = next(line for line in result.warnings if "contradict" in line)
    assert line.startswith("the 2 files contradict each other: ") and "of one number in two files" in line
    assert result.report.tone == "caution"
    (said,) = (section for section in result.report.sections if getattr(section, "heading", "") == HEADING)
    assert said.paragraphs[0].startswith("Look first at what the warnings name")


@pytest.mark.parametrize("turned", [0.0, 0.05])
@pytest.mark.slow
def test_an_arm_that_was_mastered_anew_contradicts_itself(ur10, turned):
    robot, data = ur10
    data = data.select(np.arange(0, len(data), 2))
    late = np.arange(len(data)) % 2 == 1
    q = data.joints["q"] + np.outer(late, [0.0, 0.0, turned, 0.0, -turned, 0.0])
    result = ea.calibrate(robot, replace(data, session=data.session + late, joints={"q": q}))
    found = [line for line in result.warnings if "contradict" in line]
    assert len(found) == bool(turned)
    if turned:
        assert found[0].startswith("the 2 sessions contradict each other: ")
        assert "of one number" not in found[0]


def test_nothing_is_calibrated_alone_where_little_is_left(ur10):
    data = replace(ur10[1], session=np.arange(len(ur10[1])) % 2)
    refused = lambda rows: pytest.fail("was asked for")
    assert list(contradicting(data, 1e-3, 2e-3, refused)) == []
    (line,) = contradicting(data, 0.1702, 2e-3, lambda rows: 1.04e-3)
    assert "at most 1 mm (RMS)" in line and ", 170 mm of all together;" in line
    assert list(contradicting(data, 1e-1, 2e-3, lambda rows: 3e-3)) == []
