"""An arm on a wall or a ceiling whose robot file has it on the floor gives way as nothing else does."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.diagnose.problems import problem_for
from exactarm.effects.gear_eccentricity import GearEccentricity
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.identify.calibrate import CalibrationOptions, calibrate
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


@pytest.mark.parametrize("gravity, words", [
    ((G, 0.0, 0.0), "(9.81, 0, 0)"), ((0.0, 0.0, G), "(0, 0, 9.81)"),
    ((0.0, G / np.sqrt(2.0), -G / np.sqrt(2.0)), "(0, 6.94, -6.94)")])
@pytest.mark.parametrize("masses", [True, False])
def test_gravity_that_is_not_where_the_file_has_it_is_told(gravity, words, masses):
    """A gear error stood there in a diagnosis, once as all that there is. Any seed: 0 to 7 are told alike."""
    robot, data = poses(gravity)
    (line,) = told(robot if masses else replace(robot, links=None), data)
    assert f"about {words} m/s²" in line


@pytest.mark.parametrize("effects", [(), SPRINGS, (GearEccentricity(2, (2e-4, -1e-4, 0.0, 0.0)),)])
@pytest.mark.parametrize("gravity", [FLOOR, (0.0, 0.0, G)])
def test_it_is_not_asked_for_where_the_file_has_it_so(effects, gravity):
    assert not told(*poses(gravity, effects, declared=gravity))


def test_a_diagnosis_asks_the_same():
    robot, data = poses((0.0, -G, 0.0))
    problem = problem_for(robot, data, data.select(np.zeros(80, bool)), 1, 0)
    (line,) = problem.doubts(problem.fit(problem.declared()))
    assert ASKED in line and "(0, -9.81, 0)" in line


@pytest.mark.parametrize("joint, spring, asked", [(2, True, True), (2, False, False), (1, True, False)])
def test_a_slow_curve_of_an_axis_that_bears_weight_and_gives_way_may_be_a_balancer(joint, spring, asked):
    """They stood as run-outs of axis 2, for certain. Any seed: it is said whatever the sizes are."""
    robot, data = poses(FLOOR)
    problem = problem_for(robot, data, data.select(np.zeros(80, bool)), 1, 0)
    effects = (GearEccentricity(joint, (1e-4, 0.0, 0.0, 0.0)), *((SPRINGS[0],) if spring else ()))
    rigid = problem.declared().without({f"joint_compliance_{axis}.linear_rad_per_Nm" for axis in range(1, 7)})
    told = problem.doubts(problem.fit(rigid.joined(Layout.of(effects))))
    assert any(f"a balancer (a spring that carries weight of axis {joint})" in line for line in told) == asked


def test_a_spring_without_a_linear_term_does_not_push():
    robot, none = six_axis(), np.zeros(2)
    assert JointCompliance(2, (0.0, 1e-12)).possible(robot, none)
    assert not JointCompliance(2, (0.0, -1e-12)).possible(robot, none)
    assert JointCompliance(2, (1e-6, -1e-12)).possible(robot, none)
