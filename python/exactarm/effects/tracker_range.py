"""Tracker range: every distance from the tracker's head is too long by one length (the zero of the distance
meter; a reflector of another size than the tracker was told).

measured += longer u,   u = measured / |measured|, the line of sight

The head stands at the origin of the measured coordinates, as in a tracker's own frame. Far away the lines of
sight are nearly parallel: what is left beside a shift, which the base frame absorbs, is a scale longer /
distance of the two axes across them, which `tracker_scale` has, too. Coordinates in another frame do not
tell where the head was; it is no candidate where a target is as far from the robot's base as the origin is,
for no device stands within the arm's reach.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station


@dataclass(frozen=True)
class TrackerRange(Effect):
    """values: longer, m, along the line of sight."""

    name = "tracker_range"
    plain = "a wrong zero of the tracker's distance, or a wrong size of its reflector"
    station = Station.DEVICE
    kinds = WITH_TARGET
    per_joint = False
    source = "ASME B89.4.19; ISO 10360-10 (ranging errors of laser trackers)"
    parameter_table = (Parameter("longer_m", 1e-4),)

    def describe(self) -> str:
        way = "long" if self.values[0] > 0.0 else "short"
        return f"the tracker measures every distance too {way} by {1e3 * abs(self.values[0]):.3g} millimetres"

    def change(self, view) -> Change:
        distance = np.linalg.norm(view.measured[:, :3], axis=1)[:, None]
        sight = view.measured[:, :3] / np.maximum(distance, np.finfo(float).tiny)
        across = np.eye(3) - sight[:, :, None] * sight[:, None, :]
        by_measured = self.values[0] * across / np.maximum(distance, np.finfo(float).tiny)[:, :, None]
        return Change((0, 1, 2), self.values[0] * sight, sight[:, :, None], {"measured": by_measured})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        base = view.signals["base_position"]
        reach = np.linalg.norm(view.signals["target"] - base, axis=1)
        stands = np.linalg.norm(base, axis=1)
        outside = all(stands[rows[0]] > reach[rows].max() for _, rows in view.sessions)
        return (cls(None, (0.0,)),) if outside else ()
