"""Orientations that follow the arm in axes of their own, or not at all.

Measured orientations R_i in the device and those F_i of the flange belong together where a base frame B and a
tool T make B F_i T of them. Positions know B. Where

    R_i = D B F_i T        or        R_i^-1 = D B F_i T

with some rotation D, the orientations count from other axes than x, y and z do (another axis upwards,
components of a quaternion in another order or of another sign: each such change is a D and a T, some with
the inverse). D is what turns the axes of R_i R_j^-1 into those of B F_i F_j^-1 B^-1 (Kabsch).
"""

from collections.abc import Iterator

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.first_aid.linear_frames import linear_frames
from exactarm.first_aid.misfit import LEAST_ORIENTATION_RAD, Misfit
from exactarm.first_aid.suspicion import FALL, Suspicion
from exactarm.numerics.factors import svd
from exactarm.numerics.rotation import log as rotation_log
from exactarm.numerics.rotation import nearest
from exactarm.robot.robot import Robot

_WELL_POSED = 0.1  # of what orientations are off by may come from a base that the positions hardly show
_TOWARDS_NONE = 1e-6  # share by which D is drawn to no turn at all: what the rotations do not show stays 0
_WAYS = (("orientations that count from axes", False),
         ("inverse orientations (of the device in the target) that count from axes", True))


def orientation_mistakes(bare: Robot, carried: Layout, data: Dataset, now: Misfit) -> Iterator[Suspicion]:
    """What is to be said of orientations that do not fit where positions do: D where there is one."""
    # positions that an arm may miss by, or that a tenth of the turns would make at a lever of 0.3 m
    least = max(LEAST_ORIENTATION_RAD, 0.1 * np.nan_to_num(now.orientation))
    if not now.orientation > LEAST_ORIENTATION_RAD or now.position >= 0.3 * least:
        return
    flange = predict_poses(bare, carried, data, tangents=False)
    sessions = [np.flatnonzero(data.session == number) for number in np.unique(data.session)]
    bases = [_base(flange.position[rows], flange.rotation[rows], data.position[rows], now)
             for rows in sessions]
    if all(base is not None for base in bases):
        for words, inverse in _WAYS:
            seen = np.swapaxes(data.rotation, -1, -2) if inverse else data.rotation
            square, turns = 0.0, []
            for rows, base in zip(sessions, bases):
                turn, off = _turned(seen[rows], base @ flange.rotation[rows])
                turns.append(turn)
                square += float(np.sum(off**2))
            fall = now.orientation / max(np.sqrt(square / len(data)), 1e-9)
            if fall >= FALL:
                yield Suspicion(f"{words} {_in_words(turns[0])} against x, y, z", fall)
    if _turns_otherwise(flange.rotation, data) > least:
        of_three = data.turns is not None or data.rotation_vector is not None
        order = "" if of_three else "a quaternion in another order, "
        yield Suspicion(
            f"the measured orientations do not follow the arm ({now.orientation:.2g} rad RMS beside "
            f"{1e3 * now.position:.2g} mm): are they angles of another convention, {order}"
            "rows shuffled, or is the device as coarse?")


def _base(points: np.ndarray, rotations: np.ndarray, measured: np.ndarray, now: Misfit) -> np.ndarray | None:
    """(3, 3) rotation of the arm's base in the device, where points do not lie nearly on a line."""
    base, *_ = linear_frames(points, rotations, measured)
    spread = svd(measured - measured.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(measured))
    return base if now.position < _WELL_POSED * now.orientation * spread else None


def _turned(seen: np.ndarray, arm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """D' with D' R_i = (B F_i) T, and rotation vectors of what it and the best T leave, (N, 3)."""
    onto = np.zeros((3, 3))
    for apart in (len(seen) // 2, len(seen) // 3):
        of_arm, of_seen = (_turn_between(rotation, apart) for rotation in (arm, seen))
        onto += of_arm.T @ of_seen
    turn = nearest(onto + _TOWARDS_NONE * max(np.linalg.norm(onto), 1e-12) * np.eye(3))
    tools = np.swapaxes(arm, -1, -2) @ turn @ seen
    return turn, rotation_log(nearest(tools.mean(axis=0)).T @ tools)


def _turn_between(rotation: np.ndarray, apart: int) -> np.ndarray:
    """(N, 3) axes of the rotations between rows, times the sine of their angles."""
    between = rotation @ np.swapaxes(np.roll(rotation, apart, axis=0), -1, -2)
    return 0.5 * (between[:, [2, 0, 1], [1, 2, 0]] - between[:, [1, 2, 0], [2, 0, 1]])


def _in_words(turn: np.ndarray) -> str:
    vector = rotation_log(turn)
    angle = float(np.linalg.norm(vector))
    axis = ", ".join(f"{each:.2g}" for each in (vector / max(angle, 1e-12)).round(2) + 0.0)
    return f"turned by {np.degrees(angle):.0f} degrees about ({axis})"


def _turns_otherwise(flange: np.ndarray, data: Dataset) -> float:
    """RMS, rad, of the angle between two rows as measured, less that of the arm: no frame changes either."""
    one, other = np.arange(len(data)), np.roll(np.arange(len(data)), len(data) // 2)
    same = data.session[one] == data.session[other]
    turned = lambda rotation: np.linalg.norm(rotation_log(
        np.swapaxes(rotation[one[same]], -1, -2) @ rotation[other[same]]), axis=1)
    off = turned(data.rotation) - turned(flange)
    return float(np.sqrt(np.mean(off**2))) if off.size else np.inf
