"""What a least-squares fit of filtered samples may claim: neighbouring residuals are not independent.

With residuals e_a(t) of axis a, weights 1 / sigma_a^2 and autocorrelation rho_a of the residuals,

    cov = H^{-1} S H^{-1},   H = sum_a J_a' J_a / sigma_a^2,   S = sum_a J_a' R_a J_a / sigma_a^2,

R_a the Toeplitz matrix of rho_a under Bartlett's taper (Newey and West 1987, with the noise stationary). The
effective number of samples of axis a is N / (1 + 2 sum rho_a), at most what the filter leaves of white noise:
a fit takes the slow part out of the residuals that it is judged by.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft, linalg

_LAG_S = 0.5  # longer than an arm's swing and a filter's memory


@dataclass(frozen=True)
class Uncertainty:
    """covariance (P, P); effective (m,) independent samples per axis; freedom: all of them less the
    parameters."""

    covariance: np.ndarray
    effective: np.ndarray
    freedom: float


def uncertainty(
    jacobian: np.ndarray,
    residual: np.ndarray,
    sigma: np.ndarray,
    runs: Sequence[np.ndarray],
    step: float,
    filtered_noise: Callable[[int], np.ndarray] = lambda lags: np.eye(1, lags + 1)[0],
    prior: np.ndarray | None = None,
) -> Uncertainty:
    """jacobian (N, m, P), residual (N, m), sigma (m,); `runs`: row indices in the order of time, `step` in s.

    `filtered_noise(lags)`: autocorrelation (lags + 1,) of white noise behind the filter that the rows have
    passed; prior (P,): standard deviations of Gaussian priors, inf = none.
    """
    rows, axes, size = jacobian.shape
    lags = lags_within(runs, _LAG_S, step)
    least = filtered_noise(lags)
    known = np.zeros((size, size)) if prior is None else np.diag(prior**-2.0)
    normal, score = known.copy(), known.copy()
    effective = np.empty(axes)
    for a in range(axes):
        columns = jacobian[:, a] / sigma[a]
        tapered = autocorrelation(residual[:, a], runs, lags) * (1.0 - np.arange(lags + 1) / (lags + 1))
        if tapered[1:].sum() < least[1:].sum():
            tapered = least
        effective[a] = rows / max(1.0 + 2.0 * tapered[1:].sum(), 1.0)
        normal += columns.T @ columns
        kernel = np.concatenate([tapered[:0:-1], tapered])[:, None]
        for run in runs if size else ():
            score += columns[run].T @ _convolved(columns[run], kernel)
    scale = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    inverse = linalg.pinvh(normal / np.outer(scale, scale)) / np.outer(scale, scale)
    # The largest of what the white and the correlated count say: correlation may not pretend to add data.
    covariance = inverse @ score @ inverse
    freedom = float(effective.sum() - size)
    share = effective.sum() / max(freedom, 1.0)
    white = np.diag(inverse)
    widen = np.sqrt(np.maximum(white / np.maximum(np.diag(covariance), np.finfo(float).tiny), 1.0))
    return Uncertainty(share * covariance * np.outer(widen, widen), effective, freedom)


def memory_in(columns: np.ndarray, noise: np.ndarray, runs: Sequence[np.ndarray], lags: int) -> float:
    """How many times more of noise like (N,) falls on orthonormal columns (N, k) than of white noise of its
    size: tr(C' R C) / k, R its autocorrelation up to so many lags (Bartlett's taper). Columns that gather
    rows of many passes catch less of a slow noise than those that gather neighbours."""
    tapered = autocorrelation(noise, runs, lags) * (1.0 - np.arange(lags + 1) / (lags + 1))
    kernel = np.concatenate([tapered[:0:-1], tapered])[:, None]
    total = sum(float(np.sum(columns[run] * _convolved(columns[run], kernel))) for run in runs)
    return total / columns.shape[1]


def _convolved(columns: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """(N, P) columns with a symmetric kernel (2 L + 1, 1); scipy.signal takes half a second to import."""
    length = fft.next_fast_len(len(columns) + len(kernel) - 1, real=True)
    product = fft.rfft(columns, length, axis=0) * fft.rfft(kernel, length, axis=0)
    return fft.irfft(product, length, axis=0)[len(kernel) // 2 :][: len(columns)]


def lags_within(runs: Sequence[np.ndarray], span: float, step: float) -> int:
    """Lags of samples `step` apart that reach over `span`, at most a quarter of the run that the middle row
    lies in: a piece of few samples beside a gap says nothing of how long noise remembers."""
    sizes = np.sort([len(run) for run in runs])
    middle = int(sizes[np.searchsorted(np.cumsum(sizes), 0.5 * sizes.sum())])
    return int(np.clip(np.ceil(span / step), 1, max(middle // 4, 1)))


def autocorrelation(values: np.ndarray, runs, lags: int) -> np.ndarray:
    """(lags + 1,) of a zero-mean signal (N,), products taken within runs only."""
    total = np.zeros(lags + 1)
    for run in runs:
        length = fft.next_fast_len(len(run) + lags, real=True)
        total += fft.irfft(np.abs(fft.rfft(values[run], length)) ** 2, length)[: lags + 1]
    return total / total[0] if total[0] > 0.0 else np.eye(1, lags + 1)[0]
