"""Tracked motions: a time series in which a tracker follows the target, x, y, z."""

import numpy as np

from exactarm.data.kinds.base import Device, Kind, check_positions, check_time, runs_by_session
from exactarm.data.rows import Rows
from exactarm.robot.robot import Robot


class _TrackedMotion(Kind):
    name, device, error = "tracked_motion", Device.TARGET, "position error"
    measured_as = "tracked"
    anew = "Track another path"

    def alike(self, data: Rows) -> list[np.ndarray]:
        """Those of one session, whose frames no other shows."""
        return runs_by_session(data)

    def held_by(self, data: Rows) -> bool:
        return data.position is not None

    def check(self, data: Rows, robot: Robot) -> None:
        check_positions(data, robot)
        check_time(data)


TRACKED_MOTION = _TrackedMotion()
