"""How many independent numbers the noise of a time series leaves.

Samples of a filtered or drifting signal count as fewer: 1 / (1 + 2 sum rho) each, rho the autocorrelation of the noise
(Bartlett's taper). Noise is what the strongest candidates of the library together cannot explain: the residual itself
still has the causes in it that are searched for, and they would pass for correlation. Where the noise drifts
(`drifts`), the drift is filtered out first (identify/drifting_noise.py), and the rest is counted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from exactarm.diagnose.problem import Fitted, Problem, orthonormal
from exactarm.diagnose.scan import free_mask, scan
from exactarm.identify.correlated import autocorrelation
from exactarm.identify.drifting_noise import DriftingNoise

_LAG_S = 1.0
_ANEW = 0.5  # estimated anew when the square sum of the residual has fallen to this share
_STRONGEST = 10  # candidates: many more would explain noise


class ColouredNoise:
    """Keeps the estimates of a problem, `share` and `drift`, until its residual has become another one."""

    def __init__(self, problem: Problem):
        self._problem = problem
        self._square, self.share, self.drift = np.inf, 1.0, None

    def is_known(self, residual: np.ndarray) -> bool:
        """Whether the estimates hold for a residual of this size still; if not, they are to be made anew."""
        return float(np.sum(residual**2)) >= _ANEW * self._square

    def drift_of(self, fitted: Fitted, runs: Sequence[np.ndarray]) -> DriftingNoise | None:
        """From a fit whose residual has passed no filter."""
        return DriftingNoise.of(self._unexplained(fitted), runs)

    def adopts(self, fitted: Fitted, drift: DriftingNoise | None, runs: Sequence[np.ndarray], step: float) -> bool:
        """Takes the drift and the share behind its filter (of a fit with it) for the present ones, if they claim less.

        Ten of the library explain any slow noise of one run: what has once passed for drift stays so.
        """
        self._square = float(np.sum(fitted.residual**2))
        share = _share_of(self._unexplained(fitted), runs, step)
        if share >= self.share:
            return False
        self.share, self.drift = share, drift
        return True

    def independent_share(self, fitted: Fitted, runs: Sequence[np.ndarray], step: float) -> float:
        """Independent numbers per number of `fitted.whitened`; `runs`: its rows in the order of time."""
        if not self.is_known(fitted.residual):
            self._square = float(np.sum(fitted.residual**2))
            self.share = _share_of(self._unexplained(fitted), runs, step)
        return self.share

    def _unexplained(self, fitted: Fitted) -> np.ndarray:
        """(N, m) whitened residual without what the declared parameters and the strongest candidates explain."""
        from exactarm.diagnose.selection import candidates_for

        residual = fitted.free_residual
        candidates = [e for e in candidates_for(self._problem, fitted) if e.keep(fitted.view) is None]
        strongest = scan(fitted, candidates, float(fitted.data_numbers))[:_STRONGEST]
        columns = [fitted.columns(c.effect)[:, free_mask(c.effect)] for c in strongest if c.evidence > 0.0]
        if columns:
            basis = orthonormal(np.concatenate([fitted.basis, *columns], axis=1))
            residual = residual - basis @ (basis.T @ residual)
        return residual[: fitted.data_numbers].reshape(fitted.residual.shape)


def _share_of(noise: np.ndarray, runs: Sequence[np.ndarray], step: float) -> float:
    shortest = min(len(run) for run in runs)
    lags = int(np.clip(np.ceil(_LAG_S / step), 1, max(shortest // 4, 1)))
    taper = 1.0 - np.arange(1, lags + 1) / (lags + 1)
    sums = [autocorrelation(noise[:, a], runs, lags)[1:] @ taper for a in range(noise.shape[1])]
    return float(np.mean([1.0 / max(1.0 + 2.0 * total, 1.0) for total in sums]))
