"""The noise of independent rows: a scale for each component, a family of tails, an error that repeated visits share.

    row i, visit v:  e_i = sigma (z_i / sqrt(w_i) + t_v),   z_i normal, w_i the row's weight (Student: (nu + m) / (nu + |z|^2)),
    t_v normal with variance `shared`: what every visit of one pose has in common.

`whiten` turns any columns (N, m, k) of the measurement into numbers of unit variance that are independent of each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class NoiseModel:
    """sigma (m,) per component; weight (N,), 0 for rows that are wrong by themselves; family: `gauss`, `student` or `gross`.

    visits (N,): numbers of the poses; shared: variance that visits of one pose have in common, in units of sigma^2.
    """

    sigma: np.ndarray
    weight: np.ndarray
    family: str = "gauss"
    freedom: float = np.inf
    log_likelihood: float = 0.0
    visits: np.ndarray | None = None
    shared: float = 0.0

    @property
    def numbers(self) -> int:
        """How many numbers of data take part."""
        return int(np.count_nonzero(self.weight)) * len(self.sigma)

    @property
    def wrong(self) -> np.ndarray:
        """(N,) rows that are wrong by themselves."""
        return self.weight == 0.0

    def whiten(self, columns: np.ndarray) -> np.ndarray:
        """(N, m, k) in units of the measurement as (N m, k) of unit variance."""
        scale = np.sqrt(self.weight)[:, None] / self.sigma
        white = columns * scale[:, :, None]
        if self.shared > 0.0 and self.visits is not None:
            white = self._parted(white)
        return white.reshape(-1, columns.shape[2])

    def _parted(self, white: np.ndarray) -> np.ndarray:
        """Takes from the mean of each pose's visits what they share: covariance 1 + shared u u', u the root of the weights."""
        root = np.sqrt(self.weight)
        square = np.bincount(self.visits, weights=self.weight)
        factor = (1.0 - 1.0 / np.sqrt(1.0 + self.shared * square)) / np.maximum(square, 1e-300)
        order = np.zeros((len(square), *white.shape[1:]))
        np.add.at(order, self.visits, root[:, None, None] * white)
        return white - (root * factor[self.visits])[:, None, None] * order[self.visits]
