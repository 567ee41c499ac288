"""Poses that part two effects: where, after everything else is fitted anew, their predictions differ most.

Random poses inside the joint limits (or the measured range) are predicted with both effects at their best values;
the difference is freed of what the declared parameters could absorb over old and new poses together, and the
poses are ranked by what is left.
"""

from __future__ import annotations

import numpy as np

from exactarm.chain import predict_poses
from exactarm.dataset import Dataset
from exactarm.diagnose.problem import Fitted, orthonormal
from exactarm.diagnose.scan import free_mask
from exactarm.effects.base import Effect
from exactarm.robot import Robot

_CANDIDATES = 400
_NAMED = 3


def separating_poses(robot: Robot, fitted: Fitted, one: Effect, other: Effect, seed: int) -> str:
    """One sentence with the best poses and by how much the two effects differ there."""
    q = _random_poses(robot, fitted, seed)
    session = np.full(len(q), fitted.view.data.session[0])
    approach = np.random.default_rng(seed + 1).choice([-1.0, 1.0], q.shape)
    data = Dataset.of_arrays("poses", {"q": q, "approach": approach}, session=session, position=np.zeros((len(q), 3)))
    view = predict_poses(robot, fitted.layout, data).view
    difference, absorbed = _difference(fitted, view, one, other)
    left = difference - absorbed @ (absorbed.T @ difference)
    new = left[-3 * len(q) :].reshape(-1, 3)
    apart = np.linalg.norm(new, axis=1)
    best = np.argsort(-apart)[:_NAMED]
    noise = float(np.sqrt(np.sum(fitted.sigma[:3] ** 2)))
    degrees = "; ".join("(" + ", ".join(f"{angle:.0f}" for angle in np.rad2deg(q[i])) + ")" for i in best)
    names = f"{one.label.replace('_', ' ')} and {other.label.replace('_', ' ')}"
    ratio = apart[best].mean() / noise
    if ratio < 1.0:
        return (f"No unloaded pose inside the limits parts {names} (at most {1e6 * apart.max():.0f} um beside a scatter "
                f"of {1e6 * noise:.0f} um): repeat the poses with another known payload, speed or direction of approach.")
    count = max(3, int(np.ceil(16.0 / ratio**2)))
    return (f"Measure {count} poses near q = {degrees} degrees, approached from both directions: there {names} differ "
            f"by {1e6 * apart[best].mean():.0f} um beside a scatter of {1e6 * noise:.0f} um.")


def _random_poses(robot: Robot, fitted: Fitted, seed: int) -> np.ndarray:
    measured = fitted.view.q
    low = [measured[:, i].min() if j.q_min is None else j.q_min for i, j in enumerate(robot.joints)]
    high = [measured[:, i].max() if j.q_max is None else j.q_max for i, j in enumerate(robot.joints)]
    return np.random.default_rng(seed).uniform(low, high, (_CANDIDATES, robot.axes))


def _difference(fitted: Fitted, view, one: Effect, other: Effect) -> tuple[np.ndarray, np.ndarray]:
    """Difference of the two predictions on old and new poses (R,), and a basis of what the others absorb (R, b)."""
    both = (fitted.view, view)
    rows = lambda v, effect: v.response(effect)[:, :3].reshape(-1, len(effect.values))[:, free_mask(effect)]
    stacked = [np.concatenate([rows(v, effect) for v in both]) for effect in (one, other)]
    first = stacked[0] @ np.array(one.values)[free_mask(one)]
    keep = np.ones(fitted.layout.size, bool)
    for effect, where in zip(fitted.layout.effects, fitted.layout.slices):
        if effect.label in (one.label, other.label):
            keep[where] = False
    declared = np.concatenate([v.tangents["measured"][:, :, keep].reshape(-1, int(keep.sum())) for v in both])
    basis = orthonormal(declared)
    old = 3 * fitted.view.rows
    freed = stacked[1][:old] - basis[:old] @ np.linalg.lstsq(basis[:old], stacked[1][:old], rcond=1e-9)[0]
    values = np.linalg.lstsq(freed, first[:old], rcond=1e-9)[0]
    return first - stacked[1] @ values, basis
