"""Orientations as the makers write them, each near the old numbers where several mean the same.

zyx         R = Rz(a) Ry(b) Rx(c), rad: A B C of KUKA, R P W of Fanuc, Rz Ry Rx of Yaskawa
quaternion  (w, x, y, z), of either sign: ABB
vector      axis times angle, rad: Universal Robots
"""

from __future__ import annotations

import math

import numpy as np

GIMBAL = 1e-9  # cosine of b below which only a - c or a + c has a meaning
SMALL_RAD = 1e-3  # below it sin(a / 2) / a by its series, 1 / 2 - a^2 / 48, is exact to 1e-15
TURN = 2.0 * math.pi


def from_zyx(a: float, b: float, c: float) -> np.ndarray:
    ca, sa, cb, sb, cc, sc = math.cos(a), math.sin(a), math.cos(b), math.sin(b), math.cos(c), math.sin(c)
    return np.array(
        [
            [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
            [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
            [-sb, cb * sc, cb * cc],
        ]
    )


def to_zyx(rotation: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(3,) a, b, c close to `near`, each within a turn of it."""
    (xx, _, _), (yx, _, _), (zx, zy, zz) = rotation.tolist()
    cosine = math.hypot(xx, yx)
    b = math.atan2(-zx, cosine)
    if cosine < GIMBAL:  # c as it was; a takes all of the turn
        turned = rotation @ from_zyx(0.0, b, near[2]).T
        found = [(math.atan2(turned[1, 0], turned[0, 0]), b, near[2])]
    else:
        a, c = math.atan2(yx, xx), math.atan2(zy, zz)
        found = [(a, b, c), (a + math.pi, math.pi - b, c + math.pi)]
    old = [float(angle) for angle in near]
    turned = [[angle + TURN * round((to - angle) / TURN) for angle, to in zip(angles,
                                                                              old)] for angles in found]
    return np.array(min(turned, key=lambda angles: max(abs(x - to) for x, to in zip(angles, old))))


def from_quaternion(wxyz: np.ndarray) -> np.ndarray:
    w, x, y, z = (float(value) for value in wxyz)
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if norm == 0.0:
        raise ValueError("a quaternion of zeros")
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def to_quaternion(rotation: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(4,) of the sign of `near`."""
    quaternion = _quaternion(rotation)
    return quaternion if quaternion @ near >= 0.0 else -quaternion


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    """(4,) w first, from the largest of its numbers (Shepperd 1978), so that nothing is lost at half a
    turn."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    trace = xx + yy + zz
    largest = max(trace, xx, yy, zz)
    if largest == trace:
        found = (1.0 + trace, zy - yz, xz - zx, yx - xy)
    elif largest == xx:
        found = (zy - yz, 1.0 + xx - yy - zz, xy + yx, xz + zx)
    elif largest == yy:
        found = (xz - zx, xy + yx, 1.0 - xx + yy - zz, yz + zy)
    else:
        found = (yx - xy, xz + zx, yz + zy, 1.0 - xx - yy + zz)
    norm = math.sqrt(sum(value * value for value in found))
    return np.array([value / norm for value in found])


def from_vector(vector: np.ndarray) -> np.ndarray:
    x, y, z = (float(value) for value in vector)
    angle = math.sqrt(x * x + y * y + z * z)
    half = math.sin(0.5 * angle) / angle if angle > SMALL_RAD else 0.5 - angle * angle / 48.0
    return from_quaternion((math.cos(0.5 * angle), half * x, half * y, half * z))


def to_vector(rotation: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(3,) among all that differ by whole turns, the one closest to `near`."""
    w, *axis = _quaternion(rotation).tolist()
    if w < 0.0:
        w, axis = -w, [-value for value in axis]
    sine = math.sqrt(sum(value * value for value in axis))
    angle = 2.0 * math.atan2(sine, w)
    if angle > 1e-12:
        axis = [value / sine for value in axis]
    else:
        axis = (np.asarray(near) / max(np.linalg.norm(near), 1e-12)).tolist()
    turns = round((sum(value * float(to) for value, to in zip(axis, near)) - angle) / TURN)
    return np.array([value * (angle + TURN * turns) for value in axis])
