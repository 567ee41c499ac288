"""Paths of arms with fewer than six axes, which cannot turn the flange freely.

The axes of an identified SCARA lean by a milliradian: no joint angles reach the orientation of the drawing,
and a path that asks for it has none. What can be reached is asked for instead: every place, and there the
nearest orientation, by weighted least squares (a metre counts a thousand times a radian), each pose from the
one before.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exactarm import _core
from exactarm.numerics.factors import lstsq
from exactarm.numerics.rotation import log as rotation_log
from exactarm.plan.reference import Reference

FARTHEST_RAD = 0.02  # of what an arm's axes lean, in all; more, and the path asks for what the arm cannot do
_PLACE_FIRST = 1e3
_PASSES = 40
_TOLERANCE = 1e-11
_STARTS = 24  # an axis: angles, evenly over its range


def attainable(core: _core.Robot, reference: Reference,
               start: np.ndarray | None = None) -> tuple[Reference, np.ndarray, float] | None:
    """The reference with the nearest poses that the arm can reach, the joint angles (n,) where it begins, and
    the largest angle, rad, between an orientation asked for and its own; None where the places are out of
    reach or the orientations farther away than an arm's axes lean."""
    limits = [joint.limits for joint in core.joints]
    low, high = np.array([(one.q_min, one.q_max) for one in limits]).T
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    starts = [np.asarray(start, float)] if start is not None else list(_starts(low, high))
    first = [_nearest(core, q, reference.position[0], reference.rotation[0]) for q in starts]
    reached = [q for q in first if q is not None and np.all(q >= low) and np.all(q <= high)]
    if not reached:
        return None
    q = min(reached, key=lambda q: float(np.sum(((q - 0.5 * (low + high)) / (high - low)) ** 2)))
    path = []
    for position, rotation in zip(reference.position, reference.rotation):
        q = _nearest(core, q, position, rotation)
        if q is None:
            return None
        path.append(q)
    position, rotation = _core.forward_kinematics(core, np.array(path))
    off = np.linalg.norm(rotation_log(reference.rotation @ np.swapaxes(rotation, -1, -2)), axis=1)
    return replace(reference, position=position, rotation=rotation), path[0], float(off.max())


def _starts(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(K, n) points of a lattice in the joints' ranges (Kronecker's, by roots of primes)."""
    steps = np.sqrt(np.array([2.0, 3.0, 5.0, 7.0, 11.0][: low.size])) % 1.0
    return low + (high - low) * ((0.5 + np.outer(np.arange(_STARTS * low.size), steps)) % 1.0)


def _nearest(core: _core.Robot, q: np.ndarray, position: np.ndarray,
             rotation: np.ndarray) -> np.ndarray | None:
    weight = np.repeat([_PLACE_FIRST, 1.0], 3)
    for _ in range(_PASSES):
        here, turned = (part[0] for part in _core.forward_kinematics(core, q[None]))
        missing = weight * np.concatenate([position - here, rotation_log(rotation @ turned.T)])
        jacobian = weight[:, None] * _core.geometric_jacobian(core, q[None])[0]
        step = lstsq(jacobian, missing, rcond=1e-12)[0]
        q = q + step * min(1.0, 0.5 / max(float(np.max(np.abs(step))), 1e-300))
        if np.max(np.abs(step)) < _TOLERANCE:
            break
    here, turned = (part[0] for part in _core.forward_kinematics(core, q[None]))
    near = np.linalg.norm(position - here) < FARTHEST_RAD / _PLACE_FIRST
    return q if near and np.linalg.norm(rotation_log(rotation @ turned.T)) < FARTHEST_RAD else None
