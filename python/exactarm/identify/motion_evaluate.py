"""The torque error of a robot file, as it is, on a motion that it has not seen: nothing is fitted to it.

Measured and predicted drive torque pass the low-pass of an identification (chain/motion_record.py). How
sharply dry friction turns over at a reversal is no property that a robot file declares: it is taken from the
motion, as `identify` does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import (
    MotionRecord,
    motion_clear_of_reversals,
    motion_record,
    predict_motion,
    reversals_left_out,
)
from exactarm.dataset import Dataset
from exactarm.errors import InputError
from exactarm.identify.declared import carried_layout, require_geometry
from exactarm.identify.dynamics import friction_layout
from exactarm.identify.friction_width import friction_widths
from exactarm.kinds import MOTION
from exactarm.robot import Robot


@dataclass(frozen=True)
class MotionError:
    """data: the rows that are judged; error (N,) Nm, RMS over the axes that measure; residual (N, m) with its
    column names."""

    data: Dataset
    error: np.ndarray
    residual: np.ndarray
    columns: tuple[str, ...]
    warnings: tuple[str, ...]


def motion_error(robot: Robot, data: Dataset, threads: int = 1) -> MotionError:
    """Measured less predicted drive torque. Raises InputError where the robot file has no masses."""
    require_geometry(robot)
    if robot.links is None:
        raise InputError(f"{robot.name} has no masses, so it predicts no torques; expected a robot file as "
                         "`exactarm identify` writes it",
                         file=data.first_file)
    record: MotionRecord = motion_clear_of_reversals(robot, motion_record(robot, data, None), data, threads)
    carried = carried_layout(robot, data, MOTION.name)
    layout = friction_layout(robot, record).joined(carried)
    record = replace(record, sign_width=friction_widths(robot, layout, record, threads))
    axes, keep = record.measured_axes, record.keep
    residual = predict_motion(robot, carried, record, tangents=False,
                              threads=threads).residual()[keep][:, axes]
    columns = tuple(f"dtau_{axis + 1}_Nm" for axis in axes)
    return MotionError(record.data.select(keep), np.sqrt(np.mean(residual**2, axis=1)), residual, columns,
                       reversals_left_out([record]))
