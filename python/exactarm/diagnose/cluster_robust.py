"""Evidence by a cluster-robust covariance (White 1980; Liang and Zeger 1986): rows need not share one
noise level.

What other causes have left makes some rows and some directions noisier than the mean. C~: columns of a
candidate without what the free parameters absorb; b: its coefficients; e: the residual that they leave;
s_g = C~_g' e_g: scores of the clusters g, groups of rows (visits of one pose) that are independent of each
other.

    V = (C~'C~)^{-1} (sum_g s_g s_g') (C~'C~)^{-1} G / (G - k),    W = b' V^{-1} b

The Wald statistic W takes the place of the likelihood ratio where it is the smaller one.
"""

from __future__ import annotations

import numpy as np

from exactarm.diagnose.decisions import ABSORBED, ENOUGH_GROUPS
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.scan import Candidate
from exactarm.numerics.factors import lstsq


def robust_evidence(fitted: Fitted, candidate: Candidate, columns: np.ndarray, groups: np.ndarray,
                    count: float) -> float:
    """The candidate's evidence, less what it owes to noisy rows. columns (R, k) whitened, groups (N,), count:
    independent numbers."""
    names, group = np.unique(groups, return_inverse=True)
    clear = fitted.cleared(columns)
    seen = np.einsum("ij,ij->j", clear, clear) > ABSORBED * np.einsum("ij,ij->j", columns, columns)
    clear = clear[:, seen] / np.linalg.norm(clear[:, seen], axis=0)
    k = clear.shape[1]
    if not k or len(names) < ENOUGH_GROUPS * k:
        return candidate.evidence
    residual = fitted.free_residual
    values = lstsq(clear, residual, rcond=1e-8)[0]
    numbers = fitted.data_numbers
    scores = (clear * (residual - clear @ values)[:, None])[:numbers].reshape(len(groups), -1, k).sum(axis=1)
    by_group = np.zeros((len(names), k))
    np.add.at(by_group, group, scores)
    spread = by_group.T @ by_group * len(names) / (len(names) - k)
    pull = clear.T @ clear @ values
    wald = float(pull @ np.linalg.pinv(spread, rcond=1e-10, hermitian=True) @ pull)
    square = float(residual @ residual)
    ratio = count * np.log(square / max(square - candidate.gain, 1e-12 * square))
    return candidate.evidence - 0.5 * max(ratio - wald, 0.0)
