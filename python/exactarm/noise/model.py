"""The noise of independent rows: a scale for each component, a family of tails, an error that repeated visits
share.

    row i, pose v:  e_i = sigma (z_i / sqrt(w_i) + t_v + u_i) + rounding_i r_v,
                     z_i normal, w_i the row's weight (Student: (nu + m) / (nu + |z|^2)),
    t_v normal with variance `shared`: what every visit of one pose has in common, of whatever cause; r_v
        standard normal: by how much its angles were rounded, seen from where the row was measured;
    u_i: what rows share that were measured one after another (wandering.py).

`whiten` turns any columns (N, m, k) of the measurement into numbers of unit variance that are independent of
each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from exactarm.noise.wandering import SESSIONS_APART, Wandering, kernel
from exactarm.numerics.factors import cholesky


@dataclass(frozen=True)
class NoiseModel:
    """sigma (m,) per component; weight (N,), 0 for rows that are wrong by themselves; family: `gauss`,
    `student` or `gross`.

    visits (N,): numbers of the poses from 0; shared: variance that visits of one pose have in common, in
    units of sigma^2; rounding (N, m, n): what the rounding of each axis by its standard deviation does to
    every row, in the measurement's units, None where nothing is rounded. wandering: what neighbours in
    the order (N,) of the rows have in common. wrong_probability: that any row is wrong by itself, and no
    heavy tail of all of them. together: how many rows seemed to be, yet lie together in space and err the
    same way, and nothing in time explains that. jumps: how many are likelier than the wandering (jumps.py).
    """

    sigma: np.ndarray
    weight: np.ndarray
    family: str = "gauss"
    freedom: float = np.inf
    log_likelihood: float = 0.0
    visits: np.ndarray | None = None
    shared: float = 0.0
    rounding: np.ndarray | None = None
    wandering: Wandering | None = None
    order: np.ndarray | None = None
    wrong_probability: float = 0.0
    together: int = 0
    jumps: int = 0

    @property
    def held_share(self) -> float:
        """Of what the rows' weights promise to tell of a parameter, what a Student law of nu degrees of
        freedom holds: (nu + m) / (nu + m + 2), its Fisher information. Weights that follow the residual look
        as if they had been known (Lange, Little and Taylor 1989)."""
        m = len(self.sigma)
        return (self.freedom + m) / (self.freedom + m + 2.0) if np.isfinite(self.freedom) else 1.0

    @property
    def numbers(self) -> float:
        """How many independent normal numbers the data are worth."""
        return self.held_share * float(np.count_nonzero(self.weight)) * len(self.sigma)

    @property
    def of_a_row(self) -> np.ndarray:
        """(m,) standard deviation of a row that is not wrong by itself: its tails, what visits share and what
        neighbours share in it."""
        tails = self.freedom / (self.freedom - 2.0) if np.isfinite(self.freedom) else 1.0
        rounding = 0.0 if self.rounding is None else np.mean(np.sum(self.rounding**2, axis=2), axis=0)
        return np.sqrt((self.sigma**2 * (self.wander_over_rest**2 + self.shared) + rounding) * tails)

    @property
    def wrong(self) -> np.ndarray:
        """(N,) rows that are wrong by themselves."""
        return self.weight == 0.0

    def whiten(self, columns: np.ndarray) -> np.ndarray:
        """(N, m, k) in units of the measurement as (N m, k) of unit variance."""
        scale = np.sqrt(self.weight)[:, None] / self.sigma
        white = columns * scale[:, :, None]
        white = self._parted(white)
        if self.wandering is not None:
            rows = white.reshape(len(white), -1)
            white = linalg.solve_triangular(self._root, rows, lower=True,
                                            check_finite=False).reshape(white.shape)
        return white.reshape(-1, columns.shape[2])

    @cached_property
    def _root(self) -> np.ndarray:
        """(N, N) lower: the covariance of rows that `whiten` would leave without the wandering."""
        return np.linalg.cholesky(np.eye(len(self.order))
                                  + self.wandering.ratio
                                  * self.seen(kernel(self.order, self.wandering.memory)))

    def seen(self, covariance: np.ndarray) -> np.ndarray:
        """A covariance (N, N) of rows as their weights, and what visits share, let it through."""
        once = self._rows_alone(covariance)
        return self._rows_alone(once.T)

    def _rows_alone(self, columns: np.ndarray) -> np.ndarray:
        """(N, k) weighted, and cleared of what visits share; sigma apart."""
        return self._parted((np.sqrt(self.weight)[:, None] * columns)[:, None, :])[:, 0]

    def log_density(self, residual: np.ndarray, declared: np.ndarray | None) -> float:
        """Of other residuals (N, m) of the same rows, but for a constant; without tails and wandering. What
        declared columns (N, m, P) have taken from them is integrated out (restricted likelihood)."""
        white = self.whiten(residual[:, :, None])[:, 0]
        value = -len(residual) * np.sum(np.log(self.sigma)) - 0.5 * np.sum(np.log1p(self._common[1]))
        if declared is not None:
            columns = self.whiten(declared)
            factor = cholesky(columns.T @ columns)
            value -= np.sum(np.log(np.diag(factor)))
            taken = linalg.solve_triangular(factor, columns.T @ white, lower=True, check_finite=False)
            return float(value - 0.5 * (white @ white - taken @ taken))
        return float(value - 0.5 * white @ white)

    def wanders_like(self, other: NoiseModel) -> bool:
        """Whether two models weigh what neighbours share alike."""
        if self.wandering is None or other.wandering is None:
            return self.wandering is other.wandering
        return (
            self.wandering.memory == other.wandering.memory
            and 0.5 < self.wandering.ratio / other.wandering.ratio < 2.0
        )

    @property
    def wander_over_rest(self) -> float:
        """How many times larger the noise is with the wandering than without."""
        return 1.0 if self.wandering is None else float(np.sqrt(1.0 + self.wandering.ratio))

    @property
    def common_to_neighbours(self) -> float:
        """Share of a row's variance that it has in common with the next one: of a memory of one row there is
        little, however much of the noise has it."""
        if self.wandering is None:
            return 0.0
        ratio = self.wandering.ratio
        return float(ratio * np.exp(-1.0 / self.wandering.memory) / (1.0 + ratio))

    @cached_property
    def stretches(self) -> float:
        """How many independent values the wandering takes in a session, on the average: (tr K)² / tr K², K
        (N, N) its correlation. Few are a drift: no mean over the rows is free of it."""
        if self.wandering is None:
            return np.inf
        sessions = 1 + np.count_nonzero(np.diff(np.sort(self.order)) > 0.5 * SESSIONS_APART)
        together = kernel(self.order, self.wandering.memory)
        return float(len(self.order) ** 2 / np.sum(together**2) / sessions)

    @cached_property
    def _common(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What visits of a pose share: columns (N, m, k) in units of sigma and of the rows' weights, B of a
        pose; the eigenvalues (G, k) of its B'B, and the kernel (G, k, k) of the inverse root of 1 + BB',
        1 - B kernel B'."""
        shape = (len(self.visits), len(self.sigma), len(self.sigma))
        columns = np.broadcast_to(np.sqrt(self.shared) * np.eye(len(self.sigma)), shape)
        if self.rounding is not None:
            columns = np.concatenate([columns, self.rounding / self.sigma[:, None]], axis=2)
        columns = np.sqrt(self.weight)[:, None, None] * columns
        value, vector = np.linalg.eigh(self._by_pose(np.swapaxes(columns, 1, 2) @ columns))
        value = np.maximum(value, 1e-12)
        part = (1.0 - 1.0 / np.sqrt(1.0 + value)) / value
        return columns, value, (vector * part[:, None, :]) @ np.swapaxes(vector, 1, 2)

    def _by_pose(self, values: np.ndarray) -> np.ndarray:
        """(G, ...) sums of (N, ...) over the visits of each pose."""
        return (self._poses @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])

    @cached_property
    def _poses(self) -> sparse.csr_array:
        """(G, N) 1 for the visits of a pose."""
        rows = np.arange(len(self.visits))
        return sparse.csr_array((np.ones(len(rows)), (self.visits, rows)))

    @cached_property
    def _parting(self) -> sparse.csr_array:
        """(N, N) takes from the mean of each pose's visits what they share, where that is alike in every
        component, or on the average: covariance 1 + shared u u', u the root of the weights."""
        shared = self.shared
        if self.rounding is not None:
            shared += float(np.mean(np.sum((self.rounding / self.sigma[:, None]) ** 2, axis=2)))
        square = np.bincount(self.visits, weights=self.weight)
        factor = (1.0 - 1.0 / np.sqrt(1.0 + shared * square)) / np.maximum(square, 1e-300)
        rows = np.arange(len(self.visits))
        u = sparse.csr_array((np.sqrt(self.weight), (rows, self.visits)), shape=(len(rows), len(square)))
        return sparse.csr_array(sparse.eye_array(len(rows)) - u @ sparse.diags_array(factor) @ u.T)

    def _parted(self, white: np.ndarray) -> np.ndarray:
        """(N, c, k) without what visits of one pose share; c = 1 for any one component."""
        if self.visits is None or (self.shared == 0.0 and self.rounding is None):
            return white
        if self.rounding is None or white.shape[1] != len(self.sigma):
            return (self._parting @ white.reshape(len(white), -1)).reshape(white.shape)
        columns, _, kernel = self._common
        along = kernel @ self._by_pose(np.swapaxes(columns, 1, 2) @ white)
        return white - columns @ along[self.visits]
