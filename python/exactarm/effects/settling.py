"""Settling: poses that are read before the arm has come to rest, by a share of the way from the one before.

change of q = -share * (q - q of the row before)

A positive share: the target is read while the arm still creeps towards its pose, as gears and foundations
do. A negative one: the angles are logged too early, and the arm goes on after that. Both are a matter of the
log, not of the arm; a pose that is driven to and waited for does not know them.

Static poses without approach columns alone: each is taken as reached straight from that of the row before,
the first of a set-up from where it stands.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import POSES
from exactarm.effects.base import Change, Effect, Parameter, Station

_LARGEST = 0.05  # of the way: a log that takes angles in the middle of a motion is a mistake to be told


@dataclass(frozen=True)
class Settling(Effect):
    """values: share of the way."""

    name = "settling"
    plain = "readings before the arm stood still"
    in_axis_units = True
    station = Station.SPRING
    kinds = (POSES.name,)
    source = "ISO 9283:1998, 7.4 (position stabilisation time)"
    parameter_table = (Parameter("share_rad_per_rad", 2e-4, -_LARGEST, _LARGEST),)

    def describe(self) -> str:
        share = self.values[0]
        told = ("still to go" if share > 0.0 else "gone on after its angle was logged")
        return (f"axis {self.joint} has {abs(share):.3g} of its way {told}, if every pose was reached "
                "straight from that of the row before")

    def caveat(self, covariance) -> str:
        if not self.values or self.values[0] >= 0.0:
            return "the target was read while the joint still moved: wait longer at each pose"
        return "the angles were logged while the joint still moved: log them when it stands"

    def change(self, view) -> Change:
        move = view.move[:, self.index]
        return Change((self.index,), (-self.values[0] * move)[:, None], -move[:, None, None])

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        return (cls(int(index) + 1, (0.0,)) for index in np.flatnonzero(view.moving)
                if np.ptp(view.move[:, index]) > 0.0)
