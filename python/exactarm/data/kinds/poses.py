"""Poses at rest, each seen by a tracker: x, y, z (with or without an orientation), no time series."""

from exactarm.data.kinds.base import Device, Kind, check_positions, is_a_series
from exactarm.data.rows import Rows
from exactarm.robot.robot import Robot


class _Poses(Kind):
    name, device, at_rest, alone = "poses", Device.TARGET, True, True
    rows, row, error = "poses", "pose", "position error"
    measured_as = "poses"
    anew = "Measure some twenty new poses"

    def held_by(self, data: Rows) -> bool:
        return data.position is not None and not is_a_series(data)

    def check(self, data: Rows, robot: Robot) -> None:
        check_positions(data, robot)


POSES = _Poses()
