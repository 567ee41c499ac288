"""The 95 % interval of every value of an effect in the final fit: (k, 2).

That of the fit; of a place that was searched, what it lies between; of a size per Nm, as wide as what is not
known of its load makes it.
"""

from __future__ import annotations

import numpy as np

from exactarm.diagnose.fitted import Fitted
from exactarm.effects.base import Effect
from exactarm.robot.generic_masses import with_unknown_load


def intervals_of(effect: Effect, last: Fitted, where: slice, free: np.ndarray) -> np.ndarray:
    """where: its parameters among those of the fit; free (k,) bool: values that are estimated."""
    intervals = np.column_stack([effect.values, effect.values]).astype(float)
    intervals[free] = last.fit.interval()[where]
    names = [parameter.name for parameter in effect.parameters()]
    for name, between in effect.searched_between(last.view).items():
        intervals[names.index(name)] = between
    for k in np.flatnonzero(effect.per_guessed_load(last.view) & free):
        weighed = bool(last.robot.mass) or bool(last.view.measured_loads.any())
        intervals[k] = with_unknown_load(weighed, effect.values[k], *intervals[k])
    if effect.per_load and effect.joint is not None and last.view.measured_loads[effect.index]:
        for column, k in enumerate(np.flatnonzero(free), start=where.start):
            wider = _wider_by_load(last, effect, column, k, np.ptp(intervals[k]) / 2.0)
            intervals[k] += np.array([-wider, wider])
    return intervals


def _wider_by_load(last: Fitted, effect: Effect, column: int, k: int, half: float) -> float:
    """By how much half the interval of value k, `half` for the torques as they are, grows by their noise.

    Torques known to e along any shape of unit mean square leave a size on them open by e / |r| of itself, r
    the part of their shape that nothing else makes up for: 1 / |r| is standard deviation x length of the
    whitened column, over the spread of the torques."""
    length = float(np.linalg.norm(last.standard(last.jacobian[:, :, column : column + 1])))
    doubt = last.view.rest_load.doubt(effect.index) * np.sqrt(last.fit.covariance[column, column]) * length
    return float(np.hypot(half, last.fit.half_width(doubt * abs(effect.values[k])))) - half
