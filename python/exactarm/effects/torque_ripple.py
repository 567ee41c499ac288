"""Torque ripple: a drive torque that repeats with the motor's revolution.

torque = cosine_Nm cos(order theta) + sine_Nm sin(order theta), output side: cogging, current offsets and
phase errors of a synchronous motor (Holtz and Springob 1996); `order` in cycles per motor revolution. Orders
of gear stages and bearings behind the motor are not whole numbers: the peaks of what the model leaves over
the angle are tried, too.
"""

from dataclasses import dataclass, replace

import numpy as np

from exactarm.effects.base import Change, Parameter
from exactarm.effects.drive import DriveEffect
from exactarm.numerics.signals import strongest_orders

ORDERS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 18.0, 20.0, 24.0, 30.0, 36.0, 48.0)
_SAME = 0.02  # relative: the search refines an order by itself


@dataclass(frozen=True)
class TorqueRipple(DriveEffect):
    name = "torque_ripple"
    plain = "torque ripple of the motor"
    of_waves = True
    search: tuple[float, ...] = ORDERS
    sentence = ("the torque of axis {joint} ripples {order:.4g} times per motor revolution "
                "({cosine_Nm:.3g} Nm cosine, {sine_Nm:.3g} Nm sine)")
    source = "Holtz and Springob 1996"

    @property
    def label(self) -> str:
        return f"{self.name}_{self.joint}_order_{self.values[0]:.4g}"

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("order", 6.0, 1e-3, 200.0, search=self.search),
                Parameter("cosine_Nm", 2.0), Parameter("sine_Nm", 2.0))

    def change(self, view) -> Change:
        order, cosine, sine = self.values
        theta = view.theta[:, self.index]
        c, s = np.cos(order * theta), np.sin(order * theta)
        slope = sine * c - cosine * s
        value, by_order = cosine * c + sine * s, theta * slope
        shown = view.shown_of_wave(self.index, order)
        if shown is not None:
            left, slope_of_left = shown
            by_order = left * by_order + slope_of_left * value
            value, slope, c, s = (left * each for each in (value, slope, c, s))
        derivative = np.stack([by_order, c, s], axis=1)[:, None, :]
        return Change((self.index,), value[:, None], derivative, self.by_signal(view, theta=order * slope))

    @classmethod
    def candidates(cls, robot, view):
        for effect in super().candidates(robot, view):
            tried = (*ORDERS, *_peaks(view, effect.index))
            yield replace(effect, search=tried).with_values((1.0, 0.0, 0.0))


def _peaks(view, index: int) -> list[float]:
    """Orders, in cycles per motor revolution, at which the torque left at an axis repeats, none of ORDERS."""
    left = view.signals.get("axis_residual")
    ratio = abs(view.robot.ratios[index])
    if left is None:
        return []
    used = left[:, index] != 0.0
    angle = view.theta[:, index] / ratio
    pieces = [(angle[rows], left[rows, index])
              for rows in (used & (view.data.run == run) for run in np.unique(view.data.run))]
    found = strongest_orders(pieces, ratio) / ratio
    return [float(order) for order in found if np.abs(np.array(ORDERS) / order - 1.0).min() > _SAME]
