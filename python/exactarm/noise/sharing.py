"""What a least-squares fit may claim where rows share noise: visits of one pose, neighbours in time.

    cov = H^-1 (J' R J + P) H^-1,    H = J' J + P,    R = (I + shared V + ratio K) / (1 + shared + ratio)

J (N m, k) columns in units of a row's noise, V: 1 for two visits of one pose, K the wandering's correlation
(wandering.py), P the information of Gaussian priors; each component by itself. The estimate is that of
independent rows, which stays unbiased; only what it may claim changes (White 1980, with R from the noise
model). A constant, as a frame's shift, is worth far fewer rows than there are; what changes sign from pose to
pose loses next to nothing.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from exactarm.noise.model import NoiseModel
from exactarm.noise.wandering import kernel


def shared_covariance(columns: np.ndarray, prior_rows: np.ndarray, noise: NoiseModel, visits: np.ndarray,
                      order: np.ndarray | None) -> np.ndarray:
    """(k, k) covariance of the estimate from columns (N, m, k), for rows of unit variance.

    prior_rows (r, k) pseudo-observations; visits (N,) numbers of the poses and order (N,) places of these
    very rows, in the unit of the noise model's memory.
    """
    rows = columns.reshape(len(columns), -1)
    ratio = 0.0 if noise.wandering is None or order is None else noise.wandering.ratio
    seen = rows.copy()
    if noise.shared > 0.0:
        number = np.unique(visits, return_inverse=True)[1]
        sums = np.zeros((int(number.max()) + 1, rows.shape[1]))
        np.add.at(sums, number, rows)
        seen += noise.shared * sums[number]
    if ratio > 0.0:
        seen += ratio * (kernel(order, noise.wandering.memory) @ rows)
    flat, seen = columns.reshape(-1, columns.shape[2]), seen.reshape(-1, columns.shape[2])
    prior = prior_rows.T @ prior_rows
    information = flat.T @ flat + prior
    middle = flat.T @ seen / (1.0 + noise.shared + ratio) + prior
    scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    inverse = linalg.pinvh(information / np.outer(scale, scale)) / np.outer(scale, scale)
    return inverse @ middle @ inverse
