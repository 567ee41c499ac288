"""Where a robot file is used at joint angles at which what it holds was never measured.

A curve of a gear says nothing about angles at which it was not estimated. Beyond its ends it keeps the value
of the nearer one, in a gap it is what its prior makes of it, and whoever reads a result must know.
"""

import numpy as np

from exactarm.effects.axis_units import slides
from exactarm.robot.robot import Robot

_LEAST_SHARE = 0.01  # of the rows; deflections move single rows across an end


def extrapolations(robot: Robot, q: np.ndarray, what: str = "rows") -> tuple[str, ...]:
    """A sentence for each effect that is used beyond its angles; q (N, n) in rad, NaN where not logged."""
    q = q[~np.isnan(q).any(axis=1)]
    told = []
    for effect in robot.effects:
        inside = effect.measured(q - robot.offsets)
        if inside is not None and np.mean(~inside) > _LEAST_SHARE:
            low, high = np.asarray(effect.angles_measured) + robot.offsets[effect.index]
            seen = (f"{low:.3f} to {high:.3f} m" if slides(robot, effect.joint)
                    else f"{np.rad2deg(low):.0f} to {np.rad2deg(high):.0f} deg")
            told.append(f"the curve of {effect.name} of axis {effect.joint} was measured from {seen}; "
                        f"{np.sum(~inside):,} of {len(q):,} {what} lie beyond, where it keeps its "
                        "end value, or in a gap")
    return tuple(told)
