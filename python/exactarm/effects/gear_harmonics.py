"""Gear harmonics: orders of the non-constant gear ratio that the declared tables lack (thesis (2.9) to
(2.14), E5).

Or, where many orders act together (an encoder disc, the teeth of a strain wave gear on both sides), all of
them as one regularised curve of the output angle: between poses, a free Fourier series would explode. The
same in both directions of motion. Orders of one rotating element and its multiples belong together.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import ALL_KINDS
from exactarm.effects.axis_units import slides
from exactarm.effects.base import Effect
from exactarm.effects.harmonic_family import HarmonicFamily, motor_orders, searched_orders, slow_orders
from exactarm.numerics.harmonics import delivered_angle

_CURVE_ORDERS, _CURVE_POINTS = 40, 400
_CURVE_AMPLITUDES_RAD = (3e-5, 1e-4)  # per order; the evidence chooses
# laws that a curve is fitted with once it is found: half decades, from what no device sees to a coarse gear
_LAW_AMPLITUDES_RAD = (1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4)
_LAW_FALLS = (0.0, 0.5, 1.0, 1.5)
_LAW_ORDERS = (20, 40, 80)  # waves of 4.5 degrees; the fit grows with the square of their number


@dataclass(frozen=True)
class GearHarmonics(HarmonicFamily):
    """a_k, b_k relative to the gear ratio."""

    name = "gear_harmonics"
    plain = "angle errors that repeat every turn"
    kinds = ALL_KINDS
    compensable = True
    family = "gear curve"
    turns_by_waves = "same"
    sentence = "the ratio of gear {joint} swings {order_per_rev:.2f} times per output revolution"
    source = "thesis 2.2.1, E5"

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        for index in range(robot.axes):
            orders = searched_orders(robot, view, index)
            tried = (*orders, *slow_orders(robot, view, index))
            if len(tried):
                yield cls.zero(index + 1, tried)
            own = motor_orders(robot, orders, index)
            if len(own):
                yield cls.zero(index + 1, own, multiples=2)
            if not view.is_series and not slides(robot, index + 1):  # whose curve is a guide_error
                seen = (float(view.phi[:, index].min()), float(view.phi[:, index].max()))
                yield from (cls.curve(index + 1, _CURVE_ORDERS, amplitude, seen)
                            for amplitude in _CURVE_AMPLITUDES_RAD)

    def laws(self) -> Iterable[Effect]:
        if self.any_curve:
            yield from (self.curve(self.joint, multiples, amplitude, self.seen, fall)
                        for multiples in _LAW_ORDERS for fall in _LAW_FALLS
                        for amplitude in _LAW_AMPLITUDES_RAD)

    def describe(self) -> str:
        if self.seen is None:
            return super().describe()
        angle = np.linspace(*self.seen, _CURVE_POINTS)
        orders = self.values[0] * np.arange(1, self.multiples + 1)
        error = delivered_angle(angle, orders, self.values[1::2], self.values[2::2],
                                np.ones(_CURVE_POINTS)) - angle
        return (f"the output of gear {self.joint} is off by a curve that repeats with every revolution, "
                f"{1e6 * np.std(error):.0f} µrad RMS over the angles measured")
