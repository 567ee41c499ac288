"""Torque ripple: a drive torque that repeats with the motor's revolution.

torque = cosine_Nm cos(order theta) + sine_Nm sin(order theta), output side: cogging, current offsets and
phase errors of a synchronous motor (Holtz and Springob 1996); `order` in cycles per motor revolution. Orders
of gear stages before the motor's own are not whole numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect

ORDERS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 18.0, 20.0, 24.0, 30.0, 36.0, 48.0)


@dataclass(frozen=True)
class TorqueRipple(DriveEffect):
    """One order of one axis."""

    name: ClassVar[str] = "torque_ripple"
    plain: ClassVar[str] = "torque ripple of the motor"
    linear: ClassVar[bool] = False
    sentence: ClassVar[str] = (
        "the torque of axis {joint} ripples {order:.4g} times per motor revolution "
        "({cosine_Nm:.3g} Nm cosine, {sine_Nm:.3g} Nm sine)"
    )
    source: ClassVar[str] = "Holtz and Springob 1996"

    @property
    def label(self) -> str:
        return f"{self.name}_{self.joint}_order_{self.values[0]:.4g}"

    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("order", 6.0, 0.05, 200.0, search=ORDERS),
            Parameter("cosine_Nm", 2.0),
            Parameter("sine_Nm", 2.0),
        )

    def change(self, view) -> Change:
        order, cosine, sine = self.values
        theta = view.theta[:, self.index]
        c, s = np.cos(order * theta), np.sin(order * theta)
        slope = sine * c - cosine * s
        derivative = np.stack([theta * slope, c, s], axis=1)[:, None, :]
        value = cosine * c + sine * s
        return Change((self.index,), value[:, None], derivative, self.by_signal(view, theta=order * slope))

    @classmethod
    def candidates(cls, robot, view):
        return (effect.with_values((1.0, 0.0, 0.0)) for effect in super().candidates(robot, view))
