"""Where a robot file is used at joint angles at which what it holds was never measured.

A curve of a gear says nothing about angles at which it was not estimated. Beyond its ends it keeps the value
of the nearer one, in a gap it is what its prior makes of it, and whoever reads a result must know.
"""

from __future__ import annotations

import numpy as np

from exactarm.robot import Robot

_LEAST_SHARE = 0.01  # of the rows; deflections move single rows across an end


def extrapolations(robot: Robot, q: np.ndarray, what: str = "rows") -> tuple[str, ...]:
    """One sentence for each effect of the robot that is used beyond its angles; q (N, n) in rad, NaN where
    not logged."""
    q = q[~np.isnan(q).any(axis=1)]
    told = []
    for effect in robot.effects:
        inside = effect.measured(q - robot.offsets)
        if inside is not None and np.mean(~inside) > _LEAST_SHARE:
            low, high = np.rad2deg(effect.angles_measured) + np.rad2deg(robot.offsets[effect.index])
            told.append(
                f"the curve of {effect.name} of axis {effect.joint} was measured from {low:.0f} to "
                f"{high:.0f} deg; {np.sum(~inside):,} of {len(q):,} {what} lie beyond, where it keeps its "
                "end value, or in a gap"
            )
    return tuple(told)
