"""The kinematics of `ur_description` (default_kinematics.yaml): x y z in m, true roll, pitch, yaw about fixed
axes, for each link.

    origin_i = Trans_x(a_(i-1)) Rot_x(alpha_(i-1)) Rot_y(beta_(i-1)) Rot_z(offset_i) Trans_z(d_i)
The last frame's a, alpha, beta have no place in it: the flange is that of the description. The hash is made
of these numbers; the driver compares it with the robot's own, so that of the robot can be given instead.
Arms of Universal Robots have parallel axes 2, 3, 4 and right angles else; the file of another arm would show
its numbers in their links, so it is refused.
"""

from __future__ import annotations

import hashlib

import numpy as np

from exactarm.errors import InputError
from exactarm.export.chain import reported_chain
from exactarm.robot.mdh_frames import compose, relative
from exactarm.robot.robot import Placement, Robot
from exactarm.robot.ur_calibration import like_universal_robots
from exactarm.robot.urdf import roll_pitch_yaw

LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")


def link_origins(robot: Robot) -> list[Placement]:
    """Each link's frame in the one before, at reported zero."""
    if robot.axes != len(LINKS) or any(
        joint.type != "revolute" or joint.sign != 1.0 for joint in robot.joints
    ):
        raise InputError(
            f"robot {robot.name}: expected six turning axes of positive sign, as arms of Universal Robots "
            "have",
            file=robot.file,
        )
    chain, before, origins = reported_chain(robot), Placement(), []
    axes = np.array([start.rotation[:, 2] for start in chain.starts])
    if not like_universal_robots(axes):
        raise InputError(
            f"robot {robot.name}: expected an arm of Universal Robots (axes 2, 3, 4 parallel, right angles "
            "between the others); for another arm use --format urdf, with --source FILE for its own",
            file=robot.file,
        )
    for start, joint in zip(chain.starts, robot.joints):
        here = compose(start, Placement(position=np.array([0.0, 0.0, joint.d])))
        origins.append(relative(before, here))
        before = here
    return origins


def kinematics_yaml(robot: Robot, given_hash: str | None = None) -> str:
    """The file's text."""
    lines = ["kinematics:"]
    for name, origin in zip(LINKS, link_origins(robot)):
        values = (*origin.position, *roll_pitch_yaw(origin.rotation))
        lines += [f"  {name}:"] + [
            f"    {key}: {value + 0.0!r}"
            for key, value in zip(("x", "y", "z", "roll", "pitch", "yaw"), map(float, values))
        ]
    number = int.from_bytes(hashlib.sha256("\n".join(lines).encode()).digest()[:8], "big")
    return "\n".join([*lines, f"  hash: {given_hash or f'calib_{number}'}", ""])
