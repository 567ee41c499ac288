"""Which axes move: radians are compared with radians, metres with metres."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm.chain import Layout
from exactarm.data.kinds.base import moving_axes
from exactarm.diagnose.diagnosis import diagnose
from exactarm.effects import effect_from_table
from exactarm.robot.robot import Joint, Robot
from set_ups import at_random_place, joints_in_limits, measured

SCREW_M_PER_RAD, NOISE_M, ROWS = 5e-5, 2e-5, 100


def scara() -> Robot:
    """Its quill travels 150 mm and turns nearly two turns."""
    turning = {"q_min": -2.3, "q_max": 2.3}
    return Robot("scara", (
        Joint(d=0.39, a=0.225, **turning), Joint(a=0.175, alpha=np.pi, **turning),
        Joint(type="prismatic", q_min=0.0, q_max=0.15), Joint(q_min=-6.1, q_max=6.1)))


@pytest.mark.parametrize("span, moves", [
    ((4.0, 4.0, 0.15, 12.0), (True, True, True, True)),
    ((4.0, 0.1, 0.15, 12.0), (True, False, True, True)),
    ((4.0, 4.0, 1e-5, 12.0), (True, True, False, True)),
    ((1e-6, 1e-6, 0.15, 1e-5), (False, False, True, False)),
])
def test_a_short_way_moves_beside_two_turns(span, moves):
    np.testing.assert_array_equal(moving_axes(scara(), np.array(span)), moves)


def test_of_one_kind_of_axes_the_largest_range_decides():
    robot = replace(scara(), joints=scara().joints[:2])
    np.testing.assert_array_equal(moving_axes(robot, np.array([1e-4, 1e-7])), [True, False])
    assert not moving_axes(robot, np.zeros(2)).any()


@pytest.mark.slow
def test_a_quill_that_its_screw_turns_along_is_named():
    rng, robot = np.random.default_rng(5), scara()
    screw = effect_from_table({"effect": "joint_coupling", "joint": 3, "motor": 4,
                               "coupling_rad_per_rad": SCREW_M_PER_RAD})
    data = measured(robot, [at_random_place(robot, rng)], [joints_in_limits(robot, ROWS, rng)], NOISE_M, rng,
                    layout=Layout.of((screw,), estimate=False))
    result = diagnose(robot, data)
    assert result.verdict == "explained" and [f.effect.label for f in result.findings] == [screw.label]
    assert result.findings[0].effect.values[1] == pytest.approx(SCREW_M_PER_RAD, rel=0.1)
