"""Confusion: candidates whose predictions collide on this data, and the measurement that would part them.

Two candidates collide when, after the declared parameters have been projected out, the first's best prediction lies
within the second's span up to a small angle (canonical correlation above 0.95).
"""

from __future__ import annotations

import numpy as np

from exactarm.diagnose.problem import Fitted
from exactarm.diagnose.scan import free_mask
from exactarm.effects.base import Effect

COLLISION = 0.95


def collides(fitted: Fitted, one: Effect, other: Effect) -> bool:
    return similarity(fitted, one, other) > COLLISION


def similarity(fitted: Fitted, one: Effect, other: Effect) -> float:
    """Cosine between the prediction of `one` at its values and the span of `other`, declared parameters out."""
    free = _declared_basis(fitted, (one.label, other.label))
    project = lambda columns: columns - free @ (free.T @ columns)
    first = project(fitted.columns(one)[:, free_mask(one)]) @ np.array(one.values)[free_mask(one)]
    second = project(fitted.columns(other)[:, free_mask(other)])
    length = np.linalg.norm(first)
    if length == 0.0 or second.size == 0:
        return 0.0
    inside = second @ np.linalg.lstsq(second, first, rcond=1e-9)[0]
    return float(np.linalg.norm(inside) / length)


def _declared_basis(fitted: Fitted, without: tuple[str, ...]) -> np.ndarray:
    """Basis of all free parameters except those of the named effects."""
    from exactarm.diagnose.problem import orthonormal

    keep = np.ones(fitted.layout.size, bool)
    for effect, where in zip(fitted.layout.effects, fitted.layout.slices):
        if effect.label in without:
            keep[where] = False
    data = (fitted.jacobian[:, :, keep] * fitted.scale[:, :, None]).reshape(fitted.data_numbers, -1)
    return orthonormal(np.concatenate([data, fitted.prior_rows[:, keep]]))


def next_experiment(problem, fitted: Fitted, findings, alternatives) -> str | None:
    """What to measure to part the findings from the alternatives that collide with them; None when none does."""
    doubtful = [a for a in alternatives if a.collides]
    if not doubtful:
        return None
    rival = doubtful[0]
    own = next(f.effect for f in findings if f.effect.label == rival.instead_of)
    return problem.separating_experiment(fitted, own, rival.effect)
