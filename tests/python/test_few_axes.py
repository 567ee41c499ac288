"""Paths of a SCARA whose axes lean, as those of every identified one do."""

from dataclasses import replace

import numpy as np
import pytest

from exactarm import _core
from exactarm.errors import ComputationError
from exactarm.numerics.rotation import log as rotation_log
from exactarm.plan.inverse_kinematics import inverse_kinematics
from exactarm.plan.reference import Reference
from test_robot_types import scara


def straight(robot, samples=9):
    """A line that the arm of the drawing follows, its flange upright."""
    q = np.linspace([0.3, -0.9, 0.05, 0.4], [0.5, -0.7, 0.09, 0.1], samples)
    position, rotation = _core.forward_kinematics(robot.core, q)
    still = np.zeros_like(position)
    return Reference(np.linspace(0.0, 1.0, samples), position, still, still, rotation), q


def leaning(robot):
    joints = [replace(joint, alpha=joint.alpha + lean) for joint, lean in
              zip(robot.joints, (1e-3, -8e-4, 5e-4, 0.0))]
    return replace(robot, joints=tuple(joints))


def test_an_arm_of_the_drawing_follows_exactly():
    reference, q = straight(scara())
    found = inverse_kinematics(scara().core, reference, q[0])
    np.testing.assert_allclose(found.q, q, atol=1e-9)
    assert not [line for line in found.warnings if "orientation" in line]


@pytest.mark.parametrize("begun", [True, False])
def test_axes_that_lean_reach_every_place_with_the_nearest_orientation(begun):
    """It was "out of reach" in the middle of the work space."""
    arm = leaning(scara())
    reference, q = straight(scara())
    found = inverse_kinematics(arm.core, reference, q[0] if begun else None)
    position, rotation = _core.forward_kinematics(arm.core, found.q)
    np.testing.assert_allclose(position, reference.position, atol=1e-8)
    off = np.linalg.norm(rotation_log(reference.rotation @ np.swapaxes(rotation, -1, -2)), axis=1)
    assert 1e-4 < off.max() < 3e-3
    (told,) = [line for line in found.warnings if "orientation" in line]
    assert f"up to {1e3 * off.max():.2g} mrad" in told
    # no other turn about the upright axis lies nearer
    for turn in (-1e-4, 1e-4):
        beside = found.q + [0.0, 0.0, 0.0, turn]
        turned = _core.forward_kinematics(arm.core, beside)[1]
        farther = np.linalg.norm(rotation_log(reference.rotation @ np.swapaxes(turned, -1, -2)), axis=1)
        assert np.all(farther > off)


@pytest.mark.slow
def test_what_lies_beyond_the_arm_stays_out_of_reach():
    reference, _ = straight(scara())
    far = replace(reference, position=reference.position + [1.0, 0.0, 0.0])
    with pytest.raises(ComputationError, match="out of reach"):
        inverse_kinematics(leaning(scara()).core, far)
