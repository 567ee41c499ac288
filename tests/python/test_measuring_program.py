"""Programs for measuring poses are read back by the readers of their dialects, target by target."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.compensate.formats import jobs
from exactarm.compensate.measuring_program import BEFORE_RAD, WRITERS, measuring_program, stops_of
from exactarm.compensate.setting import Setting
from exactarm.design.pose_space import PoseSpace
from exactarm.errors import InputError
from exactarm.robot_file import load_robot

LEAST_COUNT_RAD = {"krl": 1e-7, "rapid": 1e-7, "fanuc": 1e-5, "urscript": 1e-9, "inform": 1e-5}


@pytest.fixture(scope="module")
def robot():
    robot = load_robot("racer-7-1.4")
    controller = replace(robot.controller, coupling=((3, 2, 1.0),), pulses_per_rad=(1.2e5,) * 6)
    return replace(robot, controller=controller)


@pytest.fixture(scope="module")
def stops(robot):
    space = PoseSpace.of(robot)
    q = space.draw(8, np.random.default_rng(6))
    approach = np.where(np.random.default_rng(7).random(q.shape) < 0.5, -1, 1)
    return stops_of(q, approach, space.lower, space.upper), approach


@pytest.mark.parametrize("dialect", WRITERS)
def test_the_reader_of_the_dialect_finds_every_target(dialect, robot, stops, tmp_path):
    name, text = measuring_program(robot, dialect, stops[0])
    (tmp_path / name).write_bytes(text.encode())
    (job,) = jobs([tmp_path / name])
    program = job.read(Setting(robot))
    found = program.notation.joints(np.array([program.targets[i].numbers for i in program.visits]))
    wanted = np.array([angles for stop in stops[0] for angles in (stop.before, stop.q)])
    assert found.shape == wanted.shape and np.allclose(found, wanted, atol=LEAST_COUNT_RAD[dialect])
    assert all(motion.kind == "joint" for motion in program.motions)


def test_every_axis_comes_from_the_side_it_should(robot, stops):
    space = PoseSpace.of(robot)
    for stop, way in zip(stops[0], stops[1]):
        moved = stop.q - stop.before
        assert np.all((stop.before >= space.lower) & (stop.before <= space.upper))
        assert np.all(np.sign(moved) * way >= 0) and np.all(np.abs(moved) <= BEFORE_RAD + 1e-12)


def test_straight_there_without_approach(robot, stops):
    q = np.array([stop.q for stop in stops[0]])
    assert all(stop.before is None for stop in stops_of(q, None, q[0], q[0]))
    _, text = measuring_program(robot, "urscript", stops_of(q, None, q[0], q[0]))
    assert text.count("movej") == text.count("sleep") == len(q)


def test_what_the_robot_file_lacks_is_said(robot, stops):
    bare = load_robot("racer-7-1.4")
    with pytest.raises(InputError, match="J3"):
        measuring_program(bare, "fanuc", stops[0])
    with pytest.raises(InputError, match="pulses_per_rad"):
        measuring_program(bare, "inform", stops[0])
    with pytest.raises(InputError, match="expected one of krl"):
        measuring_program(bare, "basic", stops[0])
