"""Fits a layout to static poses: weighted least squares through the chain, frames of all sessions at once.

Position and orientation carry different noise; where both are used, their variances are estimated from the
residuals and the fit is repeated (iterative variance-component estimation, Förstner 1979).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.dataset import Dataset
from exactarm.regression import Evaluation, Fit, least_squares
from exactarm.robot import Robot

_VARIANCE_ROUNDS = 4
_VARIANCE_TOLERANCE = 0.05


@dataclass(frozen=True)
class PoseFit:
    """The layout at its estimate, the fit, and the standard deviations (m, rad) of the residual components."""

    robot: Robot
    layout: Layout
    fit: Fit
    sigma_position: float
    sigma_orientation: float | None

    def error(self, data: Dataset, threads: int = 1) -> np.ndarray:
        """(N,) Euclidean position errors in m on any rows of the same sessions."""
        return np.linalg.norm(self.residual(data, threads), axis=1)

    def residual(self, data: Dataset, threads: int = 1) -> np.ndarray:
        """(N, 3) measured minus predicted position in m."""
        return predict_poses(self.robot, self.layout, data, tangents=False, threads=threads).residual()


def fit_poses(
    robot: Robot,
    layout: Layout,
    data: Dataset,
    *,
    orientation: bool = False,
    robust: bool = False,
    weights: np.ndarray | None = None,
    threads: int = 1,
    sigma: np.ndarray | None = None,
    tolerance: float = 1e-10,
) -> PoseFit:
    """Estimates the free parameters of `layout` from all rows of `data`. `weights` (N,) per row, 0 leaves
    it out; `sigma` (1,) or (2,): first guess of the standard deviations (m, rad);
    `tolerance`: relative fall of the square sum at which the search ends."""
    rows = len(data.session)
    row_weight = np.ones(rows) if weights is None else weights
    lower = np.array([p.lower for p in layout.parameters])
    upper = np.array([p.upper for p in layout.parameters])

    pull = layout.prior_rows()

    def evaluate(x: np.ndarray, with_jacobian: bool) -> Evaluation:
        prediction = predict_poses(robot, layout.at(x), data, tangents=with_jacobian, threads=threads)
        residual = prediction.residual(orientation)
        jacobian = None
        if with_jacobian:
            jacobian = prediction.jacobian[:, : residual.shape[1]].reshape(residual.size, -1)
            jacobian = np.concatenate([jacobian, pull])
        return Evaluation(np.concatenate([residual.ravel(), -pull @ x]), jacobian)

    kinds = 2 if orientation else 1
    sigma = np.full(kinds, 1e-4) if sigma is None else np.asarray(sigma, float)
    x = layout.values
    for _ in range(_VARIANCE_ROUNDS if orientation or len(pull) else 1):
        each = np.repeat(1.0 / sigma, 3)
        fit = least_squares(
            evaluate,
            x,
            weights=np.concatenate([(row_weight[:, None] * each).ravel(), np.ones(len(pull))]),
            bounds=(lower, upper),
            robust=robust,
            group=3,
            data_rows=rows * 3 * kinds,
            tolerance=tolerance,
        )
        residual = fit.clipped[: rows * 3 * kinds].reshape(rows, -1)[row_weight > 0]
        share = 1.0 - layout.size / max(fit.freedom + layout.size, 1)
        new = np.sqrt(np.array([np.mean(part**2) for part in np.split(residual, residual.shape[1] // 3, axis=1)]) / share)
        x = fit.x
        if not (orientation or len(pull)) or np.all(np.abs(new / sigma - 1.0) < _VARIANCE_TOLERANCE):
            break
        sigma = np.maximum(new, 1e-12)
    return PoseFit(robot, layout.at(fit.x), fit, float(new[0]), float(new[1]) if orientation else None)
