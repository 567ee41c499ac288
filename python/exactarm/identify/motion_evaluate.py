"""The torque error of a robot file, as it is, on a motion that it has not seen: nothing is fitted to it.

Measured and predicted drive torque pass the low-pass of an identification (chain/motion_record.py). How dry
friction turns over at a reversal, and what it held at the start of a run, is no property that a robot file
declares: it is taken from the motion, as `identify` does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm.chain import (
    MotionRecord,
    motion_clear_of_reversals,
    motion_record,
    predict_motion,
    reversals_left_out,
)
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import MOTION
from exactarm.errors import InputError
from exactarm.identify.declared import carried_layout, require_geometry
from exactarm.identify.dynamics import friction_layout
from exactarm.identify.evaluation import Evaluation
from exactarm.identify.friction_width import dry_friction
from exactarm.robot.robot import Robot


def evaluate_motion(robot: Robot, data: Dataset, seed: int = 0, threads: int = 1) -> Evaluation:
    """Measured less predicted drive torque, RMS over the axes that measure. Raises InputError where the robot
    file has no masses."""
    require_geometry(robot)
    if robot.links is None:
        raise InputError(f"{robot.name} has no masses, so it predicts no torques; expected a robot file as "
                         "`exactarm identify` writes it",
                         file=data.first_file)
    record: MotionRecord = motion_clear_of_reversals(robot, motion_record(robot, data, None), data, threads)
    carried = carried_layout(robot, data, MOTION.name)
    layout = friction_layout(robot, record).joined(carried)
    record = replace(record, dry=dry_friction(robot, layout, record, threads))
    axes, keep = record.measured_axes, record.keep
    residual = predict_motion(robot, carried, record, tangents=False,
                              threads=threads).residual()[keep][:, axes]
    judged, error = record.data.select(keep), np.sqrt(np.mean(residual**2, axis=1))
    return Evaluation.of("Nm", error, residual, tuple(f"dtau_{axis + 1}_Nm" for axis in axes), judged.session,
                         np.ones(len(judged), bool), warnings=reversals_left_out([record]), data=judged)
