"""What a least-squares fit may claim where rows share noise: visits of one pose, neighbours in time.

    cov = H^-1 (J' R J + P) H^-1,    H = J' J + P,    R = (I + C V C' + ratio K) / (1 + mean C C' + ratio)

J (N m, k) columns in units of a row's noise, V: 1 for two visits of one pose, C what they share (the root
of `shared`, and what the rounding of their angles does), K the wandering's correlation (wandering.py), of
every component by itself, P the information of Gaussian priors. The estimate is that of independent rows,
which stays unbiased; only what it may claim changes (White 1980, with R from the noise model). A constant, as
a frame's shift, is worth far fewer rows than there are; what changes sign from pose to pose loses next to
nothing.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from exactarm.noise.model import NoiseModel
from exactarm.noise.wandering import kernel


def shared_covariance(columns: np.ndarray, prior_rows: np.ndarray, noise: NoiseModel, visits: np.ndarray,
                      order: np.ndarray | None, rounding: np.ndarray | None) -> np.ndarray:
    """(k, k) covariance of the estimate from columns (N, m, k), for rows of unit variance.

    prior_rows (r, k) pseudo-observations; visits (N,) numbers of the poses, order (N,) places in the unit of
    the noise model's memory, and rounding (N, m, n) of these very rows.
    """
    rows, m, width = columns.shape
    ratio = 0.0 if noise.wandering is None or order is None else noise.wandering.ratio
    common = np.broadcast_to(np.sqrt(noise.shared) * np.eye(m), (rows, m, m))
    if noise.rounding is not None and rounding is not None:
        common = np.concatenate([common, rounding / noise.sigma[:, None]], axis=2)
    number = np.unique(visits, return_inverse=True)[1]
    sums = np.zeros((int(number.max()) + 1, common.shape[2], width))
    np.add.at(sums, number, np.swapaxes(common, 1, 2) @ columns)
    seen = columns + common @ sums[number]
    if ratio > 0.0:
        wandering = kernel(order, noise.wandering.memory) @ columns.reshape(rows, -1)
        seen += ratio * wandering.reshape(columns.shape)
    flat, seen = columns.reshape(-1, width), seen.reshape(-1, width)
    prior = prior_rows.T @ prior_rows
    information = flat.T @ flat + prior
    usual = 1.0 + float(np.sum(common**2)) / (rows * m) + ratio
    middle = flat.T @ seen / usual + prior
    scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    inverse = linalg.pinvh(information / np.outer(scale, scale)) / np.outer(scale, scale)
    return inverse @ middle @ inverse
