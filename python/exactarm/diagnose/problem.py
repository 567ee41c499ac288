"""What the diagnosis needs of one kind of data, and nothing that depends on the kind.

A problem holds robot and identification data and can fit any layout of effects to them through the chain. A
`Fitted` state carries the whitened residual, the declared model's Jacobian and the responses of effects that
are not in the model yet.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from exactarm.chain import Layout, View
from exactarm.dataset import Dataset
from exactarm.effects.base import Effect
from exactarm.regression import Fit
from exactarm.robot import Robot


@dataclass(frozen=True)
class Fitted:
    """A layout at its estimate on the identification rows.

    residual (N, m) measured minus predicted; jacobian (N, m, P) of the prediction; sigma (m,) standard
    deviation of each component; weight (N,) 0 for rows that are left out, 1 otherwise.
    """

    robot: Robot
    layout: Layout
    fit: Fit
    residual: np.ndarray
    jacobian: np.ndarray
    sigma: np.ndarray
    weight: np.ndarray
    view: View

    @cached_property
    def scale(self) -> np.ndarray:
        """(N, m) what a residual is multiplied with to have unit variance."""
        return self.weight[:, None] / self.sigma

    @cached_property
    def whitened(self) -> np.ndarray:
        """(N m,) the residual with unit variance."""
        return (self.residual * self.scale).ravel()

    def square(self, sigma: np.ndarray) -> float:
        """Square sum of the residual in units of `sigma` (m,), so that different fits can be compared."""
        return float(np.sum((self.weight[:, None] * self.residual / sigma) ** 2))

    @cached_property
    def basis(self) -> np.ndarray:
        """(N m, r) orthonormal basis of what the free parameters can explain."""
        columns = (self.jacobian * self.scale[:, :, None]).reshape(self.whitened.size, -1)
        norm = np.linalg.norm(columns, axis=0)
        left, values, _ = np.linalg.svd(columns[:, norm > 0] / norm[norm > 0], full_matrices=False)
        return left[:, values > 1e-9 * values[0]] if values.size else left

    def columns(self, effect: Effect) -> np.ndarray:
        """(N m, k) whitened response to the parameters of an effect that is not in the layout."""
        response = self.view.response(effect)[:, : self.residual.shape[1]]
        return (response * self.scale[:, :, None]).reshape(self.whitened.size, -1)


class Problem(ABC):
    """One kind of data of one robot. `data` are the identification rows, `held_out` the validation rows."""

    unit: str = ""
    kind: str = ""

    def __init__(self, robot: Robot, data: Dataset, held_out: Dataset, threads: int = 1, seed: int = 0):
        self.robot, self.data, self.held_out = robot, data, held_out
        self.threads, self.seed = threads, seed

    @abstractmethod
    def declared(self) -> Layout:
        """The declared model, ready to be re-identified; parameters that the data cannot tell are held."""

    @abstractmethod
    def fit(self, layout: Layout, weight: np.ndarray | None = None) -> Fitted:
        """Estimates the free parameters of `layout` on the identification rows (weight (N,) 0 or 1)."""

    @abstractmethod
    def errors(self, fitted: Fitted, data: Dataset) -> np.ndarray:
        """(K,) the errors of any rows whose RMS the contract of this kind of data asks for."""

    @abstractmethod
    def groups(self) -> np.ndarray:
        """(N,) int: identification rows that must not be parted in a cross-validation."""

    @abstractmethod
    def signals(self, fitted: Fitted) -> dict[str, np.ndarray]:
        """Named signals (N,) that a residual might follow: angles, torques, directions, time, covariates."""

    @abstractmethod
    def repeat_noise(self, fitted: Fitted) -> float | None:
        """Standard deviation of a residual component, in units of sigma, from repeated visits; None without."""

    def correlation_factor(self, fitted: Fitted) -> float:
        """Independent numbers per number of data; below 1 where neighbouring samples are correlated."""
        return 1.0
