"""Variances of numbers that are linear in what has a covariance."""

from __future__ import annotations

import math

import numpy as np


def variances(rows: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """(...) r C r' of rows (..., P) and a covariance (P, P), in one product of matrices; 0 where P is 0."""
    *shape, size = rows.shape
    flat = rows.reshape(math.prod(shape), size)
    return np.sum((flat @ covariance) * flat, axis=1).reshape(shape)
