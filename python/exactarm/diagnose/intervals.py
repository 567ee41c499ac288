"""The 95 % interval of every value of an effect in the final fit: (k, 2).

That of the fit; of a place that was searched, what it lies between; of a size per Nm, as wide as what is not
known of its load makes it. NaN of a value that the rows do not show.
"""

from __future__ import annotations

import numpy as np

from exactarm.diagnose.decisions import INVISIBLE
from exactarm.diagnose.fitted import Fitted
from exactarm.effects.base import Effect
from exactarm.effects.change import sizes_beside_first
from exactarm.identify.load_doubt import left_open
from exactarm.robot.generic_masses import spread_of_load, with_unknown_load


def intervals_of(effect: Effect, last: Fitted, where: slice, free: np.ndarray) -> np.ndarray:
    """where: its parameters among those of the fit; free (k,) bool: values that are estimated."""
    intervals = np.column_stack([effect.values, effect.values]).astype(float)
    intervals[free] = last.fit.interval()[where]
    names = [parameter.name for parameter in effect.parameters()]
    for name, between in effect.searched_between(last.view).items():
        intervals[names.index(name)] = between
    powers = np.where(free, effect.per_guessed_load(last.view), 0)
    for k in np.flatnonzero(powers):
        spread = spread_of_load(last.robot, bool(last.view.measured_loads.any()))
        intervals[k] = with_unknown_load(spread, effect.values[k], *intervals[k], int(powers[k]))
    if effect.per_load and effect.joint is not None and last.view.measured_loads[effect.index]:
        for column, k in enumerate(np.flatnonzero(free), start=where.start):
            wider = _wider_by_load(last, effect, column, k, np.ptp(intervals[k]) / 2.0)
            intervals[k] += np.array([-wider, wider])
    intervals[unseen(effect, last, where, free)] = np.nan
    return intervals


def unseen(effect: Effect, last: Fitted, where: slice, free: np.ndarray) -> np.ndarray:
    """(k,) bool: values of which the rows tell less than a thousandth of what is plausible in such data:
    along the axis of a payload that only turns about it, of a direction in which no run moved a sensor."""
    deviation = np.zeros(len(free))
    deviation[free] = np.sqrt(np.diagonal(last.fit.covariance)[where])
    plausible = np.array([parameter.plausible for parameter in effect.parameters()])
    estimated = [parameter for parameter, k in zip(effect.parameters(), free) if k]
    if free[0] and any(parameter.of_first for parameter in estimated):
        moved = np.linalg.norm(last.jacobian[:, :, where], axis=(0, 1))
        plausible[free] = sizes_beside_first(estimated, plausible[free], moved)
    return deviation * INVISIBLE > plausible * max(effect.quickness(last.view))


def derived_of(effect: Effect, last: Fitted, where: slice,
               free: np.ndarray) -> dict[str, tuple[float, float, float]]:
    """Numbers that follow from the values, name -> (value, low, high); of values that the rows show."""
    hidden, known = unseen(effect, last, where, free), np.zeros((len(free),) * 2)
    known[np.ix_(free, free)] = last.fit.covariance[where, where]
    known[hidden], known[:, hidden] = 0.0, 0.0
    follows = {name for name, _, sigma in effect.derived(np.diag(hidden.astype(float))) if sigma > 0.0}
    found = {}
    for name, value, sigma in effect.derived(known):
        if name not in follows:
            half = float(last.fit.half_width(sigma))
            found[name] = (value, value - half, value + half)
    return found


def _wider_by_load(last: Fitted, effect: Effect, column: int, k: int, half: float) -> float:
    """By how much half the interval of value k, `half` for the torques as they are, grows by their noise."""
    opened = left_open(last.view.rest_load, effect.index, effect.values[k],
                       np.sqrt(last.fit.covariance[column, column]),
                       last.standard(last.jacobian[:, :, column : column + 1]))
    return float(np.hypot(half, last.fit.half_width(opened))) - half
