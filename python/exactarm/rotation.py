"""Rotations on stacks of matrices (..., 3, 3) and rotation vectors (..., 3) in rad; the left Jacobian of
exp."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def exp(vector: np.ndarray) -> np.ndarray:
    """Rotation matrices of rotation vectors."""
    vector = np.asarray(vector, float)
    return Rotation.from_rotvec(vector.reshape(-1, 3)).as_matrix().reshape(*vector.shape[:-1], 3, 3)


def log(matrix: np.ndarray) -> np.ndarray:
    """Rotation vectors of rotation matrices, of angle at most pi."""
    matrix = np.asarray(matrix, float)
    return Rotation.from_matrix(matrix.reshape(-1, 3, 3)).as_rotvec().reshape(*matrix.shape[:-2], 3)


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
    u, _, vt = np.linalg.svd(matrix)
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return u @ vt
