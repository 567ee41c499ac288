"""What may not enter a model, whatever the data seem to say of it.

Axes that stand still tell nothing of themselves; an effect that ends at a bound of its own, or that no arm
can have together with what its tables declare, is another cause in disguise.
"""

from __future__ import annotations

import numpy as np

from exactarm.chain import View
from exactarm.data.kinds.base import moving_axes
from exactarm.diagnose.fitted import Fitted
from exactarm.effects.base import Effect
from exactarm.numerics.places import places_of
from exactarm.robot.robot import Robot

# places of an axis that tell a wave: its order and two sizes, beside the zero and the ratio of the gear
_LEAST_PLACES = 6


def shown(effects: list[Effect], view: View) -> list[Effect]:
    """Those of no axis, and those of axes that move; waves only where they do not fold back, and where the
    axis stands in more places than a wave has numbers."""
    span = np.ptp(view.theta, axis=0) / np.abs(view.robot.ratios)
    moves = moving_axes(view.robot, span)
    waves = moves & ~view.folded & (np.array([places_of(angle) for angle in view.theta.T]) >= _LEAST_PLACES)
    return [effect for effect in effects if effect.joint is None
            or (waves if effect.of_waves else moves)[effect.index]]


def is_possible(robot: Robot, fitted: Fitted, index: int) -> bool:
    """Of the effect at `index` of the layout: off its bounds, and within what an arm can be."""
    effect, where = fitted.layout.effects[index], fitted.layout.slices[index]
    deviation = np.sqrt(np.diag(fitted.fit.covariance)[where])
    return not fitted.fit.at_bound[where].any() and effect.possible(robot, deviation)
