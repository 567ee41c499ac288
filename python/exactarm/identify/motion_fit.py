"""Fits a layout to motions: weighted least squares of the drive torque, each axis with its own noise.

The weights are the inverse variances of the residuals, found by iteration (iterated weighted least squares;
Swevers, Ganseman, Tukel, De Schutter and Van Brussel 1997); the intervals count filtered samples as what they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.chain import Layout, MotionPrediction, MotionRecord, predict_motion
from exactarm.identify.correlated import Uncertainty, uncertainty
from exactarm.regression import Evaluation, Fit, least_squares
from exactarm.robot import Robot

_ROUNDS = 6
_SETTLED = 0.01
_LEAST_SHARE = 1e-6  # of an axis' torque: exact data leave no noise to weigh by
_LEAST_OF_ALL = 1e-9  # of the largest axis' torque, for an axis that reports none at all
_LEAST_NM = 1e-12  # where no axis does


@dataclass(frozen=True)
class MotionFit:
    """The layout at its estimate; sigma (m,) Nm of the axes (from 0) whose torque was measured."""

    robot: Robot
    layout: Layout
    fit: Fit
    sigma: np.ndarray
    axes: np.ndarray
    uncertainty: Uncertainty
    prediction: MotionPrediction

    @property
    def intervals(self) -> np.ndarray:
        """(P, 2) 95 %, correlated samples counted as such."""
        return self.uncertainty.interval(self.fit.x)

    def residual(self, record: MotionRecord, threads: int = 1) -> np.ndarray:
        """(N', m) measured minus predicted on the rows of any record that count."""
        return predict_motion(self.robot, self.layout, record, tangents=False, threads=threads).residual()[record.keep][
            :, self.axes
        ]


def fit_motion(
    robot: Robot, layout: Layout, record: MotionRecord, *, weights: np.ndarray | None = None, threads: int = 1
) -> MotionFit:
    """Estimates the free parameters of `layout` on the rows of `record` (weights (N,) per row, 0 leaves it out)."""
    axes = record.measured_axes
    row_weight = record.keep.astype(float) * (1.0 if weights is None else weights)
    rows = np.flatnonzero(row_weight)
    lower = np.array([p.lower for p in layout.parameters])
    upper = np.array([p.upper for p in layout.parameters])

    def evaluate(x: np.ndarray, with_jacobian: bool) -> Evaluation:
        prediction = predict_motion(robot, layout.at(x), record, tangents=with_jacobian, threads=threads)
        residual = prediction.residual()[np.ix_(rows, axes)]
        jacobian = None
        if with_jacobian:
            jacobian = np.zeros((residual.size, layout.size))
            if layout.size:
                jacobian = prediction.jacobian[np.ix_(rows, axes)].reshape(residual.size, -1)
        return Evaluation(residual.ravel(), jacobian)

    torque = np.sqrt(np.mean(record.torque[np.ix_(rows, axes)] ** 2, axis=0))
    floor = np.maximum(_LEAST_SHARE * torque, max(_LEAST_OF_ALL * torque.max(), _LEAST_NM))
    sigma, x = np.maximum(torque, floor), layout.values
    for _ in range(_ROUNDS):
        each = (row_weight[rows, None] / sigma).ravel()
        fit = least_squares(evaluate, x, weights=each, bounds=(lower, upper))
        residual = fit.residual.reshape(len(rows), -1)
        share = max(1.0 - layout.size / residual.size, 0.1)
        new = np.maximum(np.sqrt(np.mean(residual**2, axis=0) / share), floor)
        settled = np.all(np.abs(new / sigma - 1.0) < _SETTLED)
        x, sigma = fit.x, new
        if settled:
            break
    prediction = predict_motion(robot, layout.at(x), record, threads=threads)
    found = _uncertainty(prediction, residual, sigma, rows, axes, record, layout.size)
    return MotionFit(robot, layout.at(x), fit, sigma, axes, found, prediction)


def _uncertainty(prediction, residual, sigma, rows, axes, record, size) -> Uncertainty:
    jacobian = np.zeros((len(rows), len(axes), size))
    if size:
        jacobian = prediction.jacobian[np.ix_(rows, axes)]
    place = np.full(len(record.keep), -1)
    place[rows] = np.arange(len(rows))
    runs = [place[run][place[run] >= 0] for run in record.runs]
    return uncertainty(jacobian, residual, sigma, [run for run in runs if run.size], record.step,
                       record.noise_autocorrelation)
