"""Tracked motions as a diagnosis problem: residual = measured minus predicted path of the target (N, 3), m.

Re-identified as for static poses: geometry, joint offsets, gear ratios and frames; all but the frames are
drawn to their declared values as much as the data say (identify/drawing.py). Neighbouring samples share
their noise (a swinging arm, a device that wanders): they count as fewer, and whole runs or long pieces of
them are held out. Fitted and searched on subsampled runs, judged on all samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout, MotionRecord, reversals_left_out
from exactarm.data.dataset import Dataset
from exactarm.diagnose.coloured_noise import ColouredNoise
from exactarm.diagnose.fitted import Fitted, rows_kept
from exactarm.diagnose.next_motions import separating_motion
from exactarm.diagnose.not_noise import WANDERS_AT
from exactarm.diagnose.problem_in_time import LEAST_SIGMA, ProblemInTime
from exactarm.diagnose.signal import Direction, Quantity, Signal, Structure, axis_of, movement_of
from exactarm.diagnose.smoothness import second_order
from exactarm.effects.base import Effect, Station
from exactarm.identify.calibrate import calibrated_robot, identifiable_layout, require_sessions
from exactarm.identify.declared import geometry_layout, reestimated_layout
from exactarm.identify.drawing import Drawn
from exactarm.identify.layout_fit import Drawing
from exactarm.identify.tracked_fit import (
    KIND,
    fit_tracked,
    predict_record,
    static_rows,
    subsampled_record,
    tracked_frames,
    tracked_record,
)
from exactarm.identify.wild_rows import left_out_line, single_wild_rows
from exactarm.robot.robot import Robot

# a path is played again: its motor angles, over their ratios, differ by less at every sample
_SAME_PATH_RAD = 1e-3
_LEAST_REPEATED = 100  # samples
_LEAST_SEEN = 1e-7  # m: a tracker resolves no less; below, it is the arithmetic of exact data
# s: memory of a filtered reading, and of what moves with the arm as it goes by
_REMEMBERED_S, _WANDERS_S = 0.25, 2.0


@dataclass(frozen=True)
class TrackedFitted(Fitted):
    """Columns of most effects straight from their station; what changes the load goes through the springs."""

    def responses_of(self, effects: list[Effect]) -> list[np.ndarray]:
        return [self._response(effect) for effect in effects]

    def _response(self, effect: Effect) -> np.ndarray:
        view = self.view
        if effect.station == Station.LOAD:
            return view.response(effect)[:, :3]
        change = effect.change(view)
        columns, moved = list(change.columns), change.by_parameters
        if effect.station in (Station.GEOMETRY, Station.DEVICE):
            response = np.zeros((view.rows, 6, moved.shape[2]))
            response[:, columns] = moved
            return response[:, :3]
        if effect.station == Station.MOTOR:
            moved = moved / view.robot.ratios[columns, None]
        slope = view.target_by("q")[:, :3, columns]
        return slope * moved if len(columns) == 1 else slope @ moved


class TrackedProblem(ProblemInTime):
    """One or several runs of all axes under a tracker."""

    unit = "m"
    numbers_of_error = 3
    kind = KIND
    repeat_source = "paths that were played again"
    unknown_rivals = drafts = True
    motors_within_revolutions = False
    share_left = 0.02  # thousands of rows show a smaller one

    def __init__(self, robot: Robot, data: Dataset, held_out: Dataset, threads: int = 1, seed: int = 0):
        super().__init__(robot, data, held_out, threads, seed)
        if len(held_out):
            require_sessions(data, held_out)
        self.record = subsampled_record(self._records["identification"], robot)
        self._estimator = ColouredNoise(self, short=_REMEMBERED_S)
        self._left_out = reversals_left_out(self._records.values())
        self._drawing: Drawing = {}  # see declared()

    def _new_record(self, data: Dataset) -> MotionRecord:
        return tracked_record(data, self.robot)

    def declared(self) -> Layout:
        frames = tracked_frames(self.robot, self.data, self.seed)
        arm, estimated = geometry_layout(self.robot), reestimated_layout(self.robot, self.data, KIND)
        layout = frames.joined(arm).joined(estimated)
        still = static_rows(self.data)
        kept, _ = identifiable_layout(self.robot, layout, still, False, threads=self.threads)
        first = self.fit(kept)
        if self._leave_out(first):
            first = self.fit(kept)
        # What the first fit says of what the path hardly tells is noise and what hides in the data: held
        # there, or at its declared value, it would leave a trace that an effect of a wrong axis explains, and
        # free beside a cause that does the same (a preload and a zero) it would run off by a radian.
        others = {name: (float(value), p.plausible) for name, value, p in
                  zip(estimated.names, estimated.values, estimated.parameters) if np.isinf(p.prior)}
        self._drawing = others | Drawn.around(arm, kept, first.fit).to
        drawn_fit = self.fit(kept)  # a prior weighs as much as the independent numbers beside it let it
        if drawn_fit.fit.converged:
            self._noise = drawn_fit.noise
            return kept
        self._drawing = {}  # held, where the path bends along what it cannot tell
        # As if every other sample had told nothing new: the sigma of independent rows, at the number of rows
        # used here.
        sigma = first.sigma[:1] * np.sqrt(len(still) / len(self.record.data))
        near = Layout(first.layout.effects, kept.free)
        return identifiable_layout(self.robot, near, still, False, sigma, self.threads)[0]

    def _leave_out(self, fitted: Fitted) -> bool:
        """Whether single readings jump away from the path and back: those count nowhere any more."""
        before = self.record
        for name, data in (("identification", self.data), ("validation", self.held_out)):
            if name not in self._records:
                continue
            record, error = self._records[name], self.errors(fitted, data)
            known = np.isfinite(error)
            wild = np.zeros(error.size, bool)
            runs = [np.flatnonzero(np.isin(np.flatnonzero(known), rows)) for rows in record.runs]
            wild[known] = single_wild_rows(error[known], runs)
            if wild.any():
                self._records[name] = replace(record, at_reversal=record.at_reversal | wild)
                self._left_out += (left_out_line(error, wild),)
                self.record = subsampled_record(self._records["identification"], self.robot)
        return self.record is not before

    def fit(self, layout: Layout, weight: np.ndarray | None = None,
            sigma: np.ndarray | None = None) -> Fitted:
        share, rows = self._noise.share, np.ones(len(self.record.data)) if weight is None else weight
        start = None if sigma is None else float(sigma[0] * np.sqrt(share))
        found = fit_tracked(
            self.robot, layout, self.record, weights=rows * np.sqrt(share), sigma=start, threads=self.threads,
            drawing=self._drawing)
        prediction, clear = found.prediction, ~self.record.at_reversal & (rows > 0.0)
        residual, view = np.where(clear[:, None], prediction.residual(), 0.0), prediction.view
        view.signals["residual"] = residual
        fitted = TrackedFitted(
            robot=self.robot, layout=found.layout, fit=found.fit, residual=residual,
            jacobian=prediction.jacobian[:, :3], sigma=np.full(3, max(found.sigma, LEAST_SIGMA)),
            weight=clear.astype(float), view=view, drawing=self._drawing)
        return self._counted(fitted, self._noise, self.record.step)

    def errors(self, fitted: Fitted, data: Dataset) -> np.ndarray:
        record = self._record_of(data)
        prediction = predict_record(self.robot, fitted.layout, record, tangents=False, threads=self.threads)
        error = np.linalg.norm(prediction.residual(), axis=1)
        return np.where(rows_kept(fitted.layout, prediction.view) & ~record.at_reversal, error, np.nan)

    def held_out_picture(self, fitted: Fitted) -> tuple[np.ndarray, np.ndarray] | None:
        if "validation" not in self._records:
            return None
        record = self._records["validation"]
        prediction = predict_record(self.robot, fitted.layout, record, threads=self.threads)
        rows = rows_kept(fitted.layout, prediction.view) & ~record.at_reversal
        return prediction.residual()[rows], prediction.jacobian[rows, :3]

    def left_out(self) -> tuple[str, ...]:
        return self._left_out

    def stretches(self) -> np.ndarray | None:
        run = self.record.data.run
        # a part of one run says little about the angles of the rest
        return run if np.unique(run).size > 1 else None

    def signals(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        view = fitted.view
        rate = view.signals["theta_dot"] / self.robot.controller_ratios
        moving = np.flatnonzero(view.moving)
        own = self._signals(view, self.record.data, moving, rate, view.direction)
        place = {Signal(Quantity.POSITION, part=axis): view.signals["target"][:, k]
                 for k, axis in enumerate("xyz")}
        return own | {name: values for name, values in place.items() if np.ptp(values) > 0.0}

    def space(self, fitted: Fitted) -> tuple[Signal, np.ndarray]:
        """Where the target is, in spreads of the path."""
        target = fitted.view.signals["target"]
        return Signal(Quantity.PLACE), target / np.sqrt(np.mean(np.var(target, axis=0)))

    def independent_rows(self, fitted: Fitted) -> np.ndarray:
        """Numbers of rows in use, further apart than noise that a filter makes remembers."""
        used = np.flatnonzero(fitted.weight > 0.0)
        slot = np.floor(self.record.data.time[used] / _REMEMBERED_S).astype(int)
        _, first = np.unique(np.stack([self.record.data.run[used], slot]), axis=1, return_index=True)
        return np.sort(used[first])

    def apart(self, rows: np.ndarray) -> np.ndarray:
        run, time = self.record.data.run[rows], self.record.data.time[rows]
        return (run[:, None] != run) | (np.abs(time[:, None] - time) > _WANDERS_S)

    def surfaces(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        return {Signal(Quantity.TWO_ANGLES): second_order(fitted.view.q[:, fitted.view.moving])}

    def directions(self, fitted: Fitted) -> dict[Direction, np.ndarray]:
        view = fitted.view
        columns = view.target_by("q")[:, :3]
        turn = {movement_of(self.robot, i + 1): columns[:, :, i] for i in range(view.axes)}
        return turn | {axis_of("device", name): np.tile(np.eye(3)[k], (view.rows, 1))
                       for k, name in enumerate("xyz")}

    def error_of_unit_noise(self, fitted: Fitted) -> float:
        return float(np.sqrt(np.mean(np.sum(fitted.residual[~self.record.at_reversal] ** 2, axis=1))))

    def repeat_noise(self, fitted: Fitted) -> float | None:
        """Scatter between runs of one session that played the same path; None where no path was played
        again."""
        motion = fitted.view.theta / self.robot.controller_ratios
        squares, numbers = 0.0, 0
        runs, session = list(self.record.runs), self.record.data.session
        while runs:
            first = runs.pop()
            same = [first] + [rows for rows in runs if _same_path(motion, session, first, rows)]
            runs = [rows for rows in runs if not any(rows is other for other in same)]
            residual = np.stack([fitted.residual[rows] for rows in same])[:, ~self.record.at_reversal[first]]
            squares += float(np.sum((residual - residual.mean(axis=0)) ** 2))
            numbers += (len(same) - 1) * residual[0].size
        if numbers < 3 * _LEAST_REPEATED:
            return None
        return float(np.sqrt(squares / numbers / np.mean(fitted.residual[~self.record.at_reversal] ** 2)))

    def waves(self, fitted: Fitted, floor: float | None) -> tuple[Structure, ...]:
        """What is left where it changes far more from window to window than within one, which no noise of a
        filtered reading does."""
        used = np.flatnonzero(fitted.weight > 0.0)
        slot = np.floor(self.record.data.time[used] / _REMEMBERED_S)
        windows, counts = np.unique(np.stack([self.record.data.run[used], slot]), axis=1,
                                    return_inverse=True, return_counts=True)[1:]
        left, freedom = fitted.residual[used], len(used) - len(counts)
        if freedom < len(counts):
            return ()
        means = np.stack([np.bincount(windows.ravel(), each) for each in left.T], axis=1) / counts[:, None]
        slow = float(np.sum(counts[:, None] * means**2)) / len(used)
        fast = float(np.sum((left - means[windows.ravel()]) ** 2)) / freedom
        if slow + fast < WANDERS_AT**2 * fast or slow < _LEAST_SEEN**2:
            return ()
        times = np.sqrt(slow / max(fast, np.finfo(float).tiny))
        return (Structure(f"it changes slowly along the path, by {times:.2g} times as much as within "
                          f"{_REMEMBERED_S:.3g} s"),)

    def updated_robot(self, fitted: Fitted) -> Robot:
        return calibrated_robot(self.robot, self.data, fitted.layout, fitted.fit, KIND)

    def separating_experiment(self, fitted: Fitted, one: Effect, other: Effect) -> str:
        return separating_motion(
            self.robot, fitted, self.record, one, other, predict=predict_record, columns=np.arange(3),
            measured="the measured path")


def _same_path(motion: np.ndarray, session: np.ndarray, one: np.ndarray, other: np.ndarray) -> bool:
    return (one.size == other.size and session[one[0]] == session[other[0]]
            and bool(np.max(np.abs(motion[one] - motion[other])) < _SAME_PATH_RAD))
