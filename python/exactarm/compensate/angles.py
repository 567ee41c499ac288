"""Orientations as the makers write them, each near the old numbers where several mean the same.

zyx         R = Rz(a) Ry(b) Rx(c), rad: A B C of KUKA, R P W of Fanuc, Rz Ry Rx of Yaskawa
quaternion  (w, x, y, z), of either sign: ABB
vector      axis times angle, rad: Universal Robots

Numbers (..., 3) or (..., 4), rotations (..., 3, 3): one, or all of a program at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

GIMBAL = 1e-9  # cosine of b below which only a - c or a + c has a meaning
SMALL_RAD = 1e-3  # below it sin(a / 2) / a by its series, 1 / 2 - a^2 / 48, is exact to 1e-15
TURN = 2.0 * math.pi


def _of(function: Callable[..., float], *values: np.ndarray) -> np.ndarray:
    """By the C library, whose last digit hangs on no vector unit: the same file on every machine."""
    flat = (np.ravel(value).tolist() for value in values)
    return np.array(list(map(function, *flat)), float).reshape(np.shape(values[0]))


def _rotation(*rows: tuple[np.ndarray, ...]) -> np.ndarray:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_zyx(angles: np.ndarray) -> np.ndarray:
    """a, b, c."""
    angles = np.asarray(angles, float)
    ca, cb, cc = np.moveaxis(_of(math.cos, angles), -1, 0)
    sa, sb, sc = np.moveaxis(_of(math.sin, angles), -1, 0)
    return _rotation(
        (ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc),
        (sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc),
        (-sb, cb * sc, cb * cc),
    )


def to_zyx(rotation: np.ndarray, near: np.ndarray) -> np.ndarray:
    """a, b, c close to `near`, each within a turn of it."""
    rotation, near = np.asarray(rotation, float), np.asarray(near, float)
    cosine = _of(math.hypot, rotation[..., 0, 0], rotation[..., 1, 0])
    a = _of(math.atan2, rotation[..., 1, 0], rotation[..., 0, 0])
    b = _of(math.atan2, -rotation[..., 2, 0], cosine)
    c = _of(math.atan2, rotation[..., 2, 1], rotation[..., 2, 2])
    if (lost := cosine < GIMBAL).any():  # c as it was; a takes all of the turn
        c = np.where(lost, near[..., 2], c)
        turned = rotation @ np.swapaxes(from_zyx(np.stack([np.zeros_like(b), b, c], axis=-1)), -1, -2)
        a = np.where(lost, _of(math.atan2, turned[..., 1, 0], turned[..., 0, 0]), a)
    first = _turned(np.stack([a, b, c], axis=-1), near)
    other = _turned(np.stack([a + math.pi, math.pi - b, c + math.pi], axis=-1), near)
    off = [np.abs(angles - near).max(axis=-1) for angles in (first, other)]
    return np.where(((off[1] < off[0]) & ~lost)[..., None], other, first)


def _turned(angles: np.ndarray, near: np.ndarray) -> np.ndarray:
    turned: np.ndarray = angles + TURN * np.round((near - angles) / TURN)
    return turned


def from_quaternion(wxyz: np.ndarray) -> np.ndarray:
    w, x, y, z = np.moveaxis(np.asarray(wxyz, float), -1, 0)
    norm = np.sqrt(w * w + x * x + y * y + z * z)
    if not np.all(norm):
        raise ValueError("a quaternion of zeros")
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    return _rotation(
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


def to_quaternion(rotation: np.ndarray, near: np.ndarray) -> np.ndarray:
    """w, x, y, z of the sign of `near`."""
    quaternion = _quaternion(np.asarray(rotation, float))
    return np.where((quaternion * near).sum(axis=-1, keepdims=True) >= 0.0, quaternion, -quaternion)


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    """w first, from the largest of its numbers (Shepperd 1978), so that nothing is lost at half a turn."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.moveaxis(rotation, (-2, -1), (0, 1))
    trace = xx + yy + zz
    each = np.stack([
        np.stack([1.0 + trace, zy - yz, xz - zx, yx - xy]),
        np.stack([zy - yz, 1.0 + xx - yy - zz, xy + yx, xz + zx]),
        np.stack([xz - zx, xy + yx, 1.0 - xx + yy - zz, yz + zy]),
        np.stack([yx - xy, xz + zx, yz + zy, 1.0 - xx - yy + zz]),
    ])
    largest = np.argmax(np.stack([trace, xx, yy, zz]), axis=0)
    w, x, y, z = np.take_along_axis(each, largest[None, None], axis=0)[0]
    norm = np.sqrt(w * w + x * x + y * y + z * z)
    return np.stack([w / norm, x / norm, y / norm, z / norm], axis=-1)


def from_vector(vector: np.ndarray) -> np.ndarray:
    x, y, z = np.moveaxis(np.asarray(vector, float), -1, 0)
    angle = np.sqrt(x * x + y * y + z * z)
    by_sine = _of(math.sin, 0.5 * angle) / np.where(angle > SMALL_RAD, angle, 1.0)
    half = np.where(angle > SMALL_RAD, by_sine, 0.5 - angle * angle / 48.0)
    return from_quaternion(np.stack([_of(math.cos, 0.5 * angle), half * x, half * y, half * z], axis=-1))


def to_vector(rotation: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Among all vectors that differ by whole turns, the one closest to `near`."""
    near = np.asarray(near, float)
    quaternion = _quaternion(np.asarray(rotation, float))
    w, axis = np.abs(quaternion[..., 0]), np.where(quaternion[..., :1] < 0.0, -1.0, 1.0) * quaternion[..., 1:]
    x, y, z = np.moveaxis(axis, -1, 0)
    sine = np.sqrt(x * x + y * y + z * z)
    angle = 2.0 * _of(math.atan2, sine, w)
    turns = (angle > 1e-12)[..., None]
    far = np.maximum(np.linalg.norm(near, axis=-1, keepdims=True), 1e-12)
    axis = np.where(turns, axis / np.where(turns, sine[..., None], 1.0), near / far)
    along = axis[..., 0] * near[..., 0] + axis[..., 1] * near[..., 1] + axis[..., 2] * near[..., 2]
    whole = np.round((along - angle) / TURN)
    return axis * (angle + TURN * whole)[..., None]
