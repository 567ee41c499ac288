"""Fits a layout to static poses: weighted least squares through the chain, frames of all sessions at once.

Position and orientation carry different noise: two variances, estimated together with the parameters
(layout_fit.py); a variance for every component where these differ much, as of a device that tells the
distance better than its angles: weighed alike, the noise of one is in all parameters.
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
# of the standard deviations of what is left of two components: up to here weights that are alike make an
# estimate of all three no worse than by a fifth, and a cause that is missing makes them differ, too
_APART = 2.0
_ROWS_A_PARAMETER = 1.5  # fewer rows do not tell the components apart


@dataclass(frozen=True)
class PoseFit:
    """The layout at its estimate, the fit, the standard deviations (3,) or (6,) of the residual components
    (m, rad), and the prediction of the fitted rows with its Jacobian."""

    robot: Robot
    layout: Layout
    fit: Fit
    sigma: np.ndarray
    prediction: PosePrediction
    drawn: Drawn = FREE

    @property
    def sigma_position(self) -> float:
        """m, root mean square of the components."""
        return float(np.sqrt(np.mean(self.sigma[:3] ** 2)))

    @property
    def sigma_orientation(self) -> float | None:
        """rad; None where positions alone were fitted."""
        return float(np.sqrt(np.mean(self.sigma[3:] ** 2))) if len(self.sigma) > 3 else None

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
    left = accepted[0].residual(orientation)[weight > 0.0]
    apart = _numbered(np.sqrt(np.mean(left**2, axis=0)))
    if not robust and np.any(apart != alike) and len(left) >= _ROWS_A_PARAMETER * layout.size:
        found = fit_layout(predict, found.layout, weight, found.sigma, alike=apart, tolerance=tolerance,
                           drawing=drawn.to, worth=worth)
    return PoseFit(robot, found.layout, found.fit, found.sigma, accepted[0], drawn)


def _numbered(spread: np.ndarray) -> np.ndarray:
    """(m,) number of the variance of each component, by what is left of them (m,): one a kind where they are
    nearly alike, else each its own."""
    found = np.zeros(0, int)
    for kind in np.split(spread, range(3, len(spread), 3)):
        own = np.arange(3) if kind.max() > _APART * kind.min() else np.zeros(3, int)
        found = np.append(found, own + found.max(initial=-1) + 1)
    return found
