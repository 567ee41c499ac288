"""Gear output angles of static poses: over the range of the axes, or with the flange in a small cube."""

from __future__ import annotations

import numpy as np

from blind.arm import Arm, posture

CUBE_M = (0.15, 0.4)  # edge, for an arm of a reach of one metre
CUBE_TURN_RAD, CUBE_WRIST_RAD = (
    0.35,
    (0.3, 1.2),
)  # how far the first axes and those of the wrist leave the middle
WRIST = 3  # axes


def over_the_range(arm: Arm, count: int, random) -> np.ndarray:
    """(count, n) gear output angles; half of the time over the whole range, else in a part of it."""
    middle, half = 0.5 * (arm.lower + arm.upper), 0.5 * np.minimum(arm.upper - arm.lower, 2.0 * np.pi)
    share = random.choice((0.95, 0.95, 0.6))
    found = np.zeros((0, arm.axes))
    lowest = random.choice((-np.inf, -0.2, 0.1))
    for _ in range(200):
        q = middle + share * half * random.uniform(-1.0, 1.0, (4 * count, arm.axes))
        found = np.concatenate([found, q[posture(arm, q).flange[:, 2] > lowest]])
        if len(found) >= count:
            break
    return found[:count] - arm.offset


def in_a_cube(arm: Arm, count: int, random) -> np.ndarray:
    """(count, n) angles whose flange stays in a small cube about a drawn posture, the wrist within a cone."""
    middle, half = 0.5 * (arm.lower + arm.upper), 0.5 * np.minimum(arm.upper - arm.lower, 2.0 * np.pi)
    q0 = middle + 0.5 * half * random.uniform(-1.0, 1.0, arm.axes)
    reach = np.abs(arm.a).sum() + np.abs(arm.d).sum()
    edge, wrist = random.uniform(*CUBE_M) * min(reach, 2.0), random.uniform(*CUBE_WRIST_RAD)
    spread = np.where(np.arange(arm.axes) < arm.axes - WRIST, CUBE_TURN_RAD, wrist)
    centre, found = posture(arm, q0[None]).flange[0], np.zeros((0, arm.axes))
    while len(found) < count:
        q = np.clip(q0 + spread * random.uniform(-1.0, 1.0, (4 * count, arm.axes)), arm.lower, arm.upper)
        found = np.concatenate([found, q[np.abs(posture(arm, q).flange - centre).max(axis=1) < 0.5 * edge]])
        spread, edge = 0.97 * spread, 1.01 * edge  # so that it ends, whatever the arm
    return found[:count] - arm.offset
