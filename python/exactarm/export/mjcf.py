"""MuJoCo's MJCF: the identified chain as bodies with hinges and slides, masses where they are declared, a
site at the flange.

Joint positions are those that the controller reports. Rotor inertia becomes `armature`, friction
`frictionloss` and `damping`. A link without declared mass gets the least that MuJoCo takes.
"""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.spatial.transform import Rotation

from exactarm.export.chain import reported_chain
from exactarm.robot.mdh_frames import behind_axis, relative
from exactarm.robot.robot import Placement, Robot
from exactarm.robot.urdf import reported_shift

LEAST = 'mass="1e-3" diaginertia="1e-6 1e-6 1e-6"'


def mjcf_text(robot: Robot) -> str:
    """The file's text."""
    chain = reported_chain(robot)
    gravity = robot.controller.base.rotation @ robot.gravity
    lines = [
        f"<mujoco model={quoteattr(robot.name)}>",
        '  <compiler angle="radian" balanceinertia="true"/>',
        f'  <option gravity="{_numbers(gravity)}"/>',
        "  <worldbody>",
    ]
    before = Placement()
    for index, start in enumerate(chain.starts):
        pad = "  " * (index + 2)
        lines.append(f'{pad}<body name="link_{index + 1}" {_pose(relative(before, start))}>')
        lines.append(f"{pad}  {_inertial(robot, index)}")
        lines.append(f"{pad}  {_joint(robot, index)}")
        before = start
    pad = "  " * (robot.axes + 2)
    lines.append(f'{pad}<site name="flange" {_pose(relative(before, chain.end))}/>')
    lines += ["  " * (index + 2) + "</body>" for index in range(robot.axes - 1, -1, -1)]
    return "\n".join([*lines, "  </worldbody>", "</mujoco>", ""])


def _joint(robot: Robot, index: int) -> str:
    joint = robot.joints[index]
    kind = "slide" if joint.type == "prismatic" else "hinge"
    words = [f'<joint name="joint_{index + 1}" type="{kind}" axis="0 0 {int(joint.sign)}"']
    if joint.q_min is not None and joint.q_max is not None:
        shift = reported_shift(robot, index)
        words.append(f'limited="true" range="{_numbers([joint.q_min - shift, joint.q_max - shift])}"')
    armature = (joint.rotor_inertia or 0.0) * robot.ratios[index] ** 2
    words += [
        f'{key}="{float(value)!r}"'
        for key, value in (
            ("armature", armature),
            ("frictionloss", joint.coulomb),
            ("damping", joint.viscous),
        )
        if value
    ]
    return " ".join(words) + "/>"


def _inertial(robot: Robot, index: int) -> str:
    """Of link `index`, from its DH frame into the frame of its axis."""
    link = robot.links[index] if robot.links and not robot.generic_masses else None
    if link is None or link.mass <= 0.0 or not np.any(link.inertia):
        mass = (
            LEAST
            if link is None or link.mass <= 0.0
            else f'mass="{float(link.mass)!r}" diaginertia="1e-6 1e-6 1e-6"'
        )
        centre = np.zeros(3) if link is None else _behind(robot, index, link.centre_of_mass)
        return f'<inertial pos="{_numbers(centre)}" {mass}/>'
    turn = behind_axis(robot.joints[index]).rotation
    inertia = turn @ link.inertia @ turn.T
    full = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    return (
        f'<inertial pos="{_numbers(_behind(robot, index, link.centre_of_mass))}" mass="{float(link.mass)!r}" '
        f'fullinertia="{_numbers(full)}"/>'
    )


def _behind(robot: Robot, index: int, point: np.ndarray) -> np.ndarray:
    frame = behind_axis(robot.joints[index])
    return frame.rotation @ point + frame.position


def _pose(placement: Placement) -> str:
    wxyz = np.roll(Rotation.from_matrix(placement.rotation).as_quat(), 1)
    return f'pos="{_numbers(placement.position)}" quat="{_numbers(wxyz)}"'


def _numbers(values) -> str:
    return " ".join(repr(float(value)) for value in values)
