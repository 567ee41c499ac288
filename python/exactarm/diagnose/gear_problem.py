"""Gear runs as a diagnosis problem: residual = reading of the gyroscope (rad/s) or of the link encoders
(rad).

Re-identified: the coefficients of the declared harmonics per direction, and the constant tilt of the
gyroscope or one offset per run and axis between two encoders. Judged: the unfiltered residual along the
moving axis.

Searched and fitted on the resampled runs (resampled_run.py); judged on all samples.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from exactarm.chain import GearRecord, GearRunPrediction, Layout, gear_record, predict_gear_run
from exactarm.chain.encoder_counts import folded_rounding
from exactarm.chain.idle_encoders import without_idle_encoders
from exactarm.data.dataset import Dataset
from exactarm.data.even_readings import at_even_readings
from exactarm.data.kinds import GEAR_RUN
from exactarm.diagnose.changing_waves import changing_waves
from exactarm.diagnose.coloured_noise import NOISE_LAG_S, ColouredNoise
from exactarm.diagnose.fitted import Fitted, rows_judged
from exactarm.diagnose.next_runs import separating_run
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.problem_in_time import LEAST_SIGMA, ProblemInTime
from exactarm.diagnose.resampled_run import resampled_run, with_reading
from exactarm.diagnose.scan import free_mask
from exactarm.diagnose.signal import Direction, Quantity, Signal, Structure, axis_of, measured_of, turn_of
from exactarm.diagnose.time_groups import time_groups
from exactarm.diagnose.unknown import Pattern, Wave
from exactarm.diagnose.wave_in_time import WaveInTime
from exactarm.effects.base import Effect
from exactarm.identify.gear_declared import declared_gear_layout, sensor_layout
from exactarm.identify.gear_fit import fit_gear_runs
from exactarm.identify.sensor_tone import find_tones, hum_at, without_tones
from exactarm.noise.autocorrelation import lags_within, memory_in
from exactarm.noise.broadband import broadband_noise, columns_in_pieces, line_above, oscillation
from exactarm.noise.drifting import DriftingNoise
from exactarm.numerics.orthonormal import orthonormal
from exactarm.numerics.regression import Fit
from exactarm.numerics.stamps import typical_step
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.robot import Robot
from exactarm.station import Station
from exactarm.view import axes_not_logged

_RUNS_OF_A_SORT = 4
# of a run where noise drifts: a slow error, or a resonance that is passed, goes on over shorter ones
_LONG_PIECES = 5
# behind the filter most of the square sum is the encoders' own, whatever the slow part does
_LEAST_SHARE_OF_WHITE = 0.004


@dataclass(frozen=True)
class GearFitted(Fitted):
    """drift: of the noise between two encoders; None where neighbouring samples are taken as they are."""

    drift: DriftingNoise | None = None

    def decorrelated(self, values: np.ndarray) -> np.ndarray:
        return values if self.drift is None else self.drift.white(values)


class GearProblem(ProblemInTime):
    """Runs of one axis at a time under a gyroscope, or of all axes together between encoders."""

    kind = GEAR_RUN.name
    unit, error_along = "rad/s", " along the moving axis"
    most_waves_in_time = 3
    unknown_rivals = drafts = True
    followed_by_effects = frozenset({Quantity.ANGLE, Quantity.TRAVEL, Quantity.LOAD, Quantity.DIRECTION,
                                     Quantity.MOTOR_ANGLE})
    repeat_source = "spectrum of the residual without its lines"

    def __init__(self, robot: Robot, data: Dataset, held_out: Dataset, threads: int = 1, seed: int = 0):
        data, held_out = map(at_even_readings, without_idle_encoders(robot, data, held_out))
        self._tones = find_tones(data)
        data, held_out = without_tones(data, self._tones), without_tones(held_out, self._tones)
        super().__init__(robot, data, held_out, threads, seed)
        self._waves: tuple[WaveInTime, ...] = ()
        self.resampled, self.record = resampled_run(robot, data, self._records["identification"])
        self._estimator = ColouredNoise(self, filtered=self.record.noise_autocorrelation)
        self._step = typical_step(self.resampled.time[self.record.runs[0]])
        if self.record.encoder_axes:
            self.unit, self.error_along = "rad", ""

    def _new_record(self, data: Dataset) -> GearRecord:
        return gear_record(self.robot, data, accelerating=True)

    def declared(self) -> Layout:
        return declared_gear_layout(self.robot, self.resampled, self.record)

    def without_wave(self, wave: WaveInTime) -> GearProblem:
        """The same runs without a wave in time, estimated beside what stands with it; hum of the mains as the
        tone that it is."""
        record = self._records["identification"]
        calm = self._without_mains(wave.frequency, 0.5 * wave.size**2)
        if calm is not None:
            return calm
        parts = [(rows, wave.values(number, record.time[rows])) for number, rows in enumerate(record.runs)]
        robot, threads, seed = self.robot, self.threads, self.seed
        calm = GearProblem(robot, _less(self.data, record, parts), self.held_out, threads, seed)
        if len(self.held_out):
            record, fitted = self._records["validation"], calm.fit(wave.beside)
            new = calm._new_set_up(fitted.layout, self.held_out, record)
            residual = calm._predicted(fitted.layout, new, self.held_out, record).residual()
            parts = [(rows, wave.of_residual(record.time[rows], residual[rows], record.keep[rows]))
                     for rows in record.runs]
            calm = GearProblem(robot, calm.data, _less(self.held_out, record, parts), threads, seed)
        calm._tones, calm._waves = self._tones, (*self._waves, wave)
        return calm

    def without_hum(self, fitted: Fitted) -> GearProblem | None:
        floor = self.repeat_noise(fitted)
        unit = self.error_of_unit_noise(fitted)
        line = None if floor is None else self._line_left(fitted, floor * unit)
        return None if line is None else self._without_mains(line, unit**2 * (1.0 - floor**2))

    def _without_mains(self, hertz: float, power: float) -> GearProblem | None:
        """The same runs without the mains, where these are what stands at a frequency, within what the runs
        resolve, and most of a power (mean square of all components); None where they are not."""
        record = self._records["identification"]
        tone = None if record.encoder_axes else hum_at(hertz, self.data)
        if tone is None or np.sum(tone.amplitude**2) < power:  # half of them is the tone's own power
            return None
        calm, held_out = (without_tones(data, (tone,)) for data in (self.data, self.held_out))
        problem = GearProblem(self.robot, calm, held_out, self.threads, self.seed)
        problem._tones, problem._waves = (*self._tones, tone), self._waves
        return problem

    def fit(self, layout: Layout, weight: np.ndarray | None = None,
            sigma: np.ndarray | None = None) -> Fitted:
        rows = np.ones(len(self.resampled)) if weight is None else weight
        fitted, known = self._fit_with(layout, self._noise.drift, rows), self._noise
        if self.record.encoder_axes and not known.holds_for(fitted.residual):
            plain = fitted if fitted.drift is None else self._fit_with(layout, None, rows)
            drift = self._estimator.drift_of(plain, self.record.runs, self._step)
            fitted = self._fit_with(layout, drift, rows)
            known = self._estimator.of(fitted, self.record.runs, self._step, drift)
        return self._counted(fitted, known, self._step)

    def _fit_with(self, layout: Layout, drift: DriftingNoise | None, rows: np.ndarray) -> GearFitted:
        """The layout fitted to noise that drifts so; sigma of what lies behind the filter, every row
        counted."""
        weights = rows * np.sqrt(self._noise.share)
        found = fit_gear_runs(
            self.robot, layout, self.resampled, record=self.record, weights=weights, drift=drift,
            threads=self.threads)
        prediction = found.prediction
        residual, keep = prediction.residual(), self.record.keep & (rows > 0.0)
        white = residual if drift is None else drift.white(residual)
        return GearFitted(robot=self.robot, layout=found.layout, fit=found.fit, residual=residual,
                          jacobian=prediction.jacobian,
                          sigma=np.maximum(np.sqrt(np.mean(white[keep] ** 2, axis=0)), LEAST_SIGMA),
                          weight=keep.astype(float), view=prediction.view, drift=drift)

    def settled(self, fitted: Fitted) -> Fitted:
        """What drifts between two encoders is as much what no cause explains as it is noise: effects that the
        filter weakens more than that are estimated again without it, by the error as it is judged."""
        if fitted.drift is None:
            return fitted
        plain = np.sqrt(np.mean(fitted.residual**2, axis=0)) / np.sqrt(fitted.noise.share)
        slow = []
        for effect, where in zip(fitted.layout.effects, fitted.layout.slices):
            response = fitted.jacobian[:, :, where]
            kept = np.sum((fitted.decorrelated(response) / fitted.sigma[:, None]) ** 2)
            slow.append(effect.declared or kept < np.sum((response / plain[:, None]) ** 2))
        masks = [mask & keep for mask, keep in zip(fitted.layout.free, slow)]
        again = self.knowing(fitted)._fit_with(Layout(fitted.layout.effects, tuple(masks)), None,
                                               fitted.weight)
        layout = Layout(again.layout.effects, fitted.layout.free)
        slow = np.concatenate([m[f] for m, f in zip(masks, layout.free)])
        return replace(again, layout=layout, jacobian=fitted.jacobian, sigma=fitted.sigma, drift=fitted.drift,
                       noise=fitted.noise, fit=self._settled_fit(fitted, layout, again, slow))

    def _settled_fit(self, fitted: Fitted, layout: Layout, again: GearFitted, slow: np.ndarray) -> Fit:
        """The fit behind the filter with what was estimated without it; neighbouring samples count as fewer
        there."""
        share = self._estimator.share_of(again, self.record.runs, self._step)
        covariance = np.where(slow[:, None] | slow, 0.0, fitted.fit.covariance)
        covariance[np.ix_(slow, slow)] = self._worth(again, share).fit.covariance
        return replace(fitted.fit, x=layout.values, covariance=covariance)

    def errors(self, fitted: Fitted, data: Dataset) -> np.ndarray:
        return np.abs(self._deviations(fitted, data))

    def _deviations(self, fitted: Fitted, data: Dataset) -> np.ndarray:
        """(K,) measured minus predicted along the moving axis; NaN where no model is defined."""
        record = self._record_of(data)
        new = self._new_set_up(fitted.layout, data, record)
        prediction = self._predicted(fitted.layout, new, data, record)
        residual = prediction.residual()
        if prediction.along is not None:
            judged = record.keep & rows_judged(fitted.layout, prediction.view, self.data)
            return np.where(judged, np.einsum("ij,ij->i", residual, prediction.along), np.nan)
        known = {effect.zero_of for effect in fitted.layout.effects}
        for rows in prediction.view.runs:
            # A run that was not fitted has an offset of its own, which belongs to the set-up.
            if data.run[rows[0]] not in known:
                residual[rows] -= residual[rows[record.keep[rows]]].mean(axis=0)
        return np.where(record.keep[:, None], residual, np.nan).ravel()

    def _predicted(self, layout: Layout, new: Layout, data: Dataset, record: GearRecord) -> GearRunPrediction:
        """The layout as it is, behind set-ups that it has not seen: their alignments are fitted beside what
        it says of the sensor, a bias above all; offsets stay as they were found."""
        if not new.effects or record.encoder_axes:
            return predict_gear_run(self.robot, new.held.joined(layout), data, record=record, tangents=False,
                                    threads=self.threads)
        return fit_gear_runs(self.robot, new.joined(layout.held), data, record=record,
                             threads=self.threads).prediction

    def rms_by_axis(self, fitted: Fitted, data: Dataset) -> dict[int, float]:
        """Of each encoder, or of the runs in which the axis moves."""
        record, deviations = self._record_of(data), self._deviations(fitted, data)
        if record.encoder_axes:
            parts = dict(zip(record.encoder_axes, deviations.reshape(len(data), -1).T))
        else:
            moved = record.sensor_axis
            parts = {int(axis): deviations[moved == axis] for axis in np.unique(moved)}
        return {axis: float(np.sqrt(np.nanmean(part**2))) for axis, part in parts.items()
                if np.isfinite(part).any()}

    def _new_set_up(self, layout: Layout, data: Dataset, record: GearRecord) -> Layout:
        """Alignments (offsets) of sessions, axes or runs that were not among the identification rows."""
        known = {name for effect in layout.effects
                 for name in map(effect.parameter_label, effect.parameters())}
        new = [e for e in sensor_layout(self.robot, data, record).effects
               if not known & set(map(e.parameter_label, e.parameters()))]
        return Layout.of(tuple(new))

    def left_out(self) -> tuple[str, ...]:
        out, rows = (sum(int(np.sum(part)) for part in parts) for parts in
                     zip(*((~record.keep, np.ones(record.keep.size)) for record in self._records.values())))
        why = ("a run is cut in motion, a gear passes between its tables, inertia swings the drive train "
               "or a filter rounds the motion")
        words = (f"{out} of {rows} samples were left out: there {why}",) if out else ()
        if (silent := axes_not_logged(self.data)).size:
            words += (f"no angle of {axes_in_words(silent)} is in the log: loads are those of the pose "
                         "with the motors there at 0",)
        return (*words, *map(str, self._tones))

    @property
    def run(self) -> np.ndarray:
        return self.resampled.run

    def groups(self) -> np.ndarray:
        """Whole runs where every set-up has several of each axis, else pieces of every run.

        Encoders have an offset in every run, so that no run can be left out whole.
        """
        moving = zip(self.record.runs, self.record.furthest)
        sorts = [(int(self.resampled.session[rows[0]]), axis) for rows, axis in moving]
        several = min(sorts.count(sort) for sort in sorts) >= _RUNS_OF_A_SORT
        if self._noise.drift is not None:
            return time_groups(self.run, _LONG_PIECES)
        return self.run if several and not self.record.encoder_axes else time_groups(self.run)

    @property
    def least_share(self) -> float:
        return Problem.least_share if self._noise.drift is None else _LEAST_SHARE_OF_WHITE

    @property
    def least_doubt(self) -> float:
        """As of one component, where a gyroscope has three: one shows what an axis does."""
        return self.least_share / (1 if self.record.encoder_axes else 3)

    def judged_share(self, fitted: Fitted, effect: Effect) -> float:
        """Of the encoder for which that is most, beside everything that is free."""
        if fitted.drift is None:
            return 1.0
        components = fitted.residual.shape[1]
        values = np.where(free_mask(effect), effect.values, 0.0)
        change = fitted.view.response(effect)[:, :components] @ values
        basis = orthonormal(fitted.jacobian.reshape(fitted.data_numbers, -1))
        squares: list[np.ndarray] = []
        for part in (change.ravel(), fitted.residual.ravel()):
            left = part - basis @ (basis.T @ part)
            squares.append(np.sum(left.reshape(-1, components) ** 2, axis=0))
        return float(np.max(squares[0] / np.maximum(squares[1], 1e-300)))

    def units(self, folds: np.ndarray) -> np.ndarray:
        """Between encoders stretches longer than what the noise remembers; whole runs are long enough."""
        if not self.record.encoder_axes:
            return folds
        return np.arange(len(folds)) // int(np.ceil(1.0 / self._noise.share))

    def signals(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        view = fitted.view
        rate = view.signals["theta_dot"] / view.robot.ratios
        return self._signals(view, self.resampled, np.flatnonzero(view.moving), rate, view.direction)

    def directions(self, fitted: Fitted) -> dict[Direction, np.ndarray]:
        shape = fitted.residual.shape
        if self.record.encoder_axes:
            names = [replace(measured_of(axis + 1), turns=True) for axis in self.record.encoder_axes]
        else:
            names = [axis_of("sensor", axis) for axis in "xyz"]
        return {name: np.tile(np.eye(shape[1])[k], (shape[0], 1)) for k, name in enumerate(names)}

    def movements(self, fitted: Fitted) -> dict[Direction, Pattern]:
        """Under a gyroscope an axis that turns further shows by its rate."""
        found = self.directions(fitted)
        if not self.record.encoder_axes:
            turned = fitted.view.transfers[Station.SPRING]
            for axis in sorted(set(self.record.furthest)):
                found[turn_of(axis + 1)] = (lambda values, axis=axis: turned([axis], values[:, None, :]))
        return found

    def unknown_waves(self, fitted: Fitted, instead: Iterable[Effect] = ()) -> list[Wave]:
        grows = "faster" not in self._known_waves
        return super().unknown_waves(fitted) + changing_waves(fitted, self.signals(fitted), instead, grows)

    def memory_along(self, fitted: Fitted, columns: np.ndarray, direction: np.ndarray) -> float:
        """A gyroscope's slow noise follows the time, and the speed of a few passes. Its colour is that of
        what the columns leave, and that of the other components as they stand, which errors of the moving
        axis hardly reach."""
        left = fitted.whitened[: fitted.data_numbers].reshape(fitted.residual.shape)
        lags = lags_within(self.record.runs, NOISE_LAG_S, self._step)
        basis, own = orthonormal(columns * self.record.keep[:, None]), np.any(direction != 0.0, axis=0)
        along = np.sum(left * direction, axis=1)
        memory = lambda noise: memory_in(basis, noise, self.record.runs, lags)
        others = float(np.mean([memory(noise) for noise in left[:, ~own].T] or [1.0]))
        return max(fitted.noise.share * max(memory(along - basis @ (basis.T @ along)), others), 1.0)

    def error_of_unit_noise(self, fitted: Fitted) -> float:
        return float(np.sqrt(np.nanmean(self.errors(fitted, self.data) ** 2)))

    def repeat_noise(self, fitted: Fitted) -> float | None:
        """The smooth part of the unfiltered residual's spectrum; None where the rows lie in short pieces."""
        pieces = self._pieces(fitted)
        levels = [broadband_noise(column) for column in pieces]
        if any(level is None for level in levels):
            return None
        square = np.mean(np.concatenate([piece for column in pieces for piece in column]) ** 2)
        return float(min(np.sqrt((np.mean(np.square(levels)) + self._rounding_square) / square), 1.0))

    def rounding_share(self, fitted: Fitted) -> float:
        return float(self._rounding_square / np.maximum(np.mean(fitted.residual**2), 1e-300))

    @cached_property
    def _rounding_square(self) -> float:
        """Mean square (rad^2) between encoders of what their counts leave as waves; under a gyroscope the
        record has none (chain/encoder_counts.py)."""
        squares, runs = [], self._records["identification"].runs
        for axis in self.record.encoder_axes:
            both = ((name, 1.0 if name == "q" else abs(self.robot.ratios[axis])) for name in ("q", "theta"))
            squares.append(sum((folded_rounding(self.data.joints[name][:, axis], runs) / ratio) ** 2
                               for name, ratio in both))
        return float(np.mean(squares)) if squares else 0.0

    def waves(self, fitted: Fitted, floor: float | None) -> tuple[Structure, ...]:
        out = tuple(wave.structure(self.unit) for wave in self._waves)
        return out if floor is None else out + self._waves_left(fitted, floor)

    def _waves_left(self, fitted: Fitted, floor: float) -> tuple[Structure, ...]:
        hertz = self._line_left(fitted, floor)
        if hertz is None:
            if not any(oscillation(column) for column in self._pieces(fitted)):
                return ()
            return (Structure("an oscillation whose size is steady stands in its noise"),)
        return (Structure(f"waves stand out of its noise, the highest at {hertz:.3g} Hz", hertz=hertz),)

    def _line_left(self, fitted: Fitted, floor: float) -> float | None:
        """Frequency in Hz of the highest line, where lines stand out of the noise."""
        step = float(np.median([typical_step(self.data.time[rows])
                                for rows in self._records["identification"].runs]))
        return line_above(self._pieces(fitted), floor, step)

    def _pieces(self, fitted: Fitted) -> list[list[np.ndarray]]:
        """The unfiltered residual without gaps, of each component."""
        errors = self._deviations(fitted, self.data).reshape(len(self.data), -1)
        return columns_in_pieces(errors, self._records["identification"].runs)

    def separating_experiment(self, fitted: Fitted, one: Effect, other: Effect) -> str:
        return separating_run(self.robot, fitted, self.record, one, other)


def _less(data: Dataset, record: GearRecord, parts) -> Dataset:
    """The data without what each of `parts`, (rows, (K, m)), says of its rows' reading."""
    axes = list(record.encoder_axes)
    reading = (data.joints["q"][:, axes] if axes else data.gyro).copy()
    for rows, values in parts:
        reading[rows] -= values
    return with_reading(data, axes, reading)
