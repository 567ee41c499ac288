"""Motions as a diagnosis problem: residual = measured minus predicted drive torque of every measured axis,
Nm.

Re-identified: Coulomb and viscous friction, and base inertial parameters where the robot file declares no
masses or has estimated ones; of these, what the motion excites. Both sides pass the same low-pass
(chain/motion_record.py); judged on its rows.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial

import numpy as np

from exactarm.chain import (
    Layout,
    MotionRecord,
    motion_clear_of_reversals,
    motion_record,
    predict_motion,
    reversals_left_out,
)
from exactarm.chain.motion_record import BANDWIDTH_HZ, measured_torque
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import MOTION
from exactarm.data.kinds.base import runs_in_time
from exactarm.diagnose.coloured_noise import ColouredNoise
from exactarm.diagnose.decisions import RESPONDING
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.next_motions import separating_motion
from exactarm.diagnose.problem_in_time import ProblemInTime
from exactarm.diagnose.scan import free_mask
from exactarm.diagnose.signal import Direction, Quantity, Signal, Structure, measured_of
from exactarm.effects.base import Effect, Station
from exactarm.identify.base_parameters import base_parameters
from exactarm.identify.declared import carried_layout, require_geometry
from exactarm.identify.dynamics import (
    axes_at_rest,
    currents_as_torques,
    excited_layout,
    friction_layout,
    inertia_was_estimated,
    inertial_layout,
    require_enough,
    with_links,
)
from exactarm.identify.friction_width import dry_friction
from exactarm.identify.motion_fit import MotionFit, fit_motion
from exactarm.identify.session_payloads import payload_layout_of_motion
from exactarm.noise.broadband import broadband_noise, columns_in_pieces, line_of_its_own
from exactarm.numerics.white_noise import rise_towards_band, white_noise
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.robot import Robot
from exactarm.view import on_axes

_COLUMNS_AT_ONCE = 48
_TURNS = 4  # at most, of the dry friction and the rest, each at the other's estimate
_FITS_KEPT = 6  # contest and alternatives ask for the same rivals; a fit is some ten megabytes
_BYTES_KEPT = 2e8  # of responses at one fit: the whole library over a minute of six axes
_LEAST_SAMPLES, _LEAST_NOISE, _WHITE = 50, 1e-5, 1.2
# of those of an identification: a search over hundreds of candidates costs as many times the rows
_ROWS_SHARE = 0.5


@dataclass(frozen=True)
class MotionFitted(Fitted):
    """measured (m,): axes (from 0) whose torque was measured; record: of the identification rows; known:
    responses at this view, which noise, scan and contest ask for in turn."""

    measured: np.ndarray = None
    record: MotionRecord = None
    known: dict[Effect, np.ndarray] = field(default_factory=dict)

    def responses_of(self, effects: list[Effect]) -> list[np.ndarray]:
        new = [effect for effect in effects if effect not in self.known]
        found = dict(zip(new, self._responses_of(new)))
        kept = sum(response.nbytes for response in self.known.values())
        for effect, response in found.items():
            kept += response.nbytes
            if kept < _BYTES_KEPT:
                self.known[effect] = response
        return [found[effect] if effect in found else self.known[effect] for effect in effects]

    def _responses_of(self, effects: list[Effect]) -> list[np.ndarray]:
        """Effects without any size share runs through the arm; what acts on the reported torque itself needs
        none."""
        found: dict[int, np.ndarray] = {}
        together: list[int] = []
        for place, effect in enumerate(effects):
            if effect.station in (Station.DRIVE, Station.DEVICE) and not effect.only_in_tables:
                found[place] = self._direct(effect)
            elif any(value != 0.0 for value, free in zip(effect.values, free_mask(effect)) if free):
                found[place] = self.view.response(effect)
            else:
                together.append(place)
        for part in _in_parts(together, [int(free_mask(effects[place]).sum()) for place in together]):
            found |= dict(zip(part, self.view.responses([effects[place] for place in part])))
        return [found[place][:, self.measured] for place in range(len(effects))]

    def _direct(self, effect: Effect) -> np.ndarray:
        """(N, n, k)"""
        change = effect.change(self.view)
        response = np.zeros((self.view.rows, self.view.axes, len(effect.values)))
        response[:, list(change.columns)] = change.by_parameters
        return self.record.smooth(response)


def _in_parts(places: list[int], widths: list[int]) -> list[list[int]]:
    """`places` in their order, cut so that each part has about `_COLUMNS_AT_ONCE` columns."""
    part_of = np.cumsum(widths) // _COLUMNS_AT_ONCE
    return [[places[k] for k in np.flatnonzero(part_of == part)] for part in np.unique(part_of)]


class MotionProblem(ProblemInTime):
    """One or several runs of all axes together."""

    unit = "Nm"
    kind = MOTION.name
    unknown_rivals = True
    followed_by_effects = frozenset({Quantity.SPEED, Quantity.DIRECTION})  # by frictions
    unknown_size = 1.0  # Nm: a third of what the library holds plausible of a friction

    def __init__(self, robot: Robot, data: Dataset, held_out: Dataset, threads: int = 1, seed: int = 0):
        # without it neither gravity nor inertia: friction alone would be all that is known of the torques
        require_geometry(robot)
        inertial = robot.links is None or inertia_was_estimated(robot)
        super().__init__(with_links(robot) if inertial else robot, data, held_out, threads, seed)
        self.inertial = inertial
        self.record = self._records["identification"]
        self._estimator = ColouredNoise(self, filtered=self.record.noise_autocorrelation)
        self._fits: dict[tuple, MotionFit] = {}  # shared with the problems that come of this one

    def _new_record(self, data: Dataset) -> MotionRecord:
        """Behind the low-pass of the identification rows."""
        first = self._records.get("identification")
        record = motion_record(self.robot, data, first.bandwidth_hz if first else None, _ROWS_SHARE)
        return motion_clear_of_reversals(self.robot, record, data, self.threads)

    def declared(self) -> Layout:
        layout = friction_layout(self.robot, self.record)
        if self.inertial:
            layout = layout.joined(inertial_layout(self.robot, base_parameters(self.robot)))
        layout = layout.joined(carried_layout(self.robot, self.data, MOTION.name))
        layout = layout.joined(payload_layout_of_motion(self.data, self.inertial))
        layout, _ = excited_layout(self.robot, layout, self.record, self.threads)
        require_enough(layout, self.record)
        return layout

    def fit(self, layout: Layout, weight: np.ndarray | None = None,
            sigma: np.ndarray | None = None) -> Fitted:
        record, rows = self.record, np.ones(len(self.record.keep)) if weight is None else weight
        if self._noise.square == np.inf:  # nothing was fitted before
            record = self._turned_over(record, layout)
        share = self._noise.share
        start = None if sigma is None else sigma * np.sqrt(share)
        record, found = self._turned_and_estimated(layout, record, rows, start)
        prediction, axes, keep = found.prediction, found.axes, record.keep & (rows > 0.0)
        residual = np.where(keep[:, None], prediction.residual()[:, axes], 0.0)
        view = prediction.view
        view.by_axis = partial(on_axes, axes, self.robot.axes)
        fitted = MotionFitted(robot=self.robot, layout=found.layout,
                              fit=replace(found.fit, covariance=found.uncertainty.covariance,
                                          freedom=max(int(found.uncertainty.freedom), 1)),
                              residual=residual, jacobian=prediction.jacobian[:, axes], sigma=found.sigma,
                              weight=keep.astype(float), view=view.leaving(residual), measured=axes,
                              record=record)
        known = self._estimator.renewed(self._noise, fitted, record.runs, record.step)
        return replace(fitted, sigma=found.sigma / np.sqrt(known.share), noise=known)

    def knowing(self, fitted: Fitted) -> MotionProblem:
        other = super().knowing(fitted)
        other.record = fitted.record
        return other

    def _turned_and_estimated(self, layout: Layout, record: MotionRecord, rows: np.ndarray,
                              sigma: np.ndarray | None) -> tuple[MotionRecord, MotionFit]:
        """At rest with each other."""
        earlier, found = record.dry, self._estimated(layout, record, rows, sigma)
        for _ in range(_TURNS):
            again = self._turned_over(record, found.layout)
            if again.dry is record.dry:
                break
            again = replace(again, dry=record.dry.towards(again.dry, earlier))
            earlier, record = record.dry, again
            found = self._estimated(found.layout, again, rows, found.sigma)
        return record, found

    def _estimated(self, layout: Layout, record: MotionRecord, rows: np.ndarray,
                   sigma: np.ndarray | None) -> MotionFit:
        weights = rows * np.sqrt(self._noise.share)
        # What a fit hangs on; the robot and the torque are those that the kept fit holds.
        effects = [(e.name, *(getattr(e, field.name) for field in fields(e))) for e in layout.effects]
        about = (effects, layout.free, record.dry.values, weights, sigma)
        asked = (id(self.robot), id(record.torque), pickle.dumps(about))
        if asked not in self._fits:
            found = fit_motion(self.robot, layout, record, weights=weights, sigma=sigma, threads=self.threads)
            for old in list(self._fits)[: 1 - _FITS_KEPT]:
                del self._fits[old]
            self._fits[asked] = found
        return self._fits[asked]

    def _turned_over(self, record: MotionRecord, layout: Layout) -> MotionRecord:
        """The record as dry friction turns over with `layout`."""
        return replace(record, dry=dry_friction(self.robot, layout, record, self.threads))

    def _residual(self, fitted: Fitted, data: Dataset) -> np.ndarray:
        """(N', m) measured minus predicted away from ends and reversals, as many for every fit; NaN where
        nobody knows what dry friction holds."""
        record, residual = self._of_rows(fitted, data)
        return residual[record.inside & ~record.at_reversal]

    def _of_rows(self, fitted: Fitted, data: Dataset) -> tuple[MotionRecord, np.ndarray]:
        """The record of any rows, and the same (N, m) of all of them, NaN where none is defined."""
        record = fitted.record
        if data is not self.data:
            record = replace(self._record_of(data), dry=record.dry.elsewhere())
        prediction = predict_motion(self.robot, fitted.layout, record, tangents=False, threads=self.threads)
        residual = np.where(record.keep[:, None], prediction.residual(), np.nan)
        return record, residual[:, self.record.measured_axes]

    def errors(self, fitted: Fitted, data: Dataset) -> np.ndarray:
        return np.abs(self._residual(fitted, data)).ravel()

    def held_out_picture(self, fitted: Fitted) -> tuple[np.ndarray, np.ndarray] | None:
        if "validation" not in self._records:
            return None
        record = replace(self._records["validation"], dry=fitted.record.dry.elsewhere())
        prediction = predict_motion(self.robot, fitted.layout, record, threads=self.threads)
        rows = np.ix_(record.keep & record.inside & ~record.at_reversal, record.measured_axes)
        return prediction.residual()[rows], prediction.jacobian[rows]

    def rms_by_axis(self, fitted: Fitted, data: Dataset) -> dict[int, float]:
        rms = np.sqrt(np.nanmean(self._residual(fitted, data) ** 2, axis=0))
        return {int(axis): float(value) for axis, value in zip(self.record.measured_axes, rms)}

    def left_out(self) -> tuple[str, ...]:
        words, record = (), self.record
        if (silent := np.setdiff1d(range(self.robot.axes), record.measured_axes)).size:
            words += (f"no torque was measured on {axes_in_words(silent)}: nothing is said of it",)
        if (still := axes_at_rest(self.robot, record)).size:
            words += (f"what dry friction holds at rest of {axes_in_words(still)} is not known: a constant "
                      "torque there says nothing",)
        if (folded := np.flatnonzero(record.folded(self.robot))).size:
            words += (f"gear waves of {axes_in_words(folded)} pass faster than the log shows, and what they "
                      "leave in a torque folds back: no wave is searched there; log faster or move slower",)
        words += reversals_left_out(self._records.values())
        if not self.inertial:
            words += ("masses and inertias are taken as the robot file declares them, 3 % more or less: "
                      "where they come from a drawing, `exactarm identify` first",)
        return words

    def share_of_measured(self, fitted: Fitted) -> float:
        torque = self.record.torque[self.record.keep][:, self.record.measured_axes]
        return self.error_of_unit_noise(fitted) / max(float(np.sqrt(np.mean(torque**2))), 1e-12)

    def shows(self, effect: type[Effect]) -> bool:
        return super().shows(effect) and not (self.inertial and effect.inertia_of)

    def signals(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        rate = fitted.view.signals["theta_dot"] / self.robot.controller_ratios
        return self._signals(fitted.view, self.record.data, range(self.robot.axes), rate, np.sign(rate))

    def directions(self, fitted: Fitted) -> dict[Direction, np.ndarray]:
        rows, m = fitted.residual.shape
        axes = self.record.measured_axes
        return {measured_of(axis + 1): np.tile(np.eye(m)[k], (rows, 1)) for k, axis in enumerate(axes)}

    def numbers_to_explain(self, response: np.ndarray) -> np.ndarray:
        """Every axis has a noise of its own, and an effect has to take its share where it shows: of six axes,
        a twelfth of one would have to go before it is a fiftieth of all."""
        return response > RESPONDING * response.max()

    @property
    def least_doubt(self) -> float:
        """As of all axes: a function without a law also follows how dry friction passes at reversals, where a
        twentieth of one axis's square sum has 9 nats without any effect."""
        return self.least_share * len(self.record.measured_axes)

    def error_of_unit_noise(self, fitted: Fitted) -> float:
        return float(np.sqrt(np.nanmean(self._residual(fitted, self.data) ** 2)))

    def doubts(self, fitted: Fitted) -> tuple[str, ...]:
        return tuple(currents_as_torques(self.robot, self.data))

    @property
    def repeat_source(self) -> str:
        return ("spectrum of the residual without its lines" if self._white_noise is None
                else "white noise of the torque above the band of the motion")

    def repeat_noise(self, fitted: Fitted) -> float | None:
        """From the torque as it was logged, its white noise; where nothing says how much of the noise lies
        in the band of the motion, the smooth part of the residual's spectrum."""
        unit, noise = self.error_of_unit_noise(fitted), self._white_noise
        if noise is None:
            record, residual = self._of_rows(fitted, self.data)
            levels = [broadband_noise(pieces) for pieces in columns_in_pieces(residual, record.runs)]
            if any(level is None for level in levels):
                return None
            noise = float(np.sqrt(np.mean(np.square(levels))))
        return min(noise / unit, 1.0)

    @cached_property
    def _white_noise(self) -> float | None:
        """Nm of the torque above what moves an arm, as much as passes the low-pass, and what the noise of the
        angles adds to it.

        None where that noise is not white, grows towards the band on every axis, or is sampled too slowly
        to tell: then nothing says how much of it lies below.
        """
        axes = self.record.measured_axes
        torque = measured_torque(self.robot, self.data)[:, axes]
        parts = [torque[rows] for rows in runs_in_time(self.data) if rows.size > 4 * _LEAST_SAMPLES]
        if not parts:
            return None
        step, band = self.record.logged_step, self.record.bandwidth_hz
        beside = self.record.noise.torque(0.5 / step if band is None else band)[axes] ** 2
        variances = []
        for axis, sigma in enumerate(np.sqrt(np.mean(torque**2, axis=0))):
            each = [[white_noise(part[::every, axis]) for part in parts] for every in (1, 2)]
            fine, coarse = (float(np.sqrt(np.mean(np.square(values)))) for values in each)
            if not _LEAST_NOISE * sigma < fine or not 1.0 / _WHITE < coarse / fine < _WHITE:
                return None
            variances.append(fine**2)
        if band is not None:
            rise = rise_towards_band(parts, step, max(band, BANDWIDTH_HZ))
            if rise is None or np.min(rise) > _WHITE:
                return None
        return float(np.sqrt(np.mean(variances + beside) * self.record.white_share(step)))

    def shakes(self, fitted: Fitted) -> tuple[Structure, ...]:
        record, residual = self._of_rows(fitted, self.data)
        predicted = record.torque[:, fitted.measured] - residual
        parts = (columns_in_pieces(each, record.runs) for each in (residual, predicted))
        found = (line_of_its_own(*pieces, record.step) for pieces in zip(*parts))
        words = "axis {} shakes at {:.3g} Hz, whatever the arm does"
        return tuple(Structure(words.format(axis + 1, hertz), hertz=hertz)
                     for axis, hertz in zip(fitted.measured, found) if hertz is not None)

    def separating_experiment(self, fitted: Fitted, one: Effect, other: Effect) -> str:
        return separating_motion(self.robot, fitted, fitted.record, one, other)
