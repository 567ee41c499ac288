"""The error of a robot's gears, as its file has them, on gear runs that it has not seen.

Only the set-up is fitted: alignment and bias of the gyroscope, or one offset for each run and axis between
two encoders. The error is the unfiltered rate along the moving axis, or the angle.
"""

from __future__ import annotations

import numpy as np

from exactarm.chain import gear_record
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import GEAR_RUN
from exactarm.identify.declared import carried_layout
from exactarm.identify.evaluation import Evaluation
from exactarm.identify.gear_declared import sensor_layout
from exactarm.identify.gear_fit import fit_gear_runs
from exactarm.identify.sensor_tone import find_tones, without_tones
from exactarm.robot.robot import Robot


def evaluate_gear_runs(robot: Robot, data: Dataset, seed: int = 0, threads: int = 1) -> Evaluation:
    """Fits the set-up on all rows that count; what is left on every row, tones of the sensor aside: the
    magnitude along the moving axis (RMS over the axes between encoders)."""
    data = without_tones(data, find_tones(data))
    record = gear_record(robot, data)
    layout = sensor_layout(robot, data, record, bias=True).joined(carried_layout(robot, data, GEAR_RUN.name))
    prediction = fit_gear_runs(robot, layout, data, record=record, threads=threads).prediction
    residual = prediction.residual()
    if prediction.along is None:
        unit, columns = "rad", tuple(f"dq_{axis + 1}_rad" for axis in record.encoder_axes)
        error = np.sqrt(np.mean(residual**2, axis=1))
    else:
        unit, columns = "rad/s", tuple(f"dgyro_{axis}_rad_s" for axis in "xyz")
        error = np.abs(np.einsum("ij,ij->i", residual, prediction.along))
    return Evaluation.of(unit, error, residual, columns, data.session, prediction.keep)
