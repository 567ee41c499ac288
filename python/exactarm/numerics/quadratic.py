"""Variances of numbers that are linear in what has a covariance."""

from __future__ import annotations

import numpy as np


def variances(rows: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """(...) r C r' of rows (..., P) and a covariance (P, P), in one product of matrices."""
    flat = rows.reshape(-1, rows.shape[-1])
    return np.sum((flat @ covariance) * flat, axis=1).reshape(rows.shape[:-1])
