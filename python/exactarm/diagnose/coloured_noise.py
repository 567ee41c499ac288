"""How many independent numbers the noise of a time series leaves.

Samples of a filtered or drifting signal count as fewer: 1 / (1 + 2 sum rho) each, rho the autocorrelation of
the noise (Bartlett's taper). Noise is what the surest candidates of the library cannot explain: the residual
itself still has the causes in it that are searched for, and they would pass for correlation. Many fitted
columns take the slow part of the noise with them, and the sum over long lags then says that there is none:
where a record is short for its noise (`short`), an autoregression over the first few lags (Yule and Walker),
which are hardly touched by that, and the restricted likelihood (noise/restricted_memory.py) have a say too,
and the smallest share counts. Behind a low-pass of our own
(`filtered`) there are at most as many as it leaves of white noise on the rows in use, whatever the columns
took. Where the noise drifts (`drifts`), the drift is filtered out first (noise/drifting.py), and the rest is
counted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import linalg

from exactarm.diagnose.decisions import LEAST_EVIDENCE
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.joint_fit import candidates_for
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.scan import Candidate, linear_columns, log_evidence, scan
from exactarm.noise.autocorrelation import autocorrelation, lags_within
from exactarm.noise.drifting import DriftingNoise
from exactarm.noise.restricted_memory import restricted_share
from exactarm.numerics.orthonormal import added_to

NOISE_LAG_S = 1.0
_SHORT_S, _SHORT_LAGS = 0.15, 3
_ANEW = 0.5  # estimated anew when the square sum of the residual has fallen to this share
_STRONGEST, _PAIRED = 10, 5  # candidates


@dataclass(frozen=True)
class NoiseMemory:
    """What is known of the noise: share, independent numbers per number; drift; square sum of the residual it
    was estimated from. It goes from fit to fit as a value, so that a fit depends on what it is given
    alone."""

    square: float = np.inf
    share: float = 1.0
    drift: DriftingNoise | None = None

    def holds_for(self, residual: np.ndarray) -> bool:
        """Whether the estimates hold for a residual of this size still; if not, they are to be made anew."""
        return float(np.sum(residual**2)) >= _ANEW * self.square


class ColouredNoise:
    """Estimates how much the noise of a problem remembers; filtered(lags): autocorrelation (lags + 1,) of
    white noise behind the low-pass that the rows have passed, None where they have passed none; short: s, the
    longest memory of noise where records are short for it, else 0."""

    def __init__(self, problem: Problem, short: float = 0.0,
                 filtered: Callable[[int], np.ndarray] | None = None):
        self._problem, self._short, self._filtered = problem, short, filtered

    def drift_of(self, fitted: Fitted, runs: Sequence[np.ndarray], step: float) -> DriftingNoise | None:
        """From a fit whose residual has passed no filter."""
        return DriftingNoise.of(self._unexplained(fitted, runs, step)[0], runs)

    def of(self, fitted: Fitted, runs: Sequence[np.ndarray], step: float,
           drift: DriftingNoise | None = None) -> NoiseMemory:
        """From a fit (behind the filter of `drift`); `runs`: its rows in the order of time, `step` apart in
        s."""
        noise, basis = self._unexplained(fitted, runs, step)
        share = self._share_of(noise, fitted.weight, runs, step)
        if self._short:
            share = min(share, restricted_share(noise, basis, runs, step, self._short))
        return NoiseMemory(float(np.sum(fitted.residual**2)), share, drift)

    def renewed(self, known: NoiseMemory, fitted: Fitted, runs: Sequence[np.ndarray],
                step: float) -> NoiseMemory:
        """What is known, or a new estimate where the residual has become another one."""
        return known if known.holds_for(fitted.residual) else self.of(fitted, runs, step, known.drift)

    def share_of(self, fitted: Fitted, runs: Sequence[np.ndarray], step: float) -> float:
        """Of a fit whose residual has passed no filter, as it stands."""
        return self._share_of(fitted.residual, fitted.weight, runs, step)

    def _share_of(self, noise: np.ndarray, weight: np.ndarray, runs: Sequence[np.ndarray],
                  step: float) -> float:
        share = _share_of(noise, runs, step)
        if self._filtered is not None:
            share = min(share, filtered_share(self._filtered, weight > 0.0, runs, step))
        return min(share, autoregressive_share(noise, runs, step)) if self._short else share

    def _unexplained(self, fitted: Fitted, runs: Sequence[np.ndarray],
                     step: float) -> tuple[np.ndarray, np.ndarray]:
        """(N, m) whitened residual without what the declared parameters and the surest candidates explain,
        and a basis (N m, b) of these.

        Candidates come in one by one, or two that hide each other; each pays with the independent numbers
        that are in what it leaves. So a cause that leaves white noise is sure, and one more curve through
        slow noise is not.
        """
        numbers, shape = fitted.data_numbers, fitted.residual.shape
        basis, residual = fitted.basis, fitted.free_residual
        candidates = [e for e in candidates_for(self._problem, fitted) if e.keep(fitted.view) is None]
        strongest = [c for c in scan(fitted, candidates, float(numbers))[:_STRONGEST] if c.evidence > 0.0]
        columns = {c.label: linear_columns(fitted, c.effect) for c in strongest}

        def tried(group: tuple[Candidate, ...]) -> tuple[float, np.ndarray, np.ndarray]:
            added = added_to(basis, np.concatenate([columns[c.label] for c in group], axis=1))
            left = residual - added @ (added.T @ residual)
            share = self._share_of(left[:numbers].reshape(shape), fitted.weight, runs, step)
            count = max(share * (numbers - basis.shape[1]), 1.0)
            square, price = float(residual @ residual), np.prod(
                [float(c.tried * len(candidates)) for c in group])
            return log_evidence(square, square - float(left @ left), count, sum(c.free for c in group),
                                price), added, left

        while strongest:
            for groups in ([(c,) for c in strongest], list(combinations(strongest[:_PAIRED], 2))):
                found = {group: tried(group) for group in groups}
                best = max(found, key=lambda group: found[group][0], default=None)
                if best is not None and found[best][0] >= LEAST_EVIDENCE:
                    break
            else:
                break
            basis, residual = np.concatenate([basis, found[best][1]], axis=1), found[best][2]
            strongest = [c for c in strongest if c not in best]
        return residual[:numbers].reshape(shape), basis[:numbers]


def _share_of(noise: np.ndarray, runs: Sequence[np.ndarray], step: float) -> float:
    lags = lags_within(runs, NOISE_LAG_S, step)
    taper = 1.0 - np.arange(1, lags + 1) / (lags + 1)
    sums = [autocorrelation(noise[:, a], runs, lags)[1:] @ taper for a in range(noise.shape[1])]
    return float(np.mean([1.0 / max(1.0 + 2.0 * total, 1.0) for total in sums]))


def filtered_share(filtered: Callable[[int], np.ndarray], used: np.ndarray, runs: Sequence[np.ndarray],
                   step: float) -> float:
    """Independent numbers per number of filtered white noise on the rows in use (N,) bool: two of them count
    together where both are, which fewer are the more gaps there are."""
    lags = lags_within(runs, NOISE_LAG_S, step)
    both = autocorrelation(used.astype(float), runs, lags)[1:]
    return float(1.0 / max(1.0 + 2.0 * (filtered(lags)[1:] @ both), 1.0))


def autoregressive_share(noise: np.ndarray, runs: Sequence[np.ndarray], step: float) -> float:
    """Independent numbers per number of (N, m) noise: variance over long-run variance, s^2 / (1 - sum
    phi)^2."""
    lags = int(np.clip(round(_SHORT_S / step), 1, _SHORT_LAGS))
    shares = []
    for a in range(noise.shape[1]):
        rho = autocorrelation(noise[:, a], runs, lags)
        phi = linalg.solve_toeplitz(rho[:-1], rho[1:])
        shares.append(min((1.0 - phi.sum()) ** 2 / max(1.0 - phi @ rho[1:], np.finfo(float).tiny), 1.0))
    return float(np.mean(shares))
