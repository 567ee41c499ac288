"""Waves of a gear whose size changes with a signal, as unknown functions of gear runs.

One of the model (declared tables, effects) may change with the time, the load or a covariate: beside it. One
may grow with the speed, beside it or in its place, where no effect of the library does.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.signal import Quantity, Signal
from exactarm.diagnose.unknown import Wave
from exactarm.effects.base import Effect
from exactarm.effects.harmonic_family import declared_orders, searched_orders


def changing_waves(fitted: Fitted, signals: Iterable[Signal], instead: Iterable[Effect],
                   grows: bool) -> list[Wave]:
    """Of a fit, and `instead` of effects that it lacks; grows: whether one may grow with the speed."""
    view, signals = fitted.view, tuple(signals)
    speeds = [signal for signal in signals if signal.quantity == Quantity.SPEED and grows]
    others = [signal for signal in signals if signal.quantity == Quantity.LOAD or signal.axis is None]
    asked = [(int(i), order, 1, speeds + others) for i in np.flatnonzero(view.moving)
             for order in declared_orders(view.robot, i)]
    for effects, by in ((fitted.layout.effects, speeds + others), (instead, speeds)):
        asked += [(effect.index, effect.values[0], _among(effect, view), by) for effect in effects
                  if effect.of_waves and not effect.declared and len(effect.values) > 1]
    return [Wave(axis + 1, float(order), signal, among) for axis, order, among, by in asked for signal in by
            if signal.axis in (axis + 1, None)]


def _among(effect: Effect, view) -> int:
    """Orders of which the data have chosen that of an effect."""
    return max(len(searched_orders(view.robot, view, effect.index)), 1)
