"""Fits a layout to static poses: weighted least squares through the chain, frames of all sessions at once.

Position and orientation carry different noise: two variances, estimated together with the parameters
(layout_fit.py).
"""

from dataclasses import dataclass

import numpy as np

from exactarm.chain import Layout, PosePrediction, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.identify.drawing import FREE, Drawn
from exactarm.identify.layout_fit import fit_layout
from exactarm.numerics.regression import Fit
from exactarm.robot.robot import Robot

_FIRST_SIGMA = 1e-4  # m, rad


@dataclass(frozen=True)
class PoseFit:
    """The layout at its estimate, the fit, the standard deviations (m, rad) of the residual components, and
    the prediction of the fitted rows with its Jacobian."""

    robot: Robot
    layout: Layout
    fit: Fit
    sigma_position: float
    sigma_orientation: float | None
    prediction: PosePrediction
    drawn: Drawn = FREE

    def error(self, data: Dataset, threads: int = 1) -> np.ndarray:
        """(N,) Euclidean position errors in m on any rows of the same sessions."""
        return np.linalg.norm(self.residual(data, threads), axis=1)

    def residual(self, data: Dataset, threads: int = 1) -> np.ndarray:
        """(N, 3) measured minus predicted position in m."""
        return predict_poses(self.robot, self.layout, data, tangents=False, threads=threads).residual()


def fit_poses(robot: Robot, layout: Layout, data: Dataset, *, orientation: bool = False, robust: bool = False,
              weights: np.ndarray | None = None, threads: int = 1, sigma: np.ndarray | None = None,
              tolerance: float = 1e-10, drawn: Drawn = FREE, worth: np.ndarray | None = None) -> PoseFit:
    """Estimates the free parameters of `layout` from all rows of `data`. `weights` (N,) per row, 0 leaves
    it out; `sigma` (1,) or (2,): first guess of the standard deviations (m, rad);
    `tolerance`: relative fall of the square sum at which the search ends; `drawn`: to what the
    declared parameters are; `worth` (N,): independent rows that each is worth (repeats.py)."""
    accepted: list[PosePrediction] = []  # the last: a fit asks for tangents where it stands alone

    def predict(at: Layout, with_jacobian: bool):
        if with_jacobian:
            accepted.clear()  # two at once are a lot of memory
        prediction = predict_poses(robot, at, data, tangents=with_jacobian, threads=threads)
        accepted.extend([prediction] if with_jacobian else [])
        residual = prediction.residual(orientation)
        return residual, prediction.jacobian[:, : residual.shape[1]] if with_jacobian else None

    weight = np.ones(len(data.session)) if weights is None else weights
    alike = np.repeat(np.arange(2 if orientation else 1), 3)
    first = np.full(alike.size, _FIRST_SIGMA) if sigma is None else np.repeat(np.asarray(sigma, float), 3)
    found = fit_layout(predict, layout, weight, first, alike=alike, robust=robust, tolerance=tolerance,
                       drawing=drawn.to, worth=worth)
    return PoseFit(
        robot, found.layout, found.fit, float(found.sigma[0]), float(found.sigma[3]) if orientation else None,
        accepted[0], drawn)
