"""Which causes of a joint fit are none beside the others, however likely they were before them."""

from __future__ import annotations

import numpy as np
from scipy import special

from exactarm.chain import Layout
from exactarm.diagnose.decisions import CREDIBLE
from exactarm.diagnose.fitted import Fitted
from exactarm.effects.base import Effect
from exactarm.numerics.regression import Fit

_ONE_SIDE = float(special.ndtri(CREDIBLE))  # standard deviations


def idle_places(fitted: Fitted, declared: Layout) -> list[int]:
    """Places, behind the declared ones, of effects that their bounds hold at zero, or no arm can have."""
    layout, spread = fitted.layout, np.sqrt(np.diag(fitted.fit.covariance))
    each = list(zip(layout.effects, layout.free, layout.slices))[len(declared.effects) :]
    held = lambda values, where: fitted.fit.at_bound[where].all() and not np.any(values)
    can_be = lambda one, free, where: any(
        each.possible(fitted.robot, spread[where]) for each in (one, _credible(one, free, fitted.fit, where)))
    return [k for k, (one, free, where) in enumerate(each) if free.any() and (
        held(np.array(one.values)[free], where) or not can_be(one, free, where))]


def _credible(effect: Effect, free: np.ndarray, fit: Fit, where: slice) -> Effect:
    """With what its bounds hold moved inside them as far as the data do not exclude it: a spring that the fit
    has at zero may give way by as much as its unbounded estimate is unsure."""
    centre, sigma = fit.unbounded[:, where]
    inward = np.where(fit.x[where] > centre, _ONE_SIDE, -_ONE_SIDE) * sigma
    values = np.array(effect.values)
    values[free] = np.where(fit.at_bound[where], np.clip(centre + inward, *fit.bounds[:, where]),
                            values[free])
    return effect.with_values(values)


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
