"""The error of a robot file, as it is, on data it has not seen: only what belongs to the set-up is fitted.

Poses and tracked motions: base and tool frames of every session. Closures: contacts and tool. Gear runs:
alignment and bias of the gyroscope, or one offset for each run and axis between two encoders; the error is
the unfiltered rate along the moving axis, or the angle. Torques: nothing; measured and predicted ones pass
the low-pass of an identification (chain/motion_record.py). How dry friction turns over at a reversal, and
what it held at the start of a run, is no property that a robot file declares: it is taken from the motion, as
`identify` does. One function a kind of data, found by its name in `EVALUATORS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from exactarm.chain import (
    Layout,
    MotionRecord,
    gear_record,
    motion_clear_of_reversals,
    motion_record,
    predict_motion,
    reversals_left_out,
)
from exactarm.chain.extrapolation import extrapolations
from exactarm.chain.idle_encoders import without_idle_encoders
from exactarm.data.dataset import Dataset
from exactarm.data.even_readings import at_even_readings
from exactarm.data.kinds import CLOSURES, GEAR_RUN, MOTION, POSES, TRACKED_MOTION
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.identify.closures import (
    carried_effects,
    gravity_alone,
    nominal_closures,
    set_distance_errors,
    tilt_error,
)
from exactarm.identify.declared import carried_layout, frames_layout, require_geometry
from exactarm.identify.dynamics import friction_layout
from exactarm.identify.friction_width import dry_friction
from exactarm.identify.gear_declared import sensor_layout
from exactarm.identify.gear_fit import fit_gear_runs
from exactarm.identify.judged_rows import judged_rows, unjudged_lines
from exactarm.identify.match import require_match
from exactarm.identify.planned import controller_angles
from exactarm.identify.pose_fit import fit_poses
from exactarm.identify.sensor_tone import find_tones, without_tones
from exactarm.identify.statistics import ErrorSummary, summarise
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


@dataclass(frozen=True)
class Evaluation:
    """error (N,) of every row in `unit`; residual (N, m) with its column names; summaries overall and by
    session.

    rows: how many are summarised; by_axis: every axis of a row by itself. warnings: effects that are used
    where they were never measured. data: the rows, where they are not those of the file (closures);
    distances: of closures, known distance -> |error| in m; tilt: mean angle in rad by which gravity's
    direction is missed; pixels: RMS that corners in pictures are missed by.
    """

    unit: str
    error: np.ndarray
    residual: np.ndarray
    columns: tuple[str, ...]
    overall: ErrorSummary
    sessions: tuple[tuple[int, ErrorSummary], ...]
    rows: int
    by_axis: bool = False
    warnings: tuple[str, ...] = ()
    data: Dataset | None = None
    distances: dict[str, float] | None = None
    frames: Layout | None = None  # as fitted, of poses
    tilt: float | None = None
    pixels: float | None = None

    @staticmethod
    def of(unit: str, error: np.ndarray, residual: np.ndarray, columns: tuple[str, ...], session: np.ndarray,
           judged: np.ndarray, each: np.ndarray | None = None, **more: Any) -> Evaluation:
        """session (N,) of the rows; judged (N,) bool: those that are summarised; each (N, k): by what, where
        a row has several errors."""
        values = error[:, None] if each is None else each
        over = lambda rows: summarise(values[rows].ravel())
        sessions = tuple((int(s), over(judged & (session == s))) for s in np.unique(session))
        return Evaluation(unit, error, residual, columns, over(judged), sessions, int(judged.sum()),
                          each is not None, **more)


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


def evaluate_gear_runs(robot: Robot, data: Dataset, seed: int = 0, threads: int = 1) -> Evaluation:
    """Fits the set-up on all rows that count; what is left on every row, tones of the sensor aside: the
    magnitude along the moving axis. Between encoders a row's error is the RMS over the axes, and every axis
    counts by itself in the summaries."""
    data, = map(at_even_readings, without_idle_encoders(robot, data))
    data = without_tones(data, find_tones(data))
    record = gear_record(robot, data)
    layout = sensor_layout(robot, data, record, bias=True).joined(carried_layout(robot, data, GEAR_RUN.name))
    prediction = fit_gear_runs(robot, layout, data, record=record, threads=threads).prediction
    residual = prediction.residual()
    if prediction.along is None:
        unit, columns = "rad", tuple(f"dq_{axis + 1}_rad" for axis in record.encoder_axes)
        each, error = np.abs(residual), np.sqrt(np.mean(residual**2, axis=1))
    else:
        unit, columns = "rad/s", tuple(f"dgyro_{axis}_rad_s" for axis in "xyz")
        each, error = None, np.abs(np.einsum("ij,ij->i", residual, prediction.along))
    return Evaluation.of(unit, error, residual, columns, data.session, prediction.keep, each)


def evaluate_motion(robot: Robot, data: Dataset, seed: int = 0, threads: int = 1) -> Evaluation:
    """Measured less predicted drive torque. A row's error is the RMS over the axes that measure; every axis
    counts by itself in the summaries. Raises InputError where the robot file has no masses."""
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
                         np.ones(len(judged), bool), np.abs(residual), warnings=reversals_left_out([record]),
                         data=judged)


EVALUATORS: dict[str, Callable[..., Evaluation]] = {
    POSES.name: evaluate_poses, GEAR_RUN.name: evaluate_gear_runs,
    TRACKED_MOTION.name: evaluate_tracked_motion,
    CLOSURES.name: evaluate_closures, MOTION.name: evaluate_motion,
}
