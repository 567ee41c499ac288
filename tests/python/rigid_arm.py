"""An arm whose joints do not yield, for simulations without springs."""

from __future__ import annotations

from exactarm.robot.robot import Robot
from exactarm.robot_file import load_robot

# with these fields a motion's torque is that of the links alone: constant ratios, no rotor, no friction
LINKS_ALONE = {"cw": None, "ccw": None, "rotor_inertia": 0.0, "coulomb": 0.0, "viscous": 0.0}


def rigid(name: str = "racer-7-1.4", **fields) -> Robot:
    """A shipped robot without springs; `fields`: of every joint."""
    robot = load_robot(name)
    for index in range(robot.axes):
        robot = robot.with_joint(index, spring_linear=None, spring_cubic=0.0, **fields)
    return robot
