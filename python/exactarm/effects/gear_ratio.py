"""Gear ratio: the constant ratio of an axis is not the declared one.

phi = Xi^{-1}(theta) with Xi proportional to the ratio; as a scale error s of the angle that the
declared gear delivers: change of phi = s phi (theta = ratio / (1 + s) phi; thesis (2.11), (3.12)).
"""

from collections.abc import Iterable
from dataclasses import dataclass

from exactarm.data.kinds import ALL_KINDS
from exactarm.effects.axis_units import slides
from exactarm.effects.base import Change, Effect, Parameter, Station


@dataclass(frozen=True)
class GearRatio(Effect):
    name = "gear_ratio"
    plain = "a wrong gear ratio"
    station = Station.GEAR
    kinds = ALL_KINDS
    compensable = True
    log_odds = -1.0  # a ratio is a count of teeth; the scale of a sensor is no such thing
    sentence = "the gear of axis {joint} turns its output by the factor 1 + {scale:.3g} of what is declared"
    source = "thesis (2.11), (3.12)"
    parameter_table = (Parameter("scale", 2e-3, -0.2, 0.2),)

    def in_plain_words_on(self, robot) -> str:
        return "a wrong scale of the travel" if slides(robot, self.joint) else self.in_plain_words

    def describe_on(self, robot) -> str:
        if not slides(robot, self.joint):
            return super().describe_on(robot)
        scale = self.values[0]
        return (f"axis {self.joint} travels 1 + {scale:.3g} times as far as is declared, "
                f"{1e3 * scale:.3g} mm in a metre")

    def change(self, view) -> Change:
        phi = view.phi[:, [self.index]]
        by_phi = self.by_own_entry(view, self.values[0])
        return Change((self.index,), self.values[0] * phi, phi[:, :, None], {"phi": by_phi})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        return (cls(i + 1, (0.0,)) for i in range(robot.axes))
