"""Fits a layout to gear runs: weighted least squares of all components of the reading through the chain.

Coefficients of gear tables are drawn towards their declared values with their plausible spread: neighbouring
orders cannot be told apart on a short range, and would grow without bound against each other.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.chain import GearRecord, GearRunPrediction, Layout, gear_record, predict_gear_run
from exactarm.data.dataset import Dataset
from exactarm.identify.layout_fit import fit_layout
from exactarm.noise.drifting import DriftingNoise
from exactarm.numerics.regression import Fit
from exactarm.robot.robot import Robot

_LEAST_SIGMA = 1e-9  # rad/s or rad
_TOLERANCE = 1e-8  # relative fall of the square sum that ends a fit


@dataclass(frozen=True)
class GearFit:
    """The layout at its estimate, the fit, the standard deviation (m,) by component, the last prediction."""

    robot: Robot
    layout: Layout
    fit: Fit
    sigma: np.ndarray
    prediction: GearRunPrediction


def fit_gear_runs(robot: Robot, layout: Layout, data: Dataset, *, record: GearRecord | None = None,
                  weights: np.ndarray | None = None, drift: DriftingNoise | None = None,
                  threads: int = 1) -> GearFit:
    """Estimates the free parameters of `layout`; weights (N,) per row, 0: left out; drift: of the noise."""
    record = gear_record(robot, data) if record is None else record
    used = record.keep.astype(float) if weights is None else record.keep * weights
    white = (lambda values: values) if drift is None else drift.white
    known: dict[bytes, GearRunPrediction] = {}

    def predicted(at: Layout) -> GearRunPrediction:
        # Nearly every trial is accepted, so its tangents come along at once.
        key = at.values.tobytes()
        if key not in known:
            known.clear()
            known[key] = predict_gear_run(robot, at, data, record=record, threads=threads)
        return known[key]

    def predict(at: Layout, with_jacobian: bool):
        prediction = predicted(at)
        return white(prediction.residual()), white(prediction.jacobian) if with_jacobian else None

    components = predicted(layout).residual().shape[1]
    found = fit_layout(
        predict, layout, used, alike=np.arange(components), floor=_LEAST_SIGMA, tolerance=_TOLERANCE)
    return GearFit(robot, found.layout, found.fit, found.sigma, predicted(found.layout))
