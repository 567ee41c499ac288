"""Base compliance: the whole robot tilts on its foundation under the overturning moment of its weight.

The base turns by rad_per_Nm M_across, M the moment of gravity about the base origin, across the base's z
axis, in a motion less what moves the links (`carried_moment.py`); `weight_alone = true` in a robot file:
of the weight alone, where it gives way too slowly for accelerations.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.effects.base import Change, Effect, Parameter
from exactarm.effects.carried_moment import Bending


@dataclass(frozen=True)
class BaseCompliance(Bending):
    name = "base_compliance"
    plain = "a base that gives way under load"
    per_joint = False
    # Springs of axes 2 and 3 look like a base that tilts: it is as probable as that of one axis of six, so
    # that what every arm has is not outdone because a base has no axes to share its prior with.
    log_odds = -float(np.log(6.0))
    sentence = (
        "the foundation tilts, or axis 1 bends across itself (the two look alike), by {rad_per_Nm:.3g} rad "
        "for every Nm of overturning moment")
    source = "Abele, Weigold and Rothenbuecher 2007"
    parameter_table = (Parameter("rad_per_Nm", 1e-6, 0.0),)

    def change(self, view) -> Change:
        """Joint 1 stands on the base: its axis is the base's z, its origin the base's."""
        return self.bent(view, 0)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        return cls(None, (0.0,)).forms_in(view) if view.has_masses else ()
