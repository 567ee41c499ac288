"""What is done to a path and must come back in its plan: the mirror image, a turn about the vertical, the way
back, the same path sampled twice as densely."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.numerics.rotation import exp
from exactarm.plan import Line, PlannedPath, PlanOptions, load_path, plan_path
from exactarm.robot.robot import GearTable, Robot
from exactarm.robot_file import load_robot
from test_metamorphic_mirror import MIRROR, mirrored_robot

ROBOT = load_robot("racer-7-1.4")
LINE = replace(load_path("line"), rate_hz=200.0)
TURN_RAD = 0.4
INPUTS = [("acceleration", 1e-14), ("jerk", 1e-18)]


def plan_of(robot: Robot, path: PlannedPath, start=None):
    return plan_path(robot, path, PlanOptions(threads=1, start=start))


def without_gear_errors(robot: Robot) -> Robot:
    return replace(robot, joints=tuple(replace(joint, cw=None, ccw=None) for joint in robot.joints))


def mirrored_table(table: GearTable | None) -> GearTable | None:
    """The transmission at phi of the image is that at -phi: the sines change their sign."""
    return table and replace(table, b=-table.b)


def mirrored_gears(robot: Robot) -> Robot:
    """The image with its gears: what fell now rises."""
    image = mirrored_robot(robot)
    joints = tuple(replace(joint, cw=mirrored_table(old.ccw), ccw=mirrored_table(old.cw))
                   for joint, old in zip(image.joints, robot.joints))
    return replace(image, joints=joints)


@pytest.mark.parametrize("kind, nu", INPUTS)
def test_the_mirror_image_of_an_arm_follows_the_mirror_image_of_a_path(kind, nu):
    path = replace(LINE, input=kind, nu=nu)
    image = replace(path, curve=Line(LINE.curve.start * MIRROR, LINE.curve.end * MIRROR),
                    orientation_wxyz=np.array([0.0, 0.0, 0.0, -1.0]))
    one = plan_of(ROBOT, path)
    other = plan_of(mirrored_gears(ROBOT), image, -one.q_desired[0])
    np.testing.assert_allclose(other.q, -one.q, atol=1e-9)
    np.testing.assert_allclose(other.theta, -one.theta, atol=1e-6)
    assert other.solver.objective == pytest.approx(one.solver.objective, rel=1e-6)


def test_a_path_turned_about_the_vertical_turns_the_first_axis_alone():
    robot, turn = without_gear_errors(ROBOT), exp(np.array([0.0, 0.0, TURN_RAD]))
    half = 0.5 * TURN_RAD
    turned = replace(LINE, curve=Line(turn @ LINE.curve.start, turn @ LINE.curve.end),
                     orientation_wxyz=np.array([-np.sin(half), 0.0, 0.0, np.cos(half)]))
    one = plan_of(robot, LINE)
    first = np.eye(6)[0] * TURN_RAD * robot.joints[0].sign
    other = plan_of(robot, turned, one.q_desired[0] + first)
    np.testing.assert_allclose(other.q, one.q + first, atol=1e-9)
    np.testing.assert_allclose(other.theta, one.theta + robot.ratios * first, atol=1e-6)


@pytest.mark.parametrize("kind, nu", INPUTS)
def test_the_way_back_is_the_way_there_with_time_reversed(kind, nu):
    """No friction in the plan, and one gear table: nothing tells the past from the future."""
    there = replace(LINE, gear_direction="cw", input=kind, nu=nu)
    back = replace(there, curve=Line(LINE.curve.end, LINE.curve.start))
    one = plan_of(ROBOT, there)
    other = plan_of(ROBOT, back, one.q_desired[-1])
    np.testing.assert_allclose(other.q[::-1], one.q, atol=1e-8)
    np.testing.assert_allclose(other.theta[::-1], one.theta, atol=1e-6)
    np.testing.assert_allclose(other.theta_dot[::-1], -one.theta_dot, atol=1e-4)


def test_twice_the_samples_give_the_same_motion():
    one, other = (plan_of(ROBOT, replace(LINE, rate_hz=rate)) for rate in (200.0, 400.0))
    np.testing.assert_allclose(other.q[::2], one.q, atol=1e-6)
    scale = np.abs(one.theta - one.theta[0]).max()
    np.testing.assert_allclose(other.theta[::2], one.theta, atol=1e-4 * scale)
