"""Fits a layout to motions: weighted least squares of the drive torque, each axis with its own noise.

Weights and parameters are estimated together (layout_fit.py); the intervals count filtered samples as what
they are.
"""

from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout, MotionPrediction, MotionRecord, predict_motion
from exactarm.identify.friction_width import by_turnover
from exactarm.identify.layout_fit import fit_layout, priors_of
from exactarm.noise.autocorrelation import Uncertainty, uncertainty
from exactarm.numerics.regression import Fit
from exactarm.robot.robot import Robot

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
        return self.fit.known_by(self.uncertainty.covariance, self.uncertainty.freedom).interval()

    def residual(self, record: MotionRecord, threads: int = 1) -> np.ndarray:
        """(N', m) measured minus predicted on the rows of any record that count."""
        return predict_motion(self.robot, self.layout, record, tangents=False,
                              threads=threads).residual()[record.keep][:, self.axes]


def fit_motion(robot: Robot, layout: Layout, record: MotionRecord, *, weights: np.ndarray | None = None,
               sigma: np.ndarray | None = None, threads: int = 1) -> MotionFit:
    """Estimates the free parameters of `layout` on the rows of `record`; weights (N,), 0 leaves one out."""
    axes = record.measured_axes
    weight = record.keep.astype(float) * (1.0 if weights is None else weights)
    rows = np.flatnonzero(weight)

    accepted: list[MotionPrediction] = []  # the last: a fit asks for tangents where it stands alone

    def predict(at: Layout, with_jacobian: bool):
        prediction = predict_motion(robot, at, record, tangents=with_jacobian, threads=threads)
        accepted[:] = [prediction] if with_jacobian else accepted
        return prediction.residual()[:, axes], prediction.jacobian[:, axes] if with_jacobian else None

    torque = np.sqrt(np.mean(record.torque[np.ix_(rows, axes)] ** 2, axis=0))
    floor = np.maximum(_LEAST_SHARE * torque, max(_LEAST_OF_ALL * torque.max(), _LEAST_NM))
    first = np.maximum(torque, floor) if sigma is None else sigma
    fitted = fit_layout(predict, layout, weight, first, alike=np.arange(axes.size), floor=floor)
    prediction = accepted[0]
    residual = prediction.residual()[np.ix_(rows, axes)]
    found = _uncertainty(prediction, residual, fitted.sigma, rows, axes, record, layout, fitted.fit.at_bound)
    return MotionFit(robot, fitted.layout, fitted.fit, fitted.sigma, axes, found, prediction)


def _uncertainty(prediction, residual, sigma, rows, axes, record, layout, held) -> Uncertainty:
    """Of the free parameters; none of those that `held` (P,) says a bound holds."""
    turnover = by_turnover(prediction, layout)[np.ix_(rows, axes)]
    held = np.concatenate([held, np.zeros(turnover.shape[2], bool)])
    prior = np.concatenate([priors_of(layout)[1], np.full(turnover.shape[2], np.inf)])
    jacobian = np.concatenate([prediction.jacobian[np.ix_(rows, axes)], turnover], axis=2)
    place = np.full(len(record.keep), -1)
    place[rows] = np.arange(len(rows))
    runs = [place[run][place[run] >= 0] for run in record.runs]
    found = uncertainty(jacobian[:, :, ~held], residual, sigma, [run for run in runs if run.size],
                        record.step, record.noise_autocorrelation, prior[~held])
    covariance = np.zeros((held.size, held.size))
    covariance[np.ix_(~held, ~held)] = found.covariance
    return replace(found, covariance=covariance[: layout.size, : layout.size])
