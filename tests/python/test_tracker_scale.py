"""A tracker that stretches its axes unlike each other, in front of an arm on a rail."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.diagnose.diagnosis import diagnose
from exactarm.diagnose.verdict import EXPLAINED
from exactarm.effects.tracker_scale import TrackerScale
from set_ups import joints_in_limits, measured, true_robot
from test_robot_types import arm_on_a_track

SCALES, NOISE_M = np.array([3e-4, 0.0, -2e-4]), 3e-5


def track():
    """Without ratios, which would be estimated again."""
    robot = arm_on_a_track()
    return replace(robot, joints=tuple(replace(joint, ratio=None) for joint in robot.joints))


def on_a_rail(seed: int, scales: np.ndarray = SCALES) -> tuple:
    robot, rng = track(), np.random.default_rng(seed)
    seen = measured(robot, [true_robot(robot, rng)], [joints_in_limits(robot, 120, rng)], 0.0, rng)
    position = seen.position * (1.0 + scales) + rng.normal(0.0, NOISE_M, seen.position.shape)
    return robot, replace(seen, position=position)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])  # the first two tried; 0 to 7 all hold
def test_the_way_of_a_rail_shows_all_three(seed):
    """With one of them held, as for arms without a slide, the travel of the rail took it: two causes."""
    robot, data = on_a_rail(seed)
    result = diagnose(robot, data)
    assert result.verdict == EXPLAINED
    (found,) = result.findings
    assert found.effect.label == "tracker_scale" and found.effect.values == pytest.approx(SCALES, abs=3e-5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])  # the first two tried; 0 to 7 all hold
def test_a_scale_of_all_three_is_not_told_from_the_travel_of_the_rail(seed):
    """With all lengths free they are one signal, and each is one number."""
    (found,) = diagnose(*on_a_rail(seed, np.full(3, 3e-4))).findings
    members = {(name, joint): probability for name, joint, probability in found.credible_set}
    assert set(members) == {("tracker_scale", None), ("gear_ratio", 1)}
    assert 0.2 < members["gear_ratio", 1] < 0.35  # by one nat: a ratio is a count of teeth
    assert found.effect.values == pytest.approx((3e-4,) * 3, abs=3e-5)


def test_arms_without_a_slide_absorb_what_all_three_share():
    axes = lambda robot: {e.axes for e in TrackerScale.candidates(robot, view_of(robot))}
    assert axes(track()) == {"x", "y", "z", "xy", "xyz", "alike"}
    assert axes(arm_on_a_track()) == {"x", "y", "z", "xy"}  # its ratio is estimated again
    assert axes(replace(track(), joints=track().joints[1:])) == {"x", "y", "z", "xy"}


def view_of(robot):
    q = joints_in_limits(robot, 5, np.random.default_rng(1))
    data = Dataset.of_arrays("poses", {"q": q}, position=np.zeros((5, 3)))
    return predict_poses(robot, Layout.of(()), data, tangents=False).view
