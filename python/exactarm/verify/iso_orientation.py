"""Orientation of an arm in the terms of ISO 9283, where the device measures it.

Of a pose that is visited n times, a the turn about an axis of the robot's base (x, y, z: a, b, c), small:

    AP_a = mean a_j - a_c            orientation accuracy
    RP_a = 3 S_a                     orientation repeatability (S_a: standard deviation, n - 1)
    vAP_a = max |a_g - a_h|          between the mean turns of directions of approach g, h

rad. a_c is the model's orientation at the angles that the controller reports, with base and tool frame fitted
(held_out.py). Turns are components of rotation vectors: for the differences of a visited pose they are the
standard's angles to second order (1 mrad: 0.001 mrad). RP is of the measured orientations alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.numerics.rotation import log, nearest
from exactarm.verify.iso_9283 import LEAST_VISITS, direction_of_approach, members, pose_and_session

AXES = ("a", "b", "c")


@dataclass(frozen=True)
class Orientation:
    """Largest of the tested poses, about each axis of the base (3,) rad: AP before and after, RP, and vAP
    before and after where directions allow it. error: mean angle (rad) of all judged rows, before and
    after."""

    poses: int
    accuracy_before: np.ndarray | None
    accuracy_after: np.ndarray | None
    repeatability: np.ndarray | None
    directions: tuple[np.ndarray, np.ndarray] | None
    error: tuple[float, float]


def iso_orientation(
    data: Dataset, before: np.ndarray, after: np.ndarray, base: np.ndarray
) -> Orientation:
    """Of the judged rows: turns (M, 3) that are measured beyond both models, in the base's axes; base
    (M, 3, 3): the base's rotation in the device's frame."""
    assert data.rotation is not None
    groups, direction = pose_and_session(data), direction_of_approach(data)
    each = np.unique(np.stack([groups, direction], axis=1), axis=0, return_inverse=True)[1].ravel()
    tested = members(each, LEAST_VISITS)
    accuracy = [np.array([np.abs(turn[rows].mean(axis=0)) for rows in tested]) for turn in (before, after)]
    scatter = np.array([_scatter(data.rotation[rows], base[rows[0]]) for rows in tested])
    error = tuple(float(np.linalg.norm(turn, axis=1).mean()) for turn in (before, after))
    if not tested:
        return Orientation(0, None, None, None, None, error)
    varied = []
    for rows in members(groups, 2 * LEAST_VISITS):
        parts = [rows[part] for part in members(direction[rows], LEAST_VISITS)]
        if len(parts) > 1:
            varied.append([_apart(np.array([turn[part].mean(axis=0) for part in parts]))
                           for turn in (before, after)])
    directions = tuple(np.max(varied, axis=0)) if varied else None
    largest = [values.max(axis=0) for values in (*accuracy, scatter)]
    return Orientation(len(tested), *largest, directions, error)


def _scatter(rotation: np.ndarray, base: np.ndarray) -> np.ndarray:
    """(3,) three standard deviations of the turns of rotations (n, 3, 3) about the axes of the base."""
    middle = nearest(rotation.mean(axis=0))
    return 3.0 * log(base.T @ rotation @ middle.T @ base).std(axis=0, ddof=1)


def _apart(turns: np.ndarray) -> np.ndarray:
    """(3,) largest difference of turns (k, 3) about each axis."""
    return np.ptp(turns, axis=0)
