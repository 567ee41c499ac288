"""The chain for tracked motions: slow ones are static poses, fast ones bend by their acceleration too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from central_difference import assert_derivative
from exactarm import _core
from exactarm.chain import Layout, predict_poses, predict_tracked_motion
from exactarm.chain.motion_record import full_record
from exactarm.chain.spring_response import DAMPING_S
from exactarm.data.dataset import Dataset
from exactarm.effects import library
from exactarm.effects.frames import Frames
from exactarm.effects.joint_offset import JointOffset
from exactarm.robot.robot import GearTable
from exactarm.simulate.plant import swing
from exactarm.simulate.profiles import excitation
from motions import fourier_motion
from six_axis import six_axis

NONE = Layout.of(())


def tracked(robot, seconds=3.0, rate_hz=250.0, base_hz=0.2):
    time, angle, _, _ = fourier_motion(robot, seconds, rate_hz, 6, base_hz=base_hz)
    zero = np.zeros((time.size, 3))
    return Dataset.of_arrays("tracked_motion", {"theta": angle * robot.ratios}, time=time, position=zero)


def test_creeping_motion_is_a_series_of_static_poses():
    robot = replace(six_axis(springs=True))
    data = tracked(robot, base_hz=0.002)
    moving = predict_tracked_motion(robot, NONE, data, tangents=False).position
    still = predict_poses(robot, NONE, data, tangents=False).position
    # The springs' second-order answer to their own deflection is left out of motions.
    assert np.max(np.abs(moving - still)) < 2e-5


@pytest.mark.slow
def test_springs_answer_as_the_arm_swings():
    """The chain's one linear system against the integrated plant, gear errors near resonance and all."""
    robot = six_axis(springs=True)
    table = GearTable(np.array([30.0]), np.array([2e-3]), np.array([1e-3]))
    robot = replace(robot, joints=tuple(replace(joint, cw=table, ccw=table) for joint in robot.joints))
    time, q = excitation(robot, 4.0, 1000.0, np.random.default_rng(5))
    theta = (q - robot.offsets) * robot.ratios
    data = Dataset.of_arrays("tracked_motion", {"theta": theta}, time=time, position=np.zeros((time.size, 3)))
    record = full_record(robot, data, 150.0)
    view = predict_tracked_motion(robot, NONE, data, record=record, tangents=False).view
    output = view.phi + robot.offsets
    plant = swing(robot, time, output, DAMPING_S)
    stretch, ours = output - plant.q, output - view.q
    torque = _core.inverse_dynamics(robot.core, view.theta / robot.ratios + robot.offsets,
                                    *(record.theta_dot / robot.ratios,
                                    record.theta_ddot / robot.ratios))
    quasi_static = torque / np.array([joint.spring_linear for joint in robot.joints])
    error = lambda found: np.sqrt(np.mean((found - stretch)[:, 1] ** 2))
    assert error(ours) < 0.05 * np.std(stretch[:, 1])
    assert error(quasi_static) > 3.0 * error(ours)


@pytest.mark.slow
def test_jacobian():
    robot = six_axis(springs=True)
    data = tracked(robot, seconds=0.8)
    make = library()
    effects = (
        Frames.of(1, robot.base, robot.tool, False),
        JointOffset.of(robot, 1),
        make["joint_compliance"](3, (2e-6, 0.0)),
        make["payload"](None, (2.0, 0.1, 0.0, 0.2)),
        make["gear_harmonics"](2, (4.0, 2e-3, -1e-3)),
        make["tracker_scale"](None, (0.0, 0.0, 1e-4)),
    )
    layout = Layout.of(effects)
    steps = np.array([1e-3 if "session" in name else 0.02 * p.plausible
                      for name, p in zip(layout.names, layout.parameters)])
    predict = lambda x: predict_tracked_motion(robot, layout.at(x), data, tangents=False).position[40:-40]
    prediction = predict_tracked_motion(robot, layout, data)
    # The springs' answer is of first order in their stretch.
    assert_derivative(predict, layout.values, prediction.jacobian[40:-40, :3], steps, relative=5e-2)


def test_response_to_an_effect_outside_the_layout():
    robot = six_axis(springs=True)
    data = tracked(robot, seconds=1.0)
    frames, payload = Frames.of(1, robot.base, robot.tool, False), library()["payload"](None, (0.0,) * 4)
    alone = predict_tracked_motion(robot, Layout.of((frames,)), data).view.response(payload)
    inside = predict_tracked_motion(robot, Layout.of((frames, payload)), data).jacobian[:, :, -4:]
    np.testing.assert_allclose(alone, inside, atol=1e-12)
    assert np.max(np.abs(inside[:, :3, 0])) > 1e-6
