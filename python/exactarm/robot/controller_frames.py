"""The controller's base and flange: the frames in which places are given and shown.

    x_base = C x_0        T_flange = T_n F        C = robot.controller.base, F = robot.controller.flange

Inside, a chain runs from DH frame 0 to DH frame n; what a person gives or reads counts from the controller's
base and flange (the first and the last link of a URDF). This is the only place where one becomes the other:
a robot whose base is C is seen from the controller's base, one whose tool is F has its flange for a target.
For a robot that declares neither, C = F = 1 and the numbers are the same.
`robot.base` (DH frame 0 in the frame of the measuring device) and `robot.tool` (the target in DH frame n) are
those of the robot file. m, rad.
"""

from dataclasses import replace

import numpy as np

from exactarm.robot.mdh_frames import compose, relative
from exactarm.robot.robot import Controller, Placement, Robot

# in files of joint angles that bring the real arm where it is meant: a second correction makes them wrong
FOR_THE_REAL_ARM = "joint angles for the real arm, not to be corrected again"


def at_base(robot: Robot) -> Robot:
    """The robot with its target, seen from the controller's base."""
    return replace(robot, base=robot.controller.base)


def at_flange(robot: Robot) -> Robot:
    """The robot seen from the controller's base, with the controller's flange for a target."""
    return replace(at_base(robot), tool=robot.controller.flange)


def with_target(robot: Robot, point: np.ndarray) -> Robot:
    """The robot with its target at `point` (3,) in the controller's flange frame; turned as before."""
    place = joined(robot.controller.flange, Placement(position=np.asarray(point, float)))
    return replace(robot, tool=Placement(robot.tool.rotation, place.position))


def target_on_flange(tool: Placement, controller: Controller) -> Placement:
    """Of a target in DH frame n: where it is in the controller's flange frame."""
    return joined(relative(controller.flange, Placement()), tool)


def base_in_device(base: Placement, controller: Controller) -> Placement:
    """Of DH frame 0 in the frame of the measuring device: the controller's base there."""
    return joined(base, relative(controller.base, Placement()))


def apart(controller: Controller) -> bool:
    """Whether its frames are others than DH frame 0 and n."""
    return not (_none(controller.base) and _none(controller.flange))


def joined(first: Placement, second: Placement) -> Placement:
    """`compose`, but to the last bit one of both where the other is none."""
    return first if _none(second) else second if _none(first) else compose(first, second)


def _none(placement: Placement) -> bool:
    return np.array_equal(placement.matrix, np.eye(4))


def in_base(robot: Robot, points: np.ndarray) -> np.ndarray:
    """Points (..., 3) of DH frame 0 in the controller's base frame."""
    return vectors_in_base(robot, points) + robot.controller.base.position


def vectors_in_base(robot: Robot, vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of DH frame 0 in the axes of the controller's base frame."""
    return vectors @ robot.controller.base.rotation.T
