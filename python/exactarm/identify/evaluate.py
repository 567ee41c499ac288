"""The error of a robot file, as it is, on data it has not seen: only what belongs to the set-up is fitted.

Poses and tracked motions: base and tool frames of every session. Closures: contacts and tool. Gear runs:
alignment and bias of the gyroscope. Torques: nothing. One
function a kind of data, found by its name in `EVALUATORS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from exactarm.chain import MotionRecord, reversals_left_out
from exactarm.chain.extrapolation import extrapolations
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import CLOSURES, GEAR_RUN, MOTION, POSES, TRACKED_MOTION
from exactarm.data.split import DEFAULT_SEED
from exactarm.identify.closures import (
    carried_effects,
    gravity_alone,
    nominal_closures,
    set_distance_errors,
    tilt_error,
)
from exactarm.identify.declared import carried_layout, frames_layout, require_geometry
from exactarm.identify.evaluation import Evaluation
from exactarm.identify.gear_evaluate import evaluate_gear_runs
from exactarm.identify.judged_rows import judged_rows, unjudged_lines
from exactarm.identify.match import require_match
from exactarm.identify.motion_evaluate import evaluate_motion
from exactarm.identify.planned import controller_angles
from exactarm.identify.pose_fit import fit_poses
from exactarm.identify.tracked_fit import (
    fit_tracked,
    predict_record,
    subsampled_record,
    tracked_frames,
    tracked_record,
)
from exactarm.measurement.closures import touches
from exactarm.robot.robot import Robot

GRAVITY_COLUMNS = ("d1_rad", "d2_rad", "d3_rad")  # of the sensor's axes
RESIDUAL_COLUMNS = ("dx_m", "dy_m", "dz_m", "drx_rad", "dry_rad", "drz_rad")


# rows by which the nine numbers of a set-up are fitted: noise leaves a hundredth of itself in them
MOST_FITTED = 20000
LEAST_FITTED = 200  # of a session
BLOCK_ROWS = 20000  # 9 kB a row at work


def evaluate_poses(robot: Robot, data: Dataset, seed: int = DEFAULT_SEED, threads: int = 1) -> Evaluation:
    """Frames of each session fitted by position alone; everything else as the file says.

    Above `MOST_FITTED` rows the frames are fitted on so many, evenly spread; all rows are judged, in blocks,
    so that memory does not grow with them by more than the data themselves.
    """
    require_geometry(robot)
    fitted = data.select(_spread(data)) if len(data) > MOST_FITTED else data
    frames, found = frames_layout(robot, fitted, orientation=False, seed=seed)
    require_match(robot, fitted, found, carried_layout(robot, fitted), seed)
    fit = fit_poses(robot, frames.joined(carried_layout(robot, data)), fitted, threads=threads)
    starts = range(0, len(data), BLOCK_ROWS)
    blocks = (data.select(np.arange(start, min(start + BLOCK_ROWS, len(data)))) for start in starts)
    found = _of_positions(robot, data, np.concatenate([fit.residual(block, threads) for block in blocks]))
    return replace(found, frames=fit.layout.only(range(len(frames.effects))))


def _spread(data: Dataset) -> np.ndarray:
    """`MOST_FITTED` rows or a little more, each session by its share, evenly spread over it."""
    every = len(data) / MOST_FITTED
    parts = []
    for session in np.unique(data.session):
        rows = np.flatnonzero(data.session == session)
        count = min(rows.size, max(LEAST_FITTED, int(rows.size / every)))
        parts.append(rows[np.unique(np.linspace(0, rows.size - 1, count).astype(int))])
    return np.sort(np.concatenate(parts))


def evaluate_tracked_motion(robot: Robot, data: Dataset, seed: int = DEFAULT_SEED,
                            threads: int = 1) -> Evaluation:
    """The path of every sample, with the frames of each session fitted."""
    record = tracked_record(data, robot)
    layout = tracked_frames(robot, data, seed).joined(carried_layout(robot, data, TRACKED_MOTION.name))
    fit = fit_tracked(robot, layout, subsampled_record(record, robot), threads=threads)
    residual = predict_record(robot, fit.layout, record, tangents=False, threads=threads).residual()
    return _of_positions(robot, data, residual, record)


def _of_positions(robot: Robot, data: Dataset, residual: np.ndarray,
                  record: MotionRecord | None = None) -> Evaluation:
    """record: of a motion, whose rows at reversals are not judged."""
    judged = np.ones(len(data), bool) if record is None else ~record.at_reversal
    warnings = (*extrapolations(robot, controller_angles(robot, data)),
                *(() if record is None else reversals_left_out([record])))
    return Evaluation.of("m", np.linalg.norm(residual, axis=1), residual, ("dx_m", "dy_m", "dz_m"),
                         data.session, judged, warnings=warnings)


def evaluate_closures(robot: Robot, data: Dataset, seed: int = 0, threads: int = 1) -> Evaluation:
    """The distance of each touch from its contact; contacts and tool are fitted, without known lengths."""
    rows = touches(data)
    fit = nominal_closures(robot, rows, carried_effects(robot, rows), seed, threads)
    residual = fit.prediction.seen
    warnings = (*extrapolations(robot, controller_angles(robot, rows)), *unjudged_lines(rows))
    if not fit.fit.converged:
        warnings = (*warnings, f"the fit of contacts and tool did not converge ({fit.fit.reason})")
    unit, columns = ("rad", GRAVITY_COLUMNS) if gravity_alone(rows) else ("m", RESIDUAL_COLUMNS)
    return Evaluation.of(
        unit, fit.prediction.error(), residual, columns[: residual.shape[1]], rows.session, judged_rows(rows),
        warnings=warnings, data=rows, distances=set_distance_errors(robot, fit.layout, rows, threads),
        tilt=tilt_error(fit.prediction), pixels=fit.prediction.reprojection())


EVALUATORS: dict[str, Callable[..., Evaluation]] = {
    POSES.name: evaluate_poses, GEAR_RUN.name: evaluate_gear_runs,
    TRACKED_MOTION.name: evaluate_tracked_motion,
    CLOSURES.name: evaluate_closures, MOTION.name: evaluate_motion,
}
