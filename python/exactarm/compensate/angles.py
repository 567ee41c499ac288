"""Orientations as the makers write them, each near the old numbers where several mean the same.

zyx         R = Rz(a) Ry(b) Rx(c), rad: A B C of KUKA, R P W of Fanuc, Rz Ry Rx of Yaskawa
quaternion  (w, x, y, z), of either sign: ABB
vector      axis times angle, rad: Universal Robots
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

GIMBAL = 1e-9  # cosine of b below which only a - c or a + c has a meaning


def from_zyx(a: float, b: float, c: float) -> np.ndarray:
    (ca, sa), (cb, sb), (cc, sc) = ((np.cos(angle), np.sin(angle)) for angle in (a, b, c))
    return np.array(
        [
            [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
            [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
            [-sb, cb * sc, cb * cc],
        ]
    )


def to_zyx(rotation: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(3,) a, b, c close to `near`, each within a turn of it."""
    cosine = np.hypot(rotation[0, 0], rotation[1, 0])
    b = np.arctan2(-rotation[2, 0], cosine)
    if cosine < GIMBAL:  # c as it was; a takes all of the turn
        c = near[2]
        turned = rotation @ from_zyx(0.0, b, c).T
        found = [np.array([np.arctan2(turned[1, 0], turned[0, 0]), b, c])]
    else:
        a, c = np.arctan2(rotation[1, 0], rotation[0, 0]), np.arctan2(rotation[2, 1], rotation[2, 2])
        found = [np.array([a, b, c]), np.array([a + np.pi, np.pi - b, c + np.pi])]
    near = np.asarray(near)
    turned = [angles + 2.0 * np.pi * np.round((near - angles) / (2.0 * np.pi)) for angles in found]
    return min(turned, key=lambda angles: np.abs(angles - near).max())


def from_quaternion(wxyz: np.ndarray) -> np.ndarray:
    return Rotation.from_quat(np.asarray(wxyz)[[1, 2, 3, 0]]).as_matrix()


def to_quaternion(rotation: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(4,) of the sign of `near`."""
    quaternion = Rotation.from_matrix(rotation).as_quat()[[3, 0, 1, 2]]
    return quaternion if quaternion @ near >= 0.0 else -quaternion


def from_vector(vector: np.ndarray) -> np.ndarray:
    return Rotation.from_rotvec(vector).as_matrix()


def to_vector(rotation: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(3,) among all that differ by whole turns, the one closest to `near`."""
    vector = Rotation.from_matrix(rotation).as_rotvec()
    angle = np.linalg.norm(vector)
    axis = vector / angle if angle > 1e-12 else np.asarray(near) / max(np.linalg.norm(near), 1e-12)
    turns = np.round((axis @ near - angle) / (2.0 * np.pi))
    return axis * (angle + 2.0 * np.pi * turns)
