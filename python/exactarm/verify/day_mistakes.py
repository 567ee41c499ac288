"""Mistakes of a day of the check beside an earlier one: its points are in another unit, mirrored, or in
another order than the angles.

Whatever moves base or tool, the points p_k of the poses keep their distances. Where those measured (K, 3) do
not, by more than robot and data may miss each other at all, three mistakes are undone and judged by what the
best rigid motion leaves (RMS), which must then be as little as robot and data may miss each other:

    p / s, s = ratio of the spreads         another unit, where s is the ratio of two
    p with one coordinate of the other sign  one sign, or two exchanged columns: the same up to a turn
    p in the order that lies nearest to the expected points     rows of another pose, as one row late

A zero that was lost bends the figure too, but none of the three takes that back. Four points at least: three
lie in a plane, and their mirror image is a turn of them.
"""

from __future__ import annotations

import numpy as np
import scipy  # scipy.optimize is imported at its first use

from exactarm.first_aid.suspicion import FALL
from exactarm.identify.frames import procrustes

LEAST_POINTS = 4
_UNITS_M = (1.0, 1e-2, 1e-3, 0.0254, 0.3048)
FACTORS = tuple(one / other for one in _UNITS_M for other in _UNITS_M if one != other)
SAME_FACTOR = 0.02  # of its logarithm: what a robot misses its points by, over their spread
MIRROR = np.array([-1.0, 1.0, 1.0])


def day_mistake(label: str, expected: np.ndarray, measured: np.ndarray, most: float) -> str:
    """One sentence, or empty; expected, measured (K, 3) in m, `most`: RMS (m) from which it is looked for."""
    if len(measured) < LEAST_POINTS:
        return ""
    left = _left(expected, measured)
    if left <= most:
        return ""
    scale = _spread(measured) / max(_spread(expected), 1e-300)
    undone = {"with one sign turned or two columns exchanged (a mirror image)": measured * MIRROR}
    if any(abs(np.log(scale / factor)) < SAME_FACTOR for factor in FACTORS):
        undone[f"in another unit ({scale:.6g} times as large)"] = measured / scale
    order = scipy.optimize.linear_sum_assignment(np.linalg.norm(expected[:, None] - measured, axis=2))[1]
    undone[_in_order(order)] = measured[order]
    left_by = {words: _left(expected, points) for words, points in undone.items()}
    words, least = min(left_by.items(), key=lambda item: item[1])
    explained = least <= most and least * FALL < left
    return f"{label}: are x, y, z {words}? They would lie where they are expected" if explained else ""


def _in_order(order: np.ndarray) -> str:
    """order (K,): the row that belongs to each pose."""
    late = np.unique((order - np.arange(len(order))) % len(order))
    if len(late) > 1:
        return "in another order than the angles"
    back = len(order) - int(late[0])
    count, way = min((int(late[0]), "late"), (back, "early"))
    return f"{count} row{'s' * (count > 1)} too {way}, beside the angles"


def _left(expected: np.ndarray, measured: np.ndarray) -> float:
    residual = procrustes(expected, measured)[1]
    return float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))


def _spread(points: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))
