"""The same robot in Pinocchio, so that kinematics and dynamics are judged by an independent library.

`pinocchio_model(robot)` takes a `_core.Robot` and returns a `pin.Model` in the robot's own base frame: joint
i turns (slides) about `sign` times z of axis frame A_i = F_{i-1} Rot_z(zero), joint coordinates equal q;
frames "link_i" are the DH frames, "tool" is the target. `robot.base` is left out: multiply by it for the
measuring frame.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from exactarm import _core


def rotation(axis: str, angle: float) -> np.ndarray:
    return pin.utils.rotate(axis, angle)


def pinocchio_model(robot: _core.Robot) -> pin.Model:
    model = pin.Model()
    model.gravity = pin.Motion(np.asarray(robot.gravity, float), np.zeros(3))
    parent, link_in_parent = 0, pin.SE3.Identity()
    for i, axis_and_link in enumerate(robot.joints):
        frame, link = axis_and_link.frame, axis_and_link.link
        axis = np.array([0.0, 0.0, frame.sign])
        revolute = frame.type == _core.JointType.revolute
        joint_model = (pin.JointModelRevoluteUnaligned
                       if revolute else pin.JointModelPrismaticUnaligned)(axis)
        placement = link_in_parent * pin.SE3(rotation("z", frame.zero), np.zeros(3))
        joint = model.addJoint(parent, joint_model, placement, f"joint_{i + 1}")
        link_in_joint = pin.SE3(
            rotation("x", frame.alpha) @ rotation("y", frame.beta), np.array([frame.a, 0.0, frame.d])
        )
        if link is not None:
            inertia = pin.Inertia(link.mass, np.asarray(link.centre_of_mass), np.asarray(link.inertia))
            model.appendBodyToJoint(joint, inertia, link_in_joint)
        model.addFrame(pin.Frame(f"link_{i + 1}", joint, 0, link_in_joint, pin.FrameType.OP_FRAME))
        parent, link_in_parent = joint, link_in_joint
    tool = pin.SE3(np.asarray(robot.tool.rotation), np.asarray(robot.tool.position))
    model.addFrame(pin.Frame("tool", parent, 0, link_in_parent * tool, pin.FrameType.OP_FRAME))
    return model
