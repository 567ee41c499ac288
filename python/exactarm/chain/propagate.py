"""Forward differentiation through the stations: values and tangents of one signal after another.

A change at a station adds its value to the signal, and to the tangent
    T_signal += change.by_parameters + sum_s change.by_signal[s] @ T_s.
What the drives and the structure do, they do in every kind of data; encoders and devices belong to their own kind.
"""

from __future__ import annotations

import numpy as np

from exactarm.chain.layout import Layout
from exactarm.chain.view import View
from exactarm.effects.base import Change, Effect, Station


def acts(effect: Effect, view: View, station: Station) -> bool:
    """Whether an effect of the layout has its turn at `station` of this evaluation."""
    if effect.station != station:
        return False
    return station not in (Station.MOTOR, Station.DEVICE) or view.kind in effect.kinds


def pass_station(view: View, layout: Layout, station: Station, signal: str, tangents: bool) -> None:
    """Adds all changes at `station` to the named signal, one effect after another."""
    for index, effect in enumerate(layout.effects):
        if not acts(effect, view, station):
            continue
        change = effect.change(view)
        if tangents:
            view.tangents[signal] = moved_tangent(view, layout, index, change, view.tangents[signal])
        moved = view.signals[signal].copy()
        moved[:, change.columns] += change.value
        view.signals[signal] = moved


def moved_tangent(view: View, layout: Layout, index: int, change: Change, tangent: np.ndarray) -> np.ndarray:
    """The tangent (N, m, P) after a change."""
    moved = tangent.copy()
    columns = list(change.columns)
    for name, factor in change.by_signal.items():
        if name in view.tangents:
            moved[:, columns] += factor @ view.tangents[name]
    mask = layout.free[index]
    if mask.any():
        moved[:, columns, layout.slices[index]] += change.by_parameters[:, :, mask]
    return moved
