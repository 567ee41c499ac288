"""Base compliance: the whole robot tilts on its foundation under the overturning moment of its weight.

The base turns by rad_per_Nm M_across, M the moment of gravity about the base origin, across the base's z
axis, in a motion less what moves the links (`carried_moment.py`); `weight_alone = true` in a robot file:
of the weight alone, where it gives way too slowly for accelerations. A pedestal, a carriage or a wall is
seldom as stiff about x as about y: the rotation about (x, y) is then

    (rad_per_Nm + differs, skew; skew, rad_per_Nm - differs) M_across      (differs_, skew_rad_per_Nm)
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.effects.base import Change, Effect, Parameter
from exactarm.effects.carried_moment import Bending, giving_way
from exactarm.effects.change import CERTAIN

# of what gives way about (x, y) of the base, one matrix a parameter
_SHAPES = np.array([np.diag([1.0, 1.0, 0.0]), np.diag([1.0, -1.0, 0.0]),
                    [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]])


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
        if view.has_masses:
            yield from cls(None, (0.0,)).forms_in(view)
            yield from UnevenBase(None, (0.0,) * 3).forms_in(view)

    def richer(self) -> Iterable[Effect]:
        yield UnevenBase(None, (*self.values, 0.0, 0.0), self.weight_alone)

    @classmethod
    def from_table(cls, table) -> Effect:
        form = UnevenBase if "differs_rad_per_Nm" in table else cls
        return super(BaseCompliance, form).from_table(table)


@dataclass(frozen=True)
class UnevenBase(BaseCompliance):
    """A base that gives way more about one direction than about another."""

    told_by = "rad_per_Nm"
    parameter_table = (*BaseCompliance.parameter_table,
                       *(Parameter(f"{name}_rad_per_Nm", 5e-7) for name in ("differs", "skew")))

    def describe(self) -> str:
        mean, uneven = self.values[0], float(np.hypot(*self.values[1:]))
        return (f"the foundation tilts, by {mean + uneven:.3g} rad for every Nm of overturning moment about "
                f"one direction and {mean - uneven:.3g} about the one across it"
                + (", slowly: accelerations do not tilt it" if self.weight_alone else ""))

    def richer(self) -> Iterable[Effect]:
        return ()

    def includes(self, other: Effect) -> bool:
        return isinstance(other, BaseCompliance)

    def possible(self, robot, deviation) -> bool:
        """It gives way to a moment about any direction."""
        least = self.values[0] - np.hypot(*self.values[1:])
        return bool(least > -CERTAIN * np.linalg.norm(deviation))

    def change(self, view) -> Change:
        return giving_way(view, 0, _SHAPES, self.values, self.weight_alone)
