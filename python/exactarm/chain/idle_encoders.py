"""Link encoders that tell nothing of a gear: of axes that move in no run, and dead ones, which repeat one
angle.

A log has the columns of all axes, whichever is turned. Of one that rests an encoder shows its own noise, from
which no ratio follows, and beside which an error of rounding looks like a structure.
"""

from dataclasses import replace

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.data.kinds import GEAR_RUN
from exactarm.robot.robot import Robot
from exactarm.view import View, motor_angles


def without_idle_encoders(robot: Robot, *parts: Dataset) -> tuple[Dataset, ...]:
    """The parts of one set of gear runs with NaN for what encoders that are idle in all of them read, as long
    as there are others."""
    own = [part for part in parts if len(part) and part.gyro is None and "q" in part.joints]
    if not own:
        return parts
    known = ~np.isnan(own[0].joints["q"][0]) & ~np.isnan(own[0].joints["theta"][0])
    shown = known & np.any([_moving(robot, part) for part in own], axis=0)
    read = np.concatenate([part.joints["q"] for part in own])
    shown &= np.ptp(np.where(known, read, 0.0), axis=0) > 0.0
    if not shown.any() or np.array_equal(shown, known):
        return parts
    used = lambda part: replace(part, joints=part.joints | {"q": np.where(shown, part.joints["q"], np.nan)})
    return tuple(used(part) if "q" in part.joints else part for part in parts)


def _moving(robot: Robot, data: Dataset) -> np.ndarray:
    view = View(robot, data, GEAR_RUN.name)
    view.signals["theta"] = motor_angles(robot, data)
    return view.moving
