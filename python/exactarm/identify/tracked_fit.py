"""Fits a layout to tracked motions: weighted least squares of the target's path (x, y, z) through the chain.

Of a run every k-th sample is taken, which is enough for what moves with the arm; rates are taken before
that, from all samples. Positions only: an orientation that the device may have measured too is left aside.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from exactarm.chain import (
    Layout,
    MotionRecord,
    PosePrediction,
    predict_tracked_motion,
    track_clear_of_reversals,
)
from exactarm.chain.motion_record import full_record
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES, TRACKED_MOTION
from exactarm.data.kinds.motion import TORQUES
from exactarm.data.split import DEFAULT_SEED
from exactarm.errors import InputError
from exactarm.identify.declared import carried_layout, frames_layout, require_geometry
from exactarm.identify.layout_fit import Drawing, fit_layout
from exactarm.identify.match import require_match
from exactarm.numerics.regression import Fit
from exactarm.robot.robot import Robot

KIND = TRACKED_MOTION.name
_ROWS = 2000  # that a fit works on, as long as they do not stand further apart than
_LONGEST_STEP_S, _SHAKEN_STEP_S = 0.04, 0.01  # the second where declared gear errors shake declared springs
_STATIC_ROWS = 400  # from which frames are found, as if the arm stood still in them
_LEAST_ROWS = 30  # of a run
# from the start of a run: its accelerations are not known well enough to tell how the springs swing
_STILL_S = 0.15
_FIRST_SIGMA_M = 1e-4
_TOLERANCE = 1e-7  # relative fall of the square sum that ends a fit


@dataclass(frozen=True)
class TrackedFit:
    """The layout at its estimate; sigma: standard deviation of a component, m, of independent rows;
    prediction of the fitted rows."""

    layout: Layout
    fit: Fit
    sigma: float
    prediction: PosePrediction


def tracked_record(data: Dataset, robot: Robot) -> MotionRecord:
    """All rows of a tracked motion with their rates. Raises InputError where a run is too short for them."""
    require_geometry(robot)
    runs, counts = np.unique(data.run, return_counts=True)
    if counts.size and counts.min() < _LEAST_ROWS:
        raise InputError(
            f"run {runs[counts.argmin()]} of a tracked motion has {counts.min()} samples; expected at least "
            f"{_LEAST_ROWS}",
            file=data.sources[0].path if data.sources else None)
    record = full_record(robot, data)
    inside = record.inside.copy()
    for rows in record.runs:
        inside[rows[record.data.time[rows] - record.data.time[rows[0]] < _STILL_S]] = False
    return track_clear_of_reversals(robot, replace(record, inside=inside))


def subsampled_record(record: MotionRecord, robot: Robot) -> MotionRecord:
    """Every k-th row of each run, with the rates that all rows gave."""
    shaken = (any(joint.spring_linear for joint in robot.joints)
              and any(joint.has_harmonics for joint in robot.joints))
    longest = _SHAKEN_STEP_S if shaken else _LONGEST_STEP_S
    every = max(1, min(len(record.data) // _ROWS, int(longest / record.step)))
    if every == 1:
        return record
    chosen = np.concatenate([rows[::every] for rows in record.runs])
    ends = np.cumsum([0] + [rows[::every].size for rows in record.runs])
    values = {item.name: getattr(record, item.name) for item in fields(record)}
    rows = len(record.data)
    by_row = {name: value[chosen] for name, value in values.items()
              if isinstance(value, np.ndarray) and len(value) == rows}
    return replace(record, data=record.data.select(chosen), step=every * record.step,
                   runs=tuple(np.arange(a, b) for a, b in zip(ends[:-1], ends[1:])), **by_row)


def tracked_frames(robot: Robot, data: Dataset, seed: int = DEFAULT_SEED) -> Layout:
    """Base and tool frames of every session as static poses would give them: near enough to start from."""
    frames, found = frames_layout(robot, static_rows(data), orientation=False, seed=seed)
    require_match(robot, data, found, carried_layout(robot, data), seed)
    return frames


def static_rows(data: Dataset) -> Dataset:
    """Some rows of each session, evenly spread, as poses."""
    chosen = [rows[:: max(1, rows.size // _STATIC_ROWS)] for rows in
              (np.flatnonzero(data.session == session) for session in np.unique(data.session))]
    still = data.select(np.concatenate(chosen))
    # of a motion, not of a load at rest
    joints = {name: values for name, values in still.joints.items() if name not in TORQUES}
    return replace(still, kind=POSES.name, joints=joints)


def predict_record(robot: Robot, layout: Layout, record: MotionRecord, *, tangents: bool = True,
                   threads: int = 1, bent=None):
    return predict_tracked_motion(robot, layout, record.data, record=record, tangents=tangents,
                                  threads=threads, bent=bent)


def fit_tracked(robot: Robot, layout: Layout, record: MotionRecord, *, weights: np.ndarray | None = None,
                sigma: float | None = None, threads: int = 1, drawing: Drawing | None = None) -> TrackedFit:
    """Estimates the free parameters of `layout`. weights (N,): square root of the independent numbers that a
    row's number is worth (correlated noise counts less). Rows at reversals that no model defines count for
    nothing. drawing: parameters that are drawn to their declared values."""

    accepted: list[PosePrediction] = []  # the last: a fit asks for tangents where it stands alone

    bent: dict[bytes, tuple | None] = {}  # of the point before: a step is tried before it is accepted

    def predict(at: Layout, with_jacobian: bool):
        prediction = predict_record(robot, at, record, tangents=with_jacobian, threads=threads,
                                    bent=bent.get(at.values.tobytes()))
        bent.clear()
        bent[at.values.tobytes()] = prediction.view.bent
        accepted[:] = [prediction] if with_jacobian else accepted
        return prediction.residual(), prediction.jacobian[:, :3] if with_jacobian else None

    weight = (~record.at_reversal).astype(float) * (1.0 if weights is None else weights)
    first = np.full(3, _FIRST_SIGMA_M if sigma is None else sigma)
    found = fit_layout(predict, layout, weight, first, alike=np.zeros(3, int), tolerance=_TOLERANCE,
                       drawing=drawing)
    return TrackedFit(found.layout, found.fit, float(found.sigma[0]), accepted[0])
