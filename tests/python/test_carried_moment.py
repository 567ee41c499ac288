"""What bends across an axis bears weight and acceleration: the moment is that of Newton's law, with its
derivatives, and at rest that of the weight."""

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm.chain import Layout, predict_poses, predict_tracked_motion
from exactarm.data.dataset import Dataset
from exactarm.effects import effect_from_table, library
from exactarm.effects.carried_moment import carried_moment
from exactarm.effects.frames import Frames
from exactarm.effects.joint_offset import JointOffset
from exactarm.effects.moving_frames import MovingFrames
from motions import fourier_motion
from six_axis import six_axis

BENT = {"base_compliance": {"effect": "base_compliance", "rad_per_Nm": 3e-6},
        "link_compliance": {"effect": "link_compliance", "joint": 3, "rad_per_Nm": 5e-6}}


def tracked(robot, seconds=1.0, rate_hz=1000.0, base_hz=0.4):
    time, angle, _, _ = fourier_motion(robot, seconds, rate_hz, 6, base_hz=base_hz)
    return Dataset.of_arrays("tracked_motion", {"theta": angle * robot.ratios}, time=time,
                             position=np.zeros((time.size, 3)))


@pytest.mark.parametrize("index", [0, 1, 3])
def test_moment_of_point_masses_is_that_of_weight_less_acceleration(index):
    """sum (r_j - P) x m_j (g - a_j), accelerations by second differences of the way."""
    arm = six_axis()
    arm = replace(arm, links=tuple(replace(link, inertia=np.zeros((3, 3))) for link in arm.links))
    view = predict_tracked_motion(arm, Layout.of(()), tracked(arm), tangents=False).view
    found, frames = carried_moment(view, index), MovingFrames.of(view)
    step, inner, moment = 1e-3, slice(200, -200), 0.0
    for j, link in enumerate(arm.links[index:], start=index):
        centre = frames.origins[:, j + 1] + frames.rotations[:, j + 1] @ link.centre_of_mass
        acceleration = np.zeros_like(centre)
        acceleration[1:-1] = (centre[2:] - 2.0 * centre[1:-1] + centre[:-2]) / step**2
        gravity = frames.base @ np.asarray(arm.gravity)
        moment = moment + np.cross(centre - found.point, link.mass * (gravity - acceleration))
    weight = carried_moment(view, index, weight_alone=True).moment
    largest = np.max(np.abs(moment - weight)[inner])
    assert largest > 0.1 * np.max(np.abs(weight))  # the motion is quick enough to tell
    assert np.max(np.abs(found.moment - moment)[inner]) < 2e-3 * largest


@pytest.mark.parametrize("name", BENT)
def test_creeping_arms_bend_as_still_ones(name):
    arm, effect = six_axis(), effect_from_table(BENT[name])
    data, layout = tracked(arm, base_hz=0.002), Layout.of((effect,))
    bent = predict_tracked_motion(arm, layout, data, tangents=False).position
    straight = predict_tracked_motion(arm, Layout.of(()), data, tangents=False).position
    still = predict_poses(arm, layout, data, tangents=False).position
    bending = np.max(np.abs(bent - straight))
    assert bending > 5e-6 and np.max(np.abs(bent - still)) < 1e-3 * bending


@pytest.mark.parametrize("alone", [False, True])
def test_jacobian(alone):
    arm = six_axis()
    bent = [replace(effect_from_table(table), weight_alone=alone) for table in BENT.values()]
    layout = Layout.of((Frames.of(1, arm.base, arm.tool, False), JointOffset.of(arm, 1),
                        JointOffset.of(arm, 3), library()["gear_ratio"](2, (1e-3,)), *bent))
    data = tracked(arm, seconds=0.3)
    steps = np.array([1e-3 if "session" in name else 0.02 * p.plausible
                      for name, p in zip(layout.names, layout.parameters)])
    predict = lambda x: predict_tracked_motion(arm, layout.at(x), data, tangents=False).position[60:-60]
    prediction = predict_tracked_motion(arm, layout, data)
    # that a frame turns the bending, too, is of second order
    close = np.array([1e-2 if "session" in name else 1e-5 for name in layout.names])
    assert_derivative(predict, layout.values, prediction.jacobian[60:-60, :3], steps, relative=close)


def test_what_gives_way_slowly_is_kept_in_a_robot_file():
    for table in BENT.values():
        effect = replace(effect_from_table(table), weight_alone=True)
        assert effect_from_table(effect.to_table()) == effect and "slowly" in effect.describe()
        assert "weight_alone" not in effect_from_table(table).to_table()
