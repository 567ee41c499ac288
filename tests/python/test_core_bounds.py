"""Nothing that Python can hand to the compiled core leads it outside its memory: it refuses, and says why."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from exactarm import _core
from hostile_calls import targets

CALLS = 6000  # 70 of each target; 20,000 with seeds 1 to 7 came through when this was written


def joints(count: int = 6, **values) -> list[_core.Joint]:
    return [_core.Joint(**values) for _ in range(count)]


def test_the_attack_knows_every_function_of_the_core():
    found = targets()
    assert {"forward_kinematics", "plan_motion", "Robot.__init__", "PlanProblem.q_desired=",
            "ElasticJointDynamics.forward"} <= set(found)
    assert [kind for _, kind in found["gear_ratio"][0]][1] == "exactarm._core.GearTable"


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_wrong_arguments_never_crash_the_core(seed, tmp_path):
    log = tmp_path / "calls.txt"
    program = Path(__file__).with_name("hostile_calls.py")
    done = subprocess.run([sys.executable, program, str(seed), str(CALLS), log], capture_output=True,
                          text=True)
    last = log.read_text().splitlines()[-1]
    how = signal.Signals(-done.returncode).name if done.returncode < 0 else done.returncode
    assert done.returncode == 0, f"{how} at: {last}\n{done.stderr[-2000:]}"
    # each target was called rightly at least once
    assert "never came through: none" in done.stdout, done.stdout


def test_a_gear_table_whose_lengths_differ_is_refused():
    with pytest.raises(_core.InvalidArgument, match="coefficients a of a gear table: size 1, expected 2"):
        _core.GearTable([1.0, 2.0], [0.1], [0.1, 0.1])
    with pytest.raises(_core.InvalidArgument, match="coefficients b of a gear table: size 3, expected 2"):
        _core.GearTable([1.0, 2.0], [0.1, 0.1], [0.1] * 3)


def test_values_of_a_robot_cannot_be_changed_after_the_check():
    robot = _core.Robot(joints(2, gear=_core.Gear(2.0, _core.GearTable([1.0], [0.1], [0.1]))))
    with pytest.raises(AttributeError):
        robot.joints = []
    robot.joints.append(None)  # a copy
    assert robot.axes == 2
    with pytest.raises(ValueError, match="read-only"):
        robot.joints[0].gear.cw.order[0] = np.nan


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (list, "joints of a robot: found 0"),
        (lambda: joints(65), "joints of a robot: found 65, expected 1 to 64"),
        (lambda: joints(frame=_core.Frame(d=np.nan)), "joint 1, d: expected a finite number"),
        (lambda: joints(frame=_core.Frame(sign=0.5)), "joint 1, sign: expected 1 or -1"),
        (lambda: joints(gear=_core.Gear(0.0)), "joint 1, ratio"),
        (lambda: joints(gear=_core.Gear(1.0, _core.GearTable([1.0], [np.inf], [0.0]))),
         "joint 1, gear cw, a"),
        (lambda: joints(limits=_core.Limits(1.0, -1.0)), "limits of joint 1: expected q_min <= q_max"),
        (lambda: joints(limits=_core.Limits(np.nan, 1.0)), "limits of joint 1"),
        (lambda: joints(2) + joints(1, link=_core.LinkInertia(1.0, np.zeros(3), np.eye(3))),
         "masses: known of some links only"),
    ],
)
def test_what_is_no_robot_is_refused_where_it_is_made(made, words):
    with pytest.raises(_core.InvalidArgument, match=words):
        _core.Robot(made())


def test_a_gear_too_fine_to_be_proven_monotone_is_refused_at_once():
    with pytest.raises(_core.InvalidArgument, match="expected a sum below 1"):
        _core.require_gear("gear", 50.0, _core.GearTable([1e9, 2e9], [0.9, 0.3], [0.0, 0.0]))


def test_an_array_handed_out_stays_valid_when_its_owner_gets_another():
    problem = _core.PlanProblem(_core.Robot(joints()))
    problem.q_desired = np.full((50, 6), 0.5)
    kept = problem.q_desired
    problem.q_desired = np.zeros((10, 6))
    assert np.all(kept == 0.5)


def test_more_axes_than_a_usual_arm_are_planned_within_bounds():
    """Work arrays of the planner were sized for 16 axes."""
    link = _core.LinkInertia(1.0, np.zeros(3), np.eye(3))
    robot = _core.Robot(joints(18, frame=_core.Frame(a=0.1), spring=_core.Spring(1e5),
                               drive=_core.Drive(1e-3), link=link))
    problem = _core.PlanProblem(robot)
    problem.q_desired, problem.step = np.zeros((20, 18)), 1e-2
    assert _core.plan_motion(robot, problem).status == "solved"
