"""Fits a layout to gear runs: weighted least squares of all components of the reading through the chain.

Coefficients of gear tables are drawn towards their declared values with their plausible spread: neighbouring orders
cannot be told apart on a short range, and would grow without bound against each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.chain import GearRecord, GearRunPrediction, Layout, gear_record, predict_gear_run
from exactarm.dataset import Dataset
from exactarm.identify.drifting_noise import DriftingNoise
from exactarm.regression import Evaluation, Fit, least_squares
from exactarm.robot import Robot

_ROUNDS = 2
_LEAST_SIGMA = 1e-9


@dataclass(frozen=True)
class GearFit:
    """The layout at its estimate, the fit, the standard deviation (m,) of each component, the last prediction."""

    robot: Robot
    layout: Layout
    fit: Fit
    sigma: np.ndarray
    prediction: GearRunPrediction

    def predict(self, data: Dataset, record: GearRecord | None = None, threads: int = 1) -> GearRunPrediction:
        """Prediction of any rows, without tangents."""
        return predict_gear_run(self.robot, self.layout, data, record=record, tangents=False, threads=threads)


def fit_gear_runs(
    robot: Robot,
    layout: Layout,
    data: Dataset,
    *,
    record: GearRecord | None = None,
    weights: np.ndarray | None = None,
    drift: DriftingNoise | None = None,
    threads: int = 1,
) -> GearFit:
    """Estimates the free parameters of `layout`; `weights` (N,) per row, 0 leaves it out; `drift`: of the noise."""
    record = gear_record(robot, data) if record is None else record
    used = record.keep.astype(float) if weights is None else record.keep * weights
    parameters = layout.parameters
    bounds = np.array([p.lower for p in parameters]), np.array([p.upper for p in parameters])
    centre, spread = _priors(layout)
    prior = np.flatnonzero(np.isfinite(spread))
    white = (lambda values: values) if drift is None else drift.white

    known: dict[bytes, GearRunPrediction] = {}

    def predicted(at: np.ndarray) -> GearRunPrediction:
        # Nearly every trial is accepted, so its tangents come along at once.
        if at.tobytes() not in known:
            known.clear()
            known[at.tobytes()] = predict_gear_run(robot, layout.at(at), data, record=record, threads=threads)
        return known[at.tobytes()]

    def evaluate(x: np.ndarray, with_jacobian: bool) -> Evaluation:
        prediction = predicted(x)
        residual = np.concatenate([white(prediction.residual()).ravel(), (centre - x)[prior] / spread[prior]])
        if not with_jacobian:
            return Evaluation(residual, None)
        drawn = np.zeros((prior.size, layout.size))
        drawn[np.arange(prior.size), prior] = 1.0 / spread[prior]
        return Evaluation(residual, np.concatenate([white(prediction.jacobian).reshape(-1, layout.size), drawn]))

    x = layout.values
    sigma = _component_sigma(white(predicted(x).residual()), used)
    for _ in range(_ROUNDS):
        weight = np.concatenate([(used[:, None] / sigma).ravel(), np.ones(prior.size)])
        fit = least_squares(evaluate, x, weights=weight, bounds=bounds, tolerance=1e-8)
        x = fit.x
        prediction = predicted(x)
        before, sigma = sigma, _component_sigma(white(prediction.residual()), used)
        if np.all(np.abs(sigma / before - 1.0) < 0.2):
            break
    return GearFit(robot, layout.at(x), fit, sigma, prediction)


def _priors(layout: Layout) -> tuple[np.ndarray, np.ndarray]:
    """Centre and standard deviation (P,) of each parameter's prior: the declared value with its plausible spread, or
    what the effect itself asks for around zero; infinite for the others."""
    centre, spread = np.zeros(layout.size), np.array(layout.prior, float)
    for effect, mask, where in zip(layout.effects, layout.free, layout.slices):
        if getattr(effect, "drawn_to_declared", False):
            centre[where] = np.array(effect.values)[mask]
            spread[where] = np.array([p.plausible for p in effect.parameters()])[mask]
    return centre, spread


def _component_sigma(residual: np.ndarray, used: np.ndarray) -> np.ndarray:
    return np.maximum(np.sqrt(np.mean(residual[used > 0] ** 2, axis=0)), _LEAST_SIGMA)
