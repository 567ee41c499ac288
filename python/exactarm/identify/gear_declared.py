"""The declared model of a gear run: what is re-identified when nothing else is asked for.

Harmonic coefficients of the declared tables, per direction of motion; the constant tilt of the gyroscope, one
pair of angles for each set-up and moving axis, started from the closed form of (3.3); with encoders on both
sides one offset for each run and axis. Not the ratio. Effects that the robot file carries are held at their
values.
"""

import numpy as np

from exactarm.chain import GearRecord, Layout
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import GEAR_RUN
from exactarm.data.kinds.base import rows_of_runs
from exactarm.effects.declared_harmonics import DeclaredHarmonics
from exactarm.effects.encoder_offset import EncoderOffset
from exactarm.effects.gyro_alignment import GyroAlignment, aligning_angles
from exactarm.effects.gyro_bias import GyroBias
from exactarm.identify.declared import carried_layout
from exactarm.robot.robot import Robot

SIDES = {"cw": -1.0, "ccw": 1.0}


def declared_gear_layout(robot: Robot, data: Dataset, record: GearRecord) -> Layout:
    """Harmonics, sensor, and the effects on file."""
    sensor, carried = sensor_layout(robot, data, record), carried_layout(robot, data, GEAR_RUN.name)
    return harmonics_layout(robot, record).joined(sensor).joined(carried)


def harmonics_layout(robot: Robot, record: GearRecord) -> Layout:
    """The tables of the moving axes, each in the directions in which the axis moves in these data."""
    effects = []
    for axis in measured_axes(record):
        for side, way in SIDES.items():
            seen = np.any(record.keep & (record.direction[:, axis] == way))
            if robot.joints[axis].has_harmonics and seen:
                effects.append(DeclaredHarmonics.of(robot, axis, side))
    return Layout.of(tuple(effects))


def sensor_layout(robot: Robot, data: Dataset, record: GearRecord, *, bias: bool = False,
                  chosen: np.ndarray | None = None) -> Layout:
    """What belongs to the set-up: alignment (and bias) of the gyroscope, or the offsets between two encoders;
    started from the `chosen` rows (N,) alone."""
    if record.encoder_axes:
        return _offsets(robot, data, record)
    effects: list = list(alignments(robot, data, record, chosen))
    return Layout.of((*effects, GyroBias(None, (0.0, 0.0, 0.0))) if bias else tuple(effects))


def alignments(robot: Robot, data: Dataset, record: GearRecord,
               chosen: np.ndarray | None = None) -> list[GyroAlignment]:
    """Closed form of (3.3): the reading's direction, weighted with the motor's (signed) rate, onto z."""
    sensor_axis = record.sensor_axis
    usable = np.ones(len(data), bool) if chosen is None else chosen
    found = []
    for session in np.unique(data.session):
        for axis in np.unique(sensor_axis[usable & (data.session == session)]):
            rows = np.flatnonzero(usable & (data.session == session) & (sensor_axis == axis))
            direction = data.gyro[rows].T @ (record.theta_dot[rows, axis] / robot.ratios[axis])
            if not np.any(direction):
                continue
            flipped = bool(direction[2] < 0.0)
            angles = aligning_angles(-direction if flipped else direction)
            found.append(GyroAlignment(int(axis) + 1, angles, int(session), flipped))
    return found


def _offsets(robot: Robot, data: Dataset, record: GearRecord) -> Layout:
    effects = []
    for rows in rows_of_runs(data):
        for column, axis in enumerate(record.encoder_axes):
            predicted = record.theta[rows, axis] / robot.ratios[axis] + robot.offsets[axis]
            start = float(np.mean(data.joints["q"][rows, axis] - predicted))
            effects.append(EncoderOffset(axis + 1, (start,), int(data.run[rows[0]]), column))
    return Layout.of(tuple(effects))


def measured_axes(record: GearRecord) -> tuple[int, ...]:
    """Axes (from 0) whose gears these data show."""
    seen = record.encoder_axes or sorted(set(record.furthest))
    return tuple(axis for axis in seen if record.moving[axis])
