"""Motions with the torques of the drives: a time series with tau_i, tau_motor_i or current_i."""

import numpy as np

from exactarm.data.kinds.base import Device, Kind, check_joints, check_time, file_of, runs_by_session
from exactarm.data.rows import Rows
from exactarm.errors import InputError
from exactarm.robot.robot import Robot

TORQUES = ("tau", "tau_motor", "current")


class _Motion(Kind):
    name, device = "motion", Device.DRIVES
    measured_as = "motion"
    anew = "Record another motion"

    def held_by(self, data: Rows) -> bool:
        return any(name in data.joints for name in TORQUES)

    def alike(self, data: Rows) -> list[np.ndarray]:
        """All runs; where payloads are to be estimated by session, those of one session."""
        return runs_by_session(data) if data.unweighed else super().alike(data)

    def check(self, data: Rows, robot: Robot) -> None:
        if not self.held_by(data):
            message = "column missing; expected tau_i, tau_motor_i or current_i for a motion"
            raise InputError(message, file=file_of(data), column="tau_1_Nm")
        check_joints(data, robot)
        check_time(data)


MOTION = _Motion()
