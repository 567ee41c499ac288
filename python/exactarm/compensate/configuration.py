"""Words of a program that name a branch of the arm, by the angles that the controller reports.

quadrants    cf1, cf4, cf6 of ABB: which quarter of a turn the axes 1, 4 and 6 stand in, from 0 up and -1 down
sign bits    T of KUKA: bit i is set where axis i + 1 is below zero
"""

from __future__ import annotations

import math

import numpy as np

EDGE_RAD = 1e-4  # an axis that close to the edge of a quadrant may be counted to either
ZERO_RAD = 2e-5  # an angle that small may carry either sign
_QUARTER = 0.5 * math.pi


def quadrants(q: np.ndarray) -> np.ndarray:
    """cf1, cf4, cf6 (..., 3) of joint angles (..., 6)."""
    return np.floor(q[..., [0, 3, 5]] / _QUARTER).astype(int)


def in_quadrant(angle, word):
    """Whether axes stand where cf1, cf4 or cf6 say: of one, or of arrays."""
    return abs(angle - (word + 0.5) * _QUARTER) <= 0.5 * _QUARTER + EDGE_RAD


def sign_bits(q: np.ndarray) -> int:
    return sum(1 << i for i, angle in enumerate(q) if angle < 0.0)


def signs_fit(turn: int, q: np.ndarray) -> bool:
    return all(abs(angle) < ZERO_RAD or bool(turn >> i & 1) == (angle < 0.0) for i, angle in enumerate(q))
