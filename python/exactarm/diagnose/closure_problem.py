"""Closures as a diagnosis problem: residual = what a touch lacks to its contact; contacts and tool are always
fitted anew.

An effect has to hold where nothing was learnt: each place of the fixture is left out in turn and judged with
contacts of its own, that is, on what is left of residual and columns once the contacts are projected out of
them,
    P = I - Qc Qc',    Qc: basis of the whitened columns of all contacts (and the rows of known lengths that
                       tie them).
A known length of the place left out stays among the rows that are learnt from: one number in a hundred or so.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import CLOSURES, POSES
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.problem_at_rest import ProblemAtRest
from exactarm.diagnose.signal import Direction, axis_of, movement_of
from exactarm.diagnose.worth import CHANCE_AGAINST
from exactarm.effects.base import Effect, Station
from exactarm.identify.closure_fit import ClosureFit, Pulls, fit_closures
from exactarm.identify.closure_scale import gravity_alone
from exactarm.identify.closures import (
    SLIPPED,
    DeclaredClosures,
    carried_effects,
    closure_errors,
    declare_closures,
    other_errors,
    sessions_of,
    slipped_rows,
    updated_robot,
)
from exactarm.identify.declared import reestimated_layout
from exactarm.identify.judged_rows import judged_rows, touched_contacts
from exactarm.identify.length_doubt import length_doubts
from exactarm.measurement.closures import (
    PAIR,
    ClosurePrediction,
    contact_keys,
    device_of,
    predict_closures,
    shows_a_place,
    touches,
    turn_of_axis,
)
from exactarm.measurement.contact import Contact
from exactarm.measurement.contacts import SENSORS
from exactarm.measurement.pictures import SHARED, rows_of_pictures
from exactarm.numerics.orthonormal import orthonormal
from exactarm.robot.robot import Robot

_OF_A_MOTION = 2 * len(SHARED)  # numbers of a picture


@dataclass(frozen=True)
class ClosureFitted(Fitted):
    """weight (N,): square roots of the rows' robust weights; worth (N,): independent readings that each is
    worth; sigmas (N, m) of every number; pulls: known lengths and drawing."""

    worth: np.ndarray
    sigmas: np.ndarray
    pulls: Pulls
    prediction: ClosurePrediction

    @staticmethod
    def of(fit: ClosureFit, pulls: Pulls) -> ClosureFitted:
        prediction, used = fit.prediction, fit.prediction.used
        mean = [float(np.sqrt(np.mean(fit.sigma[used[:, k], k] ** 2))) if used[:, k].any() else 1.0
                for k in range(used.shape[1])]
        return ClosureFitted(
            fit.robot, fit.layout, fit.fit, prediction.residual, prediction.jacobian, np.array(mean),
            fit.weight, prediction.view, fit.worth, fit.sigma, pulls, prediction)

    @cached_property
    def scale(self) -> np.ndarray:
        return (np.sqrt(self.worth) * self.weight)[:, None] * self.prediction.used / self.sigmas

    @cached_property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        return self.pulls.rows(self.layout)

    def square(self, like: Fitted) -> float:
        return float(np.sum((self.residual * like.scale) ** 2))

    def responses_of(self, effects: list[Effect]) -> list[np.ndarray]:
        return [self.prediction.response(effect) for effect in effects]

    def share_left(self, rows: np.ndarray) -> float:
        """Of the numbers of some rows (N,) bool, the share that the free parameters have not used up."""
        numbers = self.prediction.used[rows] * self.worth[rows, None]
        spent = np.sum(self.basis[: self.data_numbers] ** 2, axis=1).reshape(self.scale.shape)[rows]
        return max(float(numbers.sum() - spent.sum()), 1.0) / max(float(numbers.sum()), 1.0)

    @cached_property
    def of_contacts(self) -> np.ndarray:
        """(P,) bool: the parameters of the contacts."""
        mask = np.zeros(self.layout.size, bool)
        for effect, where in zip(self.layout.effects, self.layout.slices):
            mask[where] = isinstance(effect, Contact)
        return mask


@dataclass(frozen=True)
class WithoutContacts(ClosureFitted):
    """The same behind the projection that takes the contacts out."""

    @cached_property
    def contact_basis(self) -> np.ndarray:
        return orthonormal(self.design[:, self.of_contacts])

    def _cleared(self, columns: np.ndarray) -> np.ndarray:
        return columns - self.contact_basis @ (self.contact_basis.T @ columns)

    @cached_property
    def whitened(self) -> np.ndarray:
        return self._cleared(super().whitened)

    @cached_property
    def basis(self) -> np.ndarray:
        return orthonormal(self._cleared(self.design[:, ~self.of_contacts]))

    def whiten(self, response: np.ndarray) -> np.ndarray:
        return self._cleared(super().whiten(response))


class ClosureProblem(ProblemAtRest):
    """Rows have one device each (`touches`). No target is measured, and no planned pose of a free one would
    be a touch: faces, spheres and bars show a part of the error alone, and where the target is said to be
    holds the residual itself. Rows have no positions in common that a tilt could be seen in."""

    kind = CLOSURES.name
    # not `by_posterior`: contacts are fitted beside the effects, and it has not been measured on them
    far_elsewhere = True

    def __init__(self, robot: Robot, data: Dataset, held_out: Dataset, threads: int = 1, seed: int = 0):
        super().__init__(robot, touches(data), touches(held_out) if len(held_out) else held_out, threads,
                         seed)

    @cached_property
    def of_the_arm(self) -> float:
        """Share of the numbers that an error of the arm can move: of a picture's corners six, however many
        there are. Shares of the square sum are asked of these; the rest is detection and lens."""
        numbers = int(self._declared.prediction.used.sum())
        corners = sum(max(2 * len(rows) - _OF_A_MOTION, 0) for rows in rows_of_pictures(self.data))
        return 1.0 - corners / max(numbers, 1)

    @property
    def measured_poses(self) -> int:
        """Of pictures every corner is a row."""
        return len(np.unique(self.groups()))

    @property
    def least_share(self) -> float:
        return Problem.least_share * self.of_the_arm

    @property
    def least_elsewhere(self) -> float:
        """Places are few and far apart: an effect that hardly helps there is none."""
        return self.least_share

    @property
    def share_left(self) -> float:
        return Problem.share_left * self.of_the_arm

    def shows(self, effect: type[Effect]) -> bool:
        """What acts before the device acts here too; slipped contacts are the noise's tail."""
        return POSES.name in effect.kinds and effect.station != Station.DEVICE and not effect.excludes_rows()

    def declared(self) -> Layout:
        return self._declared.layout

    @property
    def pulls(self) -> Pulls:
        """As near to its drawing as the declared model has found the arm."""
        return self._found.pulls

    @property
    def _declared(self) -> ClosureFit:
        return self._found.fit

    @cached_property
    def _found(self) -> DeclaredClosures:
        sessions = tuple(
            sorted({*sessions_of(self.data), *(sessions_of(self.held_out) if len(self.held_out) else ())}))
        own = reestimated_layout(self.robot, self.data)
        known = carried_effects(self.robot, self.data).effects
        carried = own.only(k for k, effect in enumerate(own.effects) if effect in known)
        return declare_closures(self.robot, self.data, (), self.seed, self.threads, sessions, carried)

    def fit(self, layout: Layout, weight: np.ndarray | None = None,
            sigma: np.ndarray | None = None) -> Fitted:
        fit = fit_closures(self.robot, layout, self.data, self.pulls, keep=weight, worth=self._declared.worth,
                           threads=self.threads, tolerance=self.tolerance)
        fitted, view = ClosureFitted.of(fit, self.pulls), fit.prediction.view
        view.signals |= {"residual": fitted.residual, "scale": fitted.scale}
        view.through = fit.prediction.passage
        return fitted

    def errors(self, fitted: Fitted, data: Dataset) -> np.ndarray:
        error = closure_errors(self.robot, fitted.layout, data, self.threads).error()
        known = None if data is self.data else fitted.layout
        judged = judged_rows(data, known)
        if not gravity_alone(self.data):  # what errs by an angle is no measure of what errs by a distance
            judged &= ~np.isin(device_of(data), list(SENSORS))
        return np.where(judged, error, np.nan)

    def also_judged(self, fitted: Fitted, data: Dataset) -> dict[str, float]:
        errors = closure_errors(self.robot, fitted.layout, data, self.threads)
        return other_errors(self.robot, fitted.layout, data, errors, threads=self.threads)

    def doubts(self, fitted: Fitted) -> tuple[str, ...]:
        fit = replace(self._declared, layout=fitted.layout, fit=fitted.fit)
        apart = tuple(f"{line}; or in these poses the arm errs by something that the others do not show"
                      for line in slipped_rows(fitted.weight))
        return (*apart, *length_doubts(fit, self.data, self.pulls, self.threads))

    def directions(self, fitted: Fitted) -> dict[Direction, np.ndarray]:
        prediction = fitted.prediction
        turn = {movement_of(self.robot, i + 1): turn_of_axis(prediction, i)
                for i in range(self.robot.axes)}
        axes = np.eye(fitted.residual.shape[1])
        pushed = {axis_of("base", name): prediction.used * axes[k] for k, name in enumerate("xyz")}
        return turn | pushed

    def stretches(self) -> np.ndarray | None:
        """Places: sessions, or where there is only one, its contacts; without one place alone nothing is left
        to learn from."""
        if len(sessions_of(self.data)) > 1:
            return self.data.session
        out = np.full(len(self.data), -1)
        for place, (name, _, number) in enumerate(contact_keys(self.data)):
            out[self.data.contacts[name] == number] = place
        return out if len(np.unique(out)) > 1 else None

    def at_one_place(self, effect: Effect) -> bool:
        return effect.of_one_session

    def holds(self, without: np.ndarray, left: np.ndarray) -> bool:
        """Places are few: the sum over them may be one alone, and the next may be like any. So none may get
        worse by the share that all of them together must gain, nor by more than chance where it holds few
        rows."""
        allowed = np.maximum(self.least_elsewhere * without, CHANCE_AGAINST)
        return super().holds(without, left) and bool(np.all(left - without < allowed))

    def elsewhere(self, fitted: Fitted) -> Fitted:
        given = [each.name for each in fields(fitted) if each.init]
        return WithoutContacts(**{name: getattr(fitted, name) for name in given})

    def error_of_unit_noise(self, fitted: Fitted) -> float:
        """RMS error of the rows that have not slipped, for the degrees of freedom that the fit has taken of
        each sort: few rows under a tracker may be met by what many readings of a sensor do not show."""
        rows = shows_a_place(self.data) & (fitted.weight > SLIPPED)
        square = fitted.prediction.error() ** 2
        for sort in np.unique(device_of(self.data)[rows]):
            of_sort = rows & (device_of(self.data) == sort)
            square[of_sort] /= fitted.share_left(of_sort)
        return float(np.sqrt(np.mean(square[rows])))

    def spread(self, fitted: Fitted) -> float:
        judged = np.isfinite(self.errors(fitted, self.held_out)) if len(self.held_out) else np.zeros(0, bool)
        return float(np.mean(self.spread_by_row(fitted)[judged])) if judged.any() else 0.0

    def spread_by_row(self, fitted: Fitted) -> np.ndarray:
        """Contacts of the validation rows alone are fitted to them and add nothing."""
        if not len(self.held_out):
            return np.zeros(0)
        prediction = predict_closures(self.robot, fitted.layout, self.held_out, threads=self.threads)
        jacobian = prediction.jacobian[:, :3] * prediction.pictures.depth[:, None, None]
        known = {(e.contact, e.session, e.number) for e in fitted.layout.effects if isinstance(e, Contact)}
        for key, at in touched_contacts(self.held_out):
            if key not in known and key[0] != PAIR:
                jacobian[at] = 0.0
        return fitted.variance_of(jacobian).sum(axis=1)

    def repeat_noise(self, fitted: Fitted) -> float | None:
        used = (fitted.weight > SLIPPED) & fitted.prediction.used[:, :3].all(axis=1)
        used &= shows_a_place(self.data)
        unit = self.error_of_unit_noise(fitted) / np.sqrt(3.0)
        return self.repeats(fitted.residual[:, :3] / unit, used)

    def correlation_factor(self, fitted: Fitted) -> float:
        """Pairs: the means that were projected out are no data."""
        worth, used = fitted.worth, fitted.prediction.used.sum(axis=1)
        return (float(worth @ used) - fitted.prediction.projected(worth)) / max(int(used.sum()), 1)

    def updated_robot(self, fitted: Fitted) -> Robot:
        return updated_robot(self.robot, self.data, fitted)

    def separating_experiment(self, fitted: Fitted, one: Effect, other: Effect) -> str:
        """In words: what the touches lack that would show the difference."""
        axes = sorted({effect.joint for effect in (one, other) if effect.joint is not None})
        turned = " and ".join(str(axis) for axis in axes)
        seen = ", ".join(
            f"axis {axis} {np.degrees(np.ptp(fitted.view.q[:, axis - 1])):.0f} degrees" for axis in axes)
        more = (f"turn axis {turned} through more of the range (so far {seen})"
                if axes else "load the arm differently")
        return f"Touch the same contacts from other sides, and set the fixture up at one more place: {more}."
