"""Problems whose rows are samples of runs: neighbours share their noise, so they count as fewer.

share: independent numbers per number (coloured_noise.py). A fit weighs its rows by the share that an earlier
one has left in `_noise`, and its intervals are wider by 1 / sqrt(share).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from copy import copy
from dataclasses import replace
from typing import Any, Self

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.diagnose.coloured_noise import ColouredNoise, NoiseMemory
from exactarm.diagnose.decisions import RESPONDING
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.signal import Quantity, Signal, place_of_axis
from exactarm.diagnose.time_groups import run_groups, stretches_of_response, time_groups
from exactarm.identify.declared import all_effects, with_estimates
from exactarm.numerics.regression import gram_inverse
from exactarm.robot.robot import Robot
from exactarm.view import View

_SPREAD_ROWS = 300  # a mean over them: more tell the same

LEAST_SIGMA = 1e-12  # of a component: of exact data nothing is left


class ProblemInTime(Problem):
    """record: of the identification rows, as they are fitted."""

    record: Any
    motors_within_revolutions = True  # whether the residual may follow these

    def __init__(self, robot: Robot, data: Dataset, held_out: Dataset, threads: int = 1, seed: int = 0):
        super().__init__(robot, data, held_out, threads, seed)
        self._records: dict[str, Any] = {}
        for name, rows in (("identification", data), ("validation", held_out)):
            if len(rows):
                self._records[name] = self._new_record(rows)
        self._estimator, self._noise = ColouredNoise(self), NoiseMemory()

    @abstractmethod
    def _new_record(self, data: Dataset) -> Any:
        """The rates of any rows, and which of them count."""

    def _record_of(self, data: Dataset) -> Any:
        if data is self.data or data is self.held_out:
            return self._records["identification" if data is self.data else "validation"]
        return self._new_record(data)

    def knowing(self, fitted: Fitted) -> Self:
        other = copy(self)
        other._noise = fitted.noise
        return other

    def _signals(self, view: View, data: Dataset, axes: Iterable[int], rate: np.ndarray,
                 direction: np.ndarray) -> dict[Signal, np.ndarray]:
        """Of some axes, whose motors turn at `rate` (N, n) on the output side, and of what all share."""
        signals = {}
        for i in axes:
            signals[place_of_axis(self.robot, i + 1)] = view.q[:, i]
            signals[Signal(Quantity.DIRECTION, i + 1)] = direction[:, i]
            signals[Signal(Quantity.SPEED, i + 1)] = rate[:, i]
            if "theta_ddot" in view.signals:
                signals[Signal(Quantity.ACCELERATION, i + 1)] = view.signals["theta_ddot"][:, i]
            signals[Signal(Quantity.LOAD, i + 1)] = view.torque[:, i]
            # of what a motor repeats every turn one turn tells nothing: its angle is that of the axis; and of
            # waves that fold back nobody knows the order
            shown = self.motors_within_revolutions and not view.folded[i]
            if shown and np.ptp(view.theta[:, i]) > 4.0 * np.pi:
                within = np.mod(view.theta[:, i], 2.0 * np.pi)
                signals[Signal(Quantity.MOTOR_ANGLE, i + 1, "within a revolution")] = within
        signals[Signal(Quantity.TIME)] = data.time
        signals |= {Signal(name): each for name, each in data.covariates.items()}
        return {name: values for name, values in signals.items() if np.ptp(values) > 0.0}

    def _counted(self, fitted: Fitted, known: NoiseMemory, step: float) -> Fitted:
        """Correlated samples, `step` s apart, count as fewer, against priors and in intervals."""
        known = self._estimator.renewed(known, fitted, self.record.runs, step)
        return replace(self._worth(fitted, known.share), noise=known)

    @staticmethod
    def _worth(fitted: Fitted, share: float) -> Fitted:
        """The fit where its samples are worth so many independent ones each."""
        counted = replace(fitted, sigma=fitted.sigma / np.sqrt(share))
        freedom, covariance = max(int(share * fitted.fit.freedom), 1), fitted.fit.covariance / share
        if len(counted.prior_rows):  # which are worth as much, however few the samples are
            free, design = ~fitted.fit.at_bound, counted.design
            inverse, scale = gram_inverse(design[:, free].T @ design[:, free])
            covariance[np.ix_(free, free)] = inverse / np.outer(scale, scale)
        return replace(counted, fit=replace(fitted.fit, covariance=covariance, freedom=freedom))

    @property
    def run(self) -> np.ndarray:
        """(N,) of the rows as they are fitted."""
        return self.record.data.run

    def spread(self, fitted: Fitted) -> float:
        picture = self.held_out_picture(fitted) if len(self.held_out) else None
        if picture is None:
            return 0.0
        jacobian = picture[1][:: max(1, len(picture[1]) // _SPREAD_ROWS)]
        return self.numbers_of_error * float(np.mean(fitted.variance_of(jacobian)))

    def numbers_to_explain(self, response: np.ndarray) -> np.ndarray:
        """A run in which the axis stands tells nothing of its gear, and none of its noise is to be explained.
        Poses are another matter: with this rule two effects that are not there entered the UR10's model, both
        of its series in one run (0.084 for 0.079 mm held out)."""
        by_row = np.sum(response, axis=1)
        return np.broadcast_to((by_row > RESPONDING * by_row.max())[:, None], response.shape)

    def groups(self) -> np.ndarray:
        return run_groups(self.run)

    def pieces(self) -> np.ndarray:
        """Of one run each."""
        pieces = np.stack([self.run, time_groups(self.run)])
        return np.unique(pieces, axis=1, return_inverse=True)[1].ravel()

    def groups_for(self, response: np.ndarray, lost: np.ndarray) -> np.ndarray:
        return stretches_of_response(self.groups(), response, lost, 1.0 / self._noise.share)

    def correlation_factor(self, fitted: Fitted) -> float:
        return fitted.noise.share

    def updated_robot(self, fitted: Fitted) -> Robot:
        result = with_estimates(self.robot, fitted.layout, fitted.fit.interval())
        return replace(result, effects=all_effects(self.robot, self.data, fitted.layout, self.kind))
