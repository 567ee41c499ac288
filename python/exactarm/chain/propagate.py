"""Values through the stations, and forward differentiation: tangents of one signal after another.

A change at a station adds its value to the signal, and to the tangent
    T_signal += change.by_parameters + sum_s change.by_signal[s] @ T_s,
and what a parameter that carries the whole arm from a joint on does besides (`Change.carried`).
Effects of drives and structure act in every kind of data, those of encoders and devices in their own kinds
only.
"""

import numpy as np

from exactarm.chain.layout import Layout
from exactarm.effects.base import Change, Effect, Station
from exactarm.view import View

Passed = list[tuple[int, Change]]  # index in the layout of the effect that made each


def acts(effect: Effect, view: View, station: Station) -> bool:
    """Whether an effect of the layout has its turn at `station` of this evaluation."""
    if effect.station_in(view) != station:
        return False
    return station not in (Station.MOTOR, Station.DEVICE) or view.kind in effect.kinds


def pass_station(view: View, layout: Layout, station: Station, signal: str, tangents: bool) -> Passed:
    """Adds all changes at `station` to the named signal, one effect after another; tangents: also those of
    what lives in tables, and to the signal's tangent, where the view has one."""
    acting = [(i, effect) for i, effect in enumerate(layout.effects)
              if acts(effect, view, station) and (tangents or not effect.only_in_tables)]
    passed, forward = [], tangents and signal in view.tangents
    if acting and forward:
        view.tangents[signal] = view.tangents[signal].copy()
    for index, effect in acting:
        change = _change(view, effect)
        passed.append((index, change))
        if forward:
            _move_tangent(view, layout, index, change, view.tangents[signal])
        moved = view.signals[signal].copy()
        moved[:, change.columns] += change.value
        view.signals[signal] = moved
    return passed


def pass_tangents(view: View, layout: Layout, station: Station, signal: str) -> np.ndarray:
    """Tangent of the named signal after a station whose values have been passed already."""
    passed = changes(view, layout, station)
    if passed:
        view.tangents[signal] = view.tangents[signal].copy()
    for index, change in passed:
        _move_tangent(view, layout, index, change, view.tangents[signal])
    return view.tangents[signal]


def changes(view: View, layout: Layout, station: Station) -> Passed:
    """Of all effects at a station whose values have been passed already."""
    return [(index, _change(view, effect)) for index, effect in enumerate(layout.effects)
            if acts(effect, view, station)]


def rows_of(change: Change) -> slice | list[int]:
    """Of the signal that a change moves: a view of them where they follow each other, else a copy."""
    rows = list(change.columns)
    together = bool(rows) and rows == [*range(rows[0], rows[-1] + 1)]
    return slice(rows[0], rows[-1] + 1) if together else rows


def _change(view: View, effect: Effect) -> Change:
    """What the effect adds. At rest, where the stations are passed again until angles and loads agree, the
    change of the pass before while no signal that it follows has moved."""
    _, change, follows = view.changes.get(id(effect), (None, None, {}))
    if follows and all(np.array_equal(view.signals[name], values) for name, values in follows.items()):
        return change
    change = effect.change(view)
    if not view.is_series:
        follows = {name: view.signals[name] for name in change.by_signal if name in view.signals}
        view.changes[id(effect)] = effect, change, follows
    return change


def _move_tangent(view: View, layout: Layout, index: int, change: Change, tangent: np.ndarray) -> None:
    """Adds to a tangent (N, m, P), in place, what a change does to it."""
    columns = rows_of(change)
    added = [_through(factor, view.tangents[name]) for name, factor in change.by_signal.items()
             if name in view.tangents]
    if change.carried is not None:
        joint, factor = change.carried
        added.append(_through(factor, view.tangents["displacement"] * layout.carries_from(joint)))
    for part in added:
        if part is not None:
            tangent[:, columns] += part
    mask = layout.free[index]
    if mask.any():
        tangent[:, columns, layout.slices[index]] += change.by_parameters[:, :, mask]


def _through(factor: np.ndarray, tangent: np.ndarray) -> np.ndarray | None:
    """factor (N, c, m) @ tangent (N, m, P), over those m that have any influence; None where none has."""
    used = np.flatnonzero(np.any(factor, axis=(0, 1)))
    if used.size == 0:
        return None
    return factor[:, :, used] @ tangent[:, used]
