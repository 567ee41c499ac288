"""Forward differentiation through the stations: values and tangents of one signal after another.

A change at a station adds its value to the signal, and to the tangent
    T_signal += change.by_parameters + sum_s change.by_signal[s] @ T_s.
"""

from __future__ import annotations

import numpy as np

from exactarm.chain.layout import Layout
from exactarm.chain.view import View
from exactarm.effects.base import Change, Station


def changes_at(view: View, layout: Layout, station: Station) -> list[tuple[int, Change]]:
    """(index in the layout, change) of every effect at `station`, each seeing the signal as it is at its turn."""
    return [(i, e.change(view)) for i, e in enumerate(layout.effects) if e.station == station]


def pass_station(view: View, layout: Layout, station: Station, signal: str, tangents: bool) -> None:
    """Adds all changes at `station` to the named signal, one effect after another."""
    for index, effect in enumerate(layout.effects):
        if effect.station != station:
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
