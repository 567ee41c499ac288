"""Rows of a motion whose prediction depends on how a gear passes, at a reversal, from one direction's table
to the other's.

No model defines the passage; the chain assumes one of TRANSITION_S (chain/direction.py). The
prediction is repeated with a shorter and a longer one about the reversal, and with two that lie whole behind
it, d the directions with each:

    row left out where max_j |predicted_j(d) - predicted_j(d of TRANSITION_S)| > SHARE sigma_j

sigma (m,): white noise of the measurement as it is compared with the prediction. The predictions contain what
a passage sets in motion behind it (springs, the low-pass), so that no length of time is assumed. Gears whose
two tables agree leave every row in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import product

import numpy as np

from exactarm.chain.direction import direction_of_motion
from exactarm.chain.gear import differs_with_direction
from exactarm.chain.layout import Layout
from exactarm.chain.motion import predict_motion
from exactarm.chain.motion_record import BANDWIDTH_HZ, MotionRecord, measured_torque
from exactarm.chain.tracked_motion import predict_tracked_motion
from exactarm.data.dataset import Dataset
from exactarm.data.kinds.base import runs_in_time
from exactarm.numerics.stamps import typical_step
from exactarm.numerics.white_noise import white_noise
from exactarm.robot.robot import Robot

# How long a passage lasts and how far behind the reversal its middle lies, s. What friction leaves of
# wind-up, 1e-4 to 1e-3 rad, is passed in 0.02 to 0.1 s at 2 rad/s^2 and twice that, about the reversal or,
# where it is let go as the axis moves away, behind it (blind tests, tracked motion 73200: 3.8 times the noise
# in the 50 ms behind reversals, nothing before them; motion 93074: 9.7 times). These four leave at most 0.06
# of the noise (root mean square) of passages of 10 to 70 ms at either place (test_passage.py).
ABOUT_S, BEHIND_S = ((0.02, 0.0), (0.1, 0.0)), ((0.05, 0.025), (0.1, 0.05))
# An axis that rests before it turns back holds its wind-up until it moves on: whatever is possible about and
# behind the middle of the rest is so about and behind its end.
RESTED = (0.5, 1.0)
LEAST_LEFT = 0.5  # of the rows; where fewer remained, those behind reversals stay: few rows are worse
SHARE = 0.3  # of the noise that an error may have unseen: a tenth of its variance
_LEAST_TORQUE_SHARE = 1e-3  # of an axis' torque, where a log is free of noise: no model of friction is better
_LEAST_NOISE_M = 5e-6  # of a position: what laser trackers resolve


def motion_clear_of_reversals(robot: Robot, record: MotionRecord, data: Dataset,
                              threads: int = 1) -> MotionRecord:
    """The record without such rows; data: the log that it was made from."""
    if not _reverses(robot, record):
        return record
    axes, torque = record.measured_axes, measured_torque(robot, data)
    runs = runs_in_time(data)
    white = np.array([_white(torque[:, axis], runs) for axis in axes])
    white *= np.sqrt(record.white_share(min(typical_step(data.time[rows]) for rows in runs)))
    noise = np.maximum(white, _LEAST_TORQUE_SHARE * np.sqrt(np.mean(record.torque[:, axes] ** 2, axis=0)))
    empty = Layout((), ())
    predict = lambda record: predict_motion(robot, empty, record, tangents=False,
                                            threads=threads).torque[:, axes]
    return _without_unclear(robot, record, predict, noise)


def track_clear_of_reversals(robot: Robot, record: MotionRecord) -> MotionRecord:
    """The same of a record of all rows under a tracker."""
    if not _reverses(robot, record):
        return record
    data, empty = record.data, Layout((), ())
    noise = np.array([max(_white(column, record.runs), _LEAST_NOISE_M) for column in data.position.T])
    predict = lambda of: predict_tracked_motion(robot, empty, data, record=of, tangents=False).position
    return _without_unclear(robot, record, predict, noise)


def reversals_left_out(records: Iterable[MotionRecord]) -> tuple[str, ...]:
    """In words, how many rows these records leave out, and how many stay for want of others, and what the
    noise of the angles leaves; empty where none."""
    records = tuple(records)
    out, rows, stay = (sum(int(np.sum(part)) for part in parts)
                       for parts in zip(*((r.at_reversal & r.inside, r.inside, r.behind_kept)
                                          for r in records)))
    words = (f"{out} of {rows} rows at reversals were left out: how a gear passes there from one direction's "
             "table to the other's is not known",) if out else ()
    if stay:
        words += (f"{stay} of {rows} rows behind reversals stay, though a gear may pass there, too: fewer "
                  "than half of the rows would be left; longer strokes part the two",)
    return words + _noise_of_angles(records)


def _noise_of_angles(records: Iterable[MotionRecord]) -> tuple[str, ...]:
    """In words, below what frequency torques are compared because angles are rounded or noisy, and how many
    rows count for nothing because a rounded axis creeps."""
    known = [record for record in records if record.noise is not None and record.bandwidth_hz is not None
             and record.noise.quiet_below < BANDWIDTH_HZ]
    if not known:
        return ()
    step = max(float(np.max(record.noise.step)) for record in known)
    angles = f"rounded to {np.degrees(step):.2g} degrees" if step else "noisy"
    creep = sum(int(np.sum(record.creeping & record.inside)) for record in known)
    rows = sum(int(np.sum(record.inside)) for record in known)
    slow = (f", and {creep} of {rows} rows at which an axis creeps were left out: its angle does not say "
            "when it turns" if creep else "")
    return (f"the angles are {angles}: torques are compared below {known[0].bandwidth_hz:.2g} Hz{slow}",)


def _reverses(robot: Robot, record: MotionRecord) -> bool:
    differing = [differs_with_direction(joint) for joint in robot.joints]
    return bool(np.any(np.mod(record.direction[:, differing], 1.0)))


def _without_unclear(robot: Robot, record: MotionRecord, predict: Callable[[MotionRecord], np.ndarray],
                     noise: np.ndarray) -> MotionRecord:
    """The record without rows that a passage moves by more than a share of the noise (m,)."""
    assumed, angle = predict(record), record.theta / np.abs(robot.ratios)

    def by(passages) -> np.ndarray:
        unclear, directions = np.zeros(len(record.data), bool), {}
        for (duration, late), rested in product(passages, RESTED):
            direction = np.empty_like(record.direction)
            for rows in record.runs:
                direction[rows] = direction_of_motion(record.data.time[rows], angle[rows], duration, late,
                                                      rested)
            directions[direction.tobytes()] = direction  # alike where no axis rests
        for direction in directions.values():
            other = predict(replace(record, direction=direction))
            unclear |= np.any(np.abs(other - assumed) > SHARE * noise, axis=1)
        return unclear

    about = by(ABOUT_S)
    either = about | by(BEHIND_S)
    if np.mean(~either[record.inside]) >= LEAST_LEFT:
        return replace(record, at_reversal=either)
    return replace(record, at_reversal=about, behind_kept=int(np.sum((either & ~about)[record.inside])))


def _white(values: np.ndarray, runs) -> float:
    """Of a signal (N,), over all runs."""
    return float(np.sqrt(np.mean([white_noise(values[rows]) ** 2 for rows in runs])))
