"""Gear harmonics: orders of the non-constant gear ratio that the declared tables lack (thesis (2.9) to (2.14), E5).

Or, where many orders act together (an encoder disc, the teeth of a strain wave gear on both sides), all of them as one
regularised curve of the output angle: between poses, a free Fourier series would explode. The same in both directions of motion. Orders of one rotating element and its multiples belong together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Iterable

from exactarm.effects.base import Effect
from exactarm.effects.harmonic_family import HarmonicFamily, motor_orders, searched_orders

_CURVE_ORDERS = 40
_CURVE_AMPLITUDES_RAD = (3e-5, 1e-4)  # per order; the evidence chooses


@dataclass(frozen=True)
class GearHarmonics(HarmonicFamily):
    """a_k, b_k relative to the gear ratio."""

    name: ClassVar[str] = "gear_harmonics"
    kinds: ClassVar[tuple[str, ...]] = ("poses", "gear_run", "motion", "tracked_motion")
    compensable: ClassVar[bool] = True
    family: ClassVar[str] = "gear curve"
    sentence: ClassVar[str] = "the ratio of gear {joint} swings {order_per_rev:.2f} times per output revolution"
    source: ClassVar[str] = "thesis 2.2.1, E5"

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        for index in range(robot.axes):
            orders = searched_orders(robot, view, index)
            if len(orders):
                yield cls.zero(index + 1, orders)
            own = motor_orders(robot, orders, index)
            if len(own):
                yield cls.zero(index + 1, own, multiples=2)
            if view.kind == "poses":
                seen = (float(view.phi[:, index].min()), float(view.phi[:, index].max()))
                yield from (cls.curve(index + 1, _CURVE_ORDERS, amplitude, seen) for amplitude in _CURVE_AMPLITUDES_RAD)
