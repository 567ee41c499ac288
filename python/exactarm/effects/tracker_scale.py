"""Tracker scale: the measuring device stretches its own axes: measured_k += scale_k measured_k.

A scale that is the same on all three axes is absorbed by the arm's geometry, so at most two are told at once;
but for the way of a sliding axis whose ratio is not estimated again, which no length absorbs.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station

_ALIKE = "alike"


@dataclass(frozen=True)
class TrackerScale(Effect):
    """Scale errors along the device's axes; `axes`: which of x, y, z are estimated; "alike": one for all."""

    axes: str = "z"

    name = "tracker_scale"
    plain = "a wrong scale of the tracker"
    station = Station.DEVICE
    kinds = WITH_TARGET
    per_joint = False
    sentence = (
        "the measuring device stretches its axes by {x_scale:.3g}, {y_scale:.3g} and {z_scale:.3g} (x, y, z)")
    source = "ASME B89.4.19 (ranging and angular errors of laser trackers)"

    def parameters(self) -> tuple[Parameter, ...]:
        told = "x" if self.axes == _ALIKE else self.axes
        return tuple(Parameter(f"{axis}_scale", 1e-4, -0.1, 0.1, fixed=axis not in told) for axis in "xyz")

    def with_values(self, values: Iterable[float]) -> Effect:
        values = tuple(values)
        return super().with_values(values[:1] * 3 if self.axes == _ALIKE else values)

    def change(self, view) -> Change:
        scale = np.asarray(self.values)
        measured = view.measured[:, :3]
        derivative = measured[:, :, None] * (np.eye(3)[0] if self.axes == _ALIKE else np.eye(3))
        by_measured = np.broadcast_to(np.diag(scale), (view.rows, 3, 3))
        return Change((0, 1, 2), scale * measured, derivative, {"measured": by_measured})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        slides = any(joint.type == "prismatic" and joint.ratio is None and moves
                     for joint, moves in zip(robot.joints, view.moving))
        told = ("x", "y", "z", "xy", *(("xyz", _ALIKE) if slides else ()))
        return (cls(None, (0.0,) * 3, axes) for axes in told)
