"""Rotations on stacks of matrices (..., 3, 3) and rotation vectors (..., 3) in rad; the left Jacobian of
exp."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from exactarm.numerics.factors import svd

_ROWS, _COLUMNS = [2, 0, 1], [1, 2, 0]
_AROUND = -0.9  # cosine of angles whose axis the antisymmetric part does not show well


def exp(vector: np.ndarray) -> np.ndarray:
    """Rotation matrices of rotation vectors."""
    vector = np.asarray(vector, float)
    return Rotation.from_rotvec(vector.reshape(-1, 3)).as_matrix().reshape(*vector.shape[:-1], 3, 3)


def log(matrix: np.ndarray) -> np.ndarray:
    """Rotation vectors of rotation matrices, of angle at most pi."""
    matrix = np.asarray(matrix, float)
    return Rotation.from_matrix(matrix.reshape(-1, 3, 3)).as_rotvec().reshape(*matrix.shape[:-2], 3)


def turn(matrix: np.ndarray) -> np.ndarray:
    """The same of matrices (N, 3, 3) that are rotations but for rounding: nothing is looked at, so it takes a
    fifth of the time."""
    found = 0.5 * (matrix[:, _ROWS, _COLUMNS] - matrix[:, _COLUMNS, _ROWS])
    sine, cosine = np.linalg.norm(found, axis=1), 0.5 * (np.trace(matrix, axis1=1, axis2=2) - 1.0)
    found *= (np.arctan2(sine, cosine) / np.maximum(sine, np.finfo(float).tiny))[:, None]
    around = np.flatnonzero(cosine < _AROUND)
    found[around] = log(matrix[around])
    return found


def skew(vector: np.ndarray) -> np.ndarray:
    """Cross-product matrices: skew(v) @ w = v x w."""
    x, y, z = np.moveaxis(np.asarray(vector, float), -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*np.shape(x), 3, 3)


def left_jacobian(vector: np.ndarray) -> np.ndarray:
    """J with exp(w + dw) = exp(J dw) exp(w) to first order, (3, 3), for one rotation vector."""
    angle = float(np.linalg.norm(vector))
    cross = skew(vector)
    if angle < 1e-5:
        return np.eye(3) + 0.5 * cross + cross @ cross / 6.0
    return (
        np.eye(3)
        + (1.0 - np.cos(angle)) / angle**2 * cross
        + (angle - np.sin(angle)) / angle**3 * cross @ cross
    )


def nearest(matrix: np.ndarray) -> np.ndarray:
    """The rotations nearest to matrices in the Frobenius norm."""
    u, _, vt = svd(matrix)
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return u @ vt
