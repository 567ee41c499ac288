"""How many independent numbers the noise of a short record leaves, by what a fit has left free.

    cov(e_i, e_k) = s^2 ((1 - w) (i = k) + w rho^|i - k|),      rho = exp(-step / memory)

w and memory over a grid by the restricted likelihood (Patterson and Thompson 1971), in which columns that
have followed the slow part of the noise take nothing of it away. The sum is an ARMA(1, 1) process, so that
one recursive filter makes it white:

    (1 - rho B) e = (1 - theta B) u,    theta / (1 + theta^2) = rho (1 - w) / (w (1 - rho^2) + (1 - w)
                                                                 (1 + rho^2)),    var u = rho (1 - w) / theta
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy  # scipy.signal is imported at its first use
from scipy import linalg

_SHARED = (0.1, 0.25, 0.5, 0.75, 0.9, 0.99)  # w
_SHORTEST, _MEMORIES = 3.0, 7  # steps; from there to the longest, in equal ratios
_LEAST_NATS = 5.0  # over white noise: the price of two parameters and of the search
_MOST_NUMBERS = 3_000_000  # of the columns: of more every other sample tells as much of what is slow


def restricted_share(residual: np.ndarray, basis: np.ndarray, runs: Sequence[np.ndarray], step: float,
                     longest: float) -> float:
    """Independent numbers per number of residuals (N, m), free of the columns `basis` (N m, b); runs: rows in
    the order of time, `step` apart; longest: memory that is asked for, s. 1 where nothing says that they
    share anything."""
    rows, m = residual.shape
    columns = np.concatenate([basis.reshape(rows, m, -1), residual[:, :, None]], axis=2)
    used = [run[np.any(residual[run] != 0.0, axis=1)] for run in runs]
    every = max(1, -(-columns.size // _MOST_NUMBERS))
    parts = [columns[run[::every]] for run in used if run[::every].size > 2]
    if not parts or longest <= _SHORTEST * step:
        return 1.0
    best, share = _log_likelihood(parts, 0.0, 0.0) + _LEAST_NATS, 1.0
    for memory in np.geomspace(_SHORTEST * step, longest, _MEMORIES):
        rho = float(np.exp(-step * every / memory))
        one = np.exp(-step / memory)
        for w in _SHARED:
            likely = _log_likelihood(parts, w, rho)
            if likely > best:
                best, share = likely, 1.0 / (1.0 - w + w * (1.0 + one) / (1.0 - one))
    return float(share)


def _log_likelihood(parts: Sequence[np.ndarray], w: float, rho: float) -> float:
    """Of (n, m, b + 1) columns of every run, the last the residual, up to a constant."""
    white, logs = [], 0.0
    theta, variance = _moving_average(w, rho)
    for part in parts:
        flat = part.reshape(len(part), -1)
        flat = scipy.signal.lfilter([1.0, -rho], [1.0, -theta], flat, axis=0) / np.sqrt(variance)
        flat[0] *= np.sqrt(variance)  # the first has nothing before it
        logs += part.shape[1] * (len(part) - 1) * np.log(variance)
        white.append(flat.reshape(-1, part.shape[2]))
    stacked = np.concatenate(white)
    fitted, left = stacked[:, :-1], stacked[:, -1]
    normal, onto = fitted.T @ fitted, fitted.T @ left
    lower = linalg.cholesky(normal + 1e-12 * np.trace(normal) * np.eye(len(normal)), lower=True)
    told = linalg.solve_triangular(lower, onto, lower=True)
    freedom = len(left) - fitted.shape[1]
    return -0.5 * float(logs + 2.0 * np.sum(np.log(np.diag(lower)))
                        + freedom * np.log(max(left @ left - told @ told, 1e-300)))


def _moving_average(w: float, rho: float) -> tuple[float, float]:
    """theta and the variance of u, s = 1."""
    along, whole = rho * (1.0 - w), w * (1.0 - rho**2) + (1.0 - w) * (1.0 + rho**2)
    if along == 0.0:
        return 0.0, whole
    ratio = along / whole
    theta = (1.0 - np.sqrt(max(1.0 - 4.0 * ratio**2, 0.0))) / (2.0 * ratio)
    return float(theta), float(along / theta)
