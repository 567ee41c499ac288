"""An arm on a wall or a ceiling whose robot file has it on the floor gives way as nothing else does."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.commands.diagnose_report import _next
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.problems import problem_for
from exactarm.diagnose.verdict import UNEXPLAINED
from exactarm.effects.gear_eccentricity import GearEccentricity
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.identify.calibrate import CalibrationOptions, calibrate
from exactarm.numerics.rotation import exp
from exactarm.robot.robot import Placement
from set_ups import at_random_place, joints_in_limits, measured
from six_axis import six_axis

G = 9.81
FLOOR = (0.0, 0.0, -G)
SPRINGS = (JointCompliance(2, (4e-6, 0.0)), JointCompliance(3, (8e-6, 0.0)))
ASKED = "is the arm mounted otherwise"


def poses(gravity, effects=SPRINGS, seed=0, declared=FLOOR):
    """The robot as its file has it, and 80 poses of the one that stands there, noise of 0.05 mm."""
    random = np.random.default_rng(seed)
    there = replace(six_axis(placed=False), gravity=np.array(gravity))
    data = measured(there, [at_random_place(there, random)], [joints_in_limits(there, 80, random)], 5e-5,
                    random, layout=Layout.of(effects, estimate=False), identification=np.ones(80, bool))
    return replace(there, gravity=np.array(declared)), data


def told(robot, data):
    lines = calibrate(robot, data, CalibrationOptions(orientation=False)).warnings
    return [line for line in lines if ASKED in line]


DIRECTIONS = [((G, 0.0, 0.0), "[9.81, 0, 0]"), ((0.0, 0.0, G), "[0, 0, 9.81]"),
              ((0.0, G / np.sqrt(2.0), -G / np.sqrt(2.0)), "[0, 6.94, -6.94]")]


@pytest.mark.parametrize("gravity, words", DIRECTIONS)
@pytest.mark.parametrize("masses", [True, False])
def test_gravity_that_is_not_where_the_file_has_it_is_told(gravity, words, masses):
    """A gear error stood there in a diagnosis, once as all that there is. Any seed: 0 to 7 are told alike."""
    robot, data = poses(gravity)
    (line,) = told(robot if masses else replace(robot, links=None), data)
    assert f"gravity_m_s2 = {words}" in line


@pytest.mark.parametrize("gravity, words", DIRECTIONS)
def test_springs_of_the_file_do_not_hide_where_gravity_is(gravity, words):
    """Any seed: 0 to 7 are told alike. They are part of what gives way under the gravity that is there."""
    robot, data = poses(gravity)
    for axis, spring in ((2, 1.0 / 4e-6), (3, 1.0 / 8e-6)):
        robot = robot.with_joint(axis, spring_linear=spring)
    (line,) = told(robot, data)
    assert f"gravity_m_s2 = {words}" in line


@pytest.mark.parametrize("share", [0.5, 0.7, 2.0])
@pytest.mark.parametrize("carried", [False, True])
def test_springs_of_the_file_of_another_size_are_no_other_gravity(share, carried):
    """Any seed: 0 to 7 ask for nothing. Too soft ones seemed to be springs of an arm on the ceiling."""
    robot, data = poses(FLOOR)
    if carried:
        robot = replace(robot, effects=tuple(
            spring.with_values((spring.values[0] / share, 0.0)) for spring in SPRINGS))
    else:
        for spring in SPRINGS:
            robot = robot.with_joint(spring.joint, spring_linear=share / spring.values[0])
    assert not told(robot, data)


def test_gravity_is_told_in_the_frame_of_its_key_whatever_the_controller_calls_its_base():
    """Any seed: 0 to 7 are told alike. It counts from the first frame (docs/files.md)."""
    robot, data = poses((G, 0.0, 0.0))
    turned = Placement(exp(np.array([0.0, 0.0, np.pi / 2.0])), np.zeros(3))
    (line,) = told(replace(robot, controller=replace(robot.controller, base=turned)), data)
    assert "gravity_m_s2 = [9.81, 0, 0]" in line


# any seed: 0 to 7 ask for nothing. Run-outs of a turntable and of an arm on a track did: test_robot_types.py
@pytest.mark.parametrize("effects", [(), SPRINGS, (GearEccentricity(2, (2e-4, -1e-4, 0.0, 0.0)),)])
@pytest.mark.parametrize("gravity", [FLOOR, (0.0, 0.0, G)])
def test_it_is_not_asked_for_where_the_file_has_it_so(effects, gravity):
    assert not told(*poses(gravity, effects, declared=gravity))


@pytest.mark.slow
def test_nothing_is_explained_while_gravity_may_point_elsewhere():
    """Any seed. "Use robot.toml of this folder" stood beside the question."""
    robot, data = poses((0.0, 0.0, G))
    result = diagnose(robot, replace(data, identification=np.arange(80) % 4 > 0))
    assert result.verdict == UNEXPLAINED and "mounted otherwise" in result.sentence
    assert not result.drafts  # a formula for what another gravity does
    (advice,) = _next(robot, result, [])
    assert "Look first at where gravity points" in advice.paragraphs[0]


def test_a_diagnosis_asks_the_same():
    """Any seed."""
    robot, data = poses((0.0, -G, 0.0))
    problem = problem_for(robot, data, data.select(np.zeros(80, bool)), 1, 0)
    (line,) = problem.doubts(problem.fit(problem.declared()))
    assert ASKED in line and "gravity_m_s2 = [0, -9.81, 0]" in line


@pytest.mark.parametrize("joint, spring, asked", [(2, True, True), (2, False, False), (1, True, False)])
def test_a_slow_curve_of_an_axis_that_bears_weight_and_gives_way_may_be_a_balancer(joint, spring, asked):
    """They stood as run-outs of axis 2, for certain. Any seed: it is said whatever the sizes are."""
    robot, data = poses(FLOOR)
    problem = problem_for(robot, data, data.select(np.zeros(80, bool)), 1, 0)
    effects = (GearEccentricity(joint, (1e-4, 0.0, 0.0, 0.0)),
               *((JointCompliance(joint, (4e-6, 0.0)),) if spring else ()))
    told = problem.doubts(problem.fit(problem.declared().joined(Layout.of(effects))))
    assert any(f"a balancer (a spring that carries weight of axis {joint})" in line for line in told) == asked


def test_a_spring_without_a_linear_term_does_not_push():
    robot, none = six_axis(), np.zeros(2)
    assert JointCompliance(2, (0.0, 1e-12)).possible(robot, none)
    assert not JointCompliance(2, (0.0, -1e-12)).possible(robot, none)
    assert JointCompliance(2, (1e-6, -1e-12)).possible(robot, none)
