"""Gear runs: a time series of axes that turn, with a gyroscope behind the gears, or with encoders on both
sides of them (theta_i beside q_i)."""

import numpy as np

from exactarm.data.kinds.base import STANDS_STILL, Device, Kind, check_time, file_of, has, rows_of_runs
from exactarm.data.kinds.gear_set_ups import set_ups_of_gyroscope
from exactarm.data.rows import Rows
from exactarm.errors import InputError
from exactarm.robot.robot import Robot


def has_both_encoders(data: Rows) -> bool:
    theta, q = data.joints.get("theta"), data.joints.get("q")
    return theta is not None and q is not None and bool((has(theta) & has(q)).any())


class _GearRun(Kind):
    name, device = "gear_run", Device.GEAR
    measured_as = "gear"
    anew = "Record the gears once more"

    def held_by(self, data: Rows) -> bool:
        return data.gyro is not None or has_both_encoders(data)

    def check(self, data: Rows, robot: Robot) -> None:
        theta = data.joints.get("theta")
        if theta is None:
            raise InputError("column missing; expected the motor angle of a gear run", file=file_of(data),
                             column="theta_1_rad")
        if not self.held_by(data):
            message = "column missing; expected gyro_x, gyro_y, gyro_z or a q_i beside theta_i for a gear run"
            raise InputError(message, file=file_of(data), column="gyro_x_rad_s")
        for index in np.flatnonzero(has(theta)):
            if not robot.joints[index].has_gear:
                raise InputError(f"robot {robot.name} declares no gear ratio for axis {index + 1}; expected "
                                 "one for a gear run", file=file_of(data), column=f"theta_{index + 1}")
        check_time(data)

    def set_ups(self, data: Rows, robot: Robot) -> np.ndarray:
        return data.session if data.gyro is None else set_ups_of_gyroscope(data, robot)

    def alike(self, data: Rows) -> list[np.ndarray]:
        """By which axes move and which way."""
        theta = np.nan_to_num(data.joints["theta"])
        sorts: dict[tuple[int, ...], list[int]] = {}
        for rows in rows_of_runs(data):
            sorts.setdefault(_sort_of_motion(theta[rows]), []).append(data.run[rows[0]])
        return [np.array(members) for _, members in sorted(sorts.items())]


def _sort_of_motion(theta: np.ndarray) -> tuple[int, ...]:
    """Per axis: 0 stands still, 2 to and fro, +1 or -1 one way."""
    span, net = np.ptp(theta, axis=0), theta[-1] - theta[0]
    one_way = np.abs(net) > 0.9 * span
    way = np.where(one_way, np.sign(net), 2.0)
    return tuple(int(value) for value in np.where(span > STANDS_STILL * max(span.max(), 1e-12), way, 0.0))


GEAR_RUN = _GearRun()
