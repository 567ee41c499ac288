"""Which causes of a joint fit are none beside the others, however likely they were before them."""

from __future__ import annotations

import numpy as np
from scipy import special

from exactarm.chain import Layout
from exactarm.diagnose.decisions import CREDIBLE
from exactarm.diagnose.fitted import Fitted
from exactarm.numerics.regression import Fit

_ONE_SIDE = float(special.ndtri(CREDIBLE))  # standard deviations


def idle_places(fitted: Fitted, declared: Layout) -> list[int]:
    """Places, behind the declared ones, of effects that their bounds hold at zero, or no arm can have."""
    layout, spread = fitted.layout, _spread(fitted.fit)
    each = list(zip(layout.effects, layout.free, layout.slices))[len(declared.effects) :]
    held = lambda values, where: fitted.fit.at_bound[where].all() and not np.any(values)
    return [k for k, (one, free, where) in enumerate(each) if free.any() and (
        held(np.array(one.values)[free], where) or not one.possible(fitted.robot, spread[where]))]


def _spread(fit: Fit) -> np.ndarray:
    """(P,) standard deviations; of what a bound holds, how far inside of it the data leave it (95 %, one
    side)."""
    centre, sigma = fit.unbounded
    inside = np.maximum(_ONE_SIDE * sigma - np.abs(centre - fit.x), 0.0)
    return np.where(fit.at_bound, inside, np.sqrt(np.diag(fit.covariance)))


def least_told(fitted: Fitted, declared: Layout) -> list[int]:
    """The place, as of `idle_places`, of the effect whose values the joint fit tells least from zero, if by
    less than one standard deviation, all together: v' C^-1 v < 1. Where two trade one is left, and takes
    it."""
    layout, found = fitted.layout, {}
    each = list(zip(layout.effects, layout.slices))[len(declared.effects) :]
    for place, (effect, where) in enumerate(each):
        values, covariance = layout.values[where], fitted.fit.covariance[where, where]
        if not (effect.any_curve or effect.excludes_rows()) and np.all(np.diag(covariance) > 0.0):
            found[place] = float(values @ np.linalg.solve(covariance, values))
    return [min(found, key=lambda place: found[place])] if found and min(found.values()) < 1.0 else []
