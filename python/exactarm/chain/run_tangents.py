"""Tangents of a time series, one run at a time, from the changes that were recorded when the values passed.

    T_signal += change.by_parameters + sum_s change.by_signal[s] @ T_s
The load is an unknown of the fixed point q(torque(q)), as in static poses:
    (I - B G) T_q = T_0 + B T_L,    B = dq/dtorque, G = dg/dq, T_L = direct tangent of the load.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from exactarm import _core
from exactarm.chain.layout import Layout
from exactarm.effects.base import Change, Station
from exactarm.view import View

_NO_FEEDBACK = 1e-15


@dataclass(frozen=True)
class Recorded:
    """One change of one evaluation and the effect (index in the layout) that made it."""

    index: int
    station: Station
    change: Change
    layout: Layout

    @property
    def free(self) -> np.ndarray:
        return self.layout.free[self.index]


# Tangents by signal, by column of the signal: (R, P), absent where zero. Most axes do not move.
Tangents = dict[str, dict[int, np.ndarray]]


class Beyond(Protocol):
    """Sees the tangents of the angles before every change of them (chain/wave_rates.py)."""

    def behind_gears(self, tangents: Tangents) -> None: ...

    def behind_effect(self, tangents: Tangents, recorded: Recorded, size: int) -> None: ...

    def by_loads(self, effects: list[Recorded], load: Callable[[int], np.ndarray]) -> None: ...


def moved(tangents: Tangents, signal: str, recorded: Recorded, rows: slice | np.ndarray, size: int) -> None:
    """Adds a recorded change to the tangent of a signal on `rows`, in place; size = P, 0: no parameters."""
    change, moves = recorded.change, []
    for name, factor in change.by_signal.items():
        for j, upstream in tangents.get(name, {}).items():
            part = factor[rows, :, j]
            if np.any(part):
                moves += [(column, part[:, [i]] * upstream) for i, column in enumerate(change.columns)]
    target = tangents[signal]
    for column, move in moves:
        target[column] = target[column] + move if column in target else move
    if size and recorded.free.any():
        where = recorded.layout.slices[recorded.index]
        for i, column in enumerate(change.columns):
            derivative = change.by_parameters[rows, i][:, recorded.free]
            if not np.any(derivative):
                continue
            if column not in target:
                target[column] = np.zeros((derivative.shape[0], size))
            target[column][:, where] += derivative


def device_map(view: View, passed: list[Recorded]) -> np.ndarray:
    """(N, m, m) d reading / d (reading before the device's effects)."""
    m = view.measured.shape[1]
    total = np.broadcast_to(np.eye(m), (view.rows, m, m)).copy()
    for recorded in passed:
        factor = recorded.change.by_signal.get("measured")
        if recorded.station == Station.DEVICE and factor is not None:
            step = np.zeros_like(total)
            step[:, list(recorded.change.columns)] = factor
            total += step @ total
    return total


def joint_tangents(view: View, layout: Layout, passed: list[Recorded], rows: np.ndarray,
                   beyond: Beyond | None = None) -> dict[int, np.ndarray]:
    """Tangents of q by axis, (R, P), on the rows of one run; beyond: filled with what differences do not show
    of their rates."""
    at = lambda station: (recorded for recorded in passed if recorded.station == station)
    size, slope, spring = layout.size, view.signals["gear_slope"][rows], view.signals["spring_slope"][rows]
    tangents: Tangents = {"theta": {}, "torque": {}}
    for recorded in at(Station.MOTOR):
        moved(tangents, "theta", recorded, rows, size)
    for recorded in at(Station.LOAD):
        moved(tangents, "torque", recorded, rows, size)
    tangents["phi"] = {axis: slope[:, [axis]] * tangent for axis, tangent in tangents["theta"].items()}
    _to_joints(tangents, at, rows, size, spring, beyond)
    if not view.has_masses or not tangents["q"]:
        return tangents["q"]
    n, by_torque = view.axes, np.zeros((rows.size, view.axes, view.axes))
    unit: Tangents = {"theta": {}, "phi": {}, "torque": {}}
    unit["torque"] = {axis: np.broadcast_to(np.eye(n)[axis], (rows.size, n)) for axis in range(n)}
    _to_joints(unit, at, rows, 0, spring)
    for axis, tangent in unit["q"].items():
        by_torque[:, axis] = tangent
    if not np.any(by_torque):
        return tangents["q"]
    gravity = _core.gravity_torque_jacobian(view.robot.core, view.q[rows], view.threads)
    feedback = np.linalg.inv(np.eye(n) - by_torque @ gravity)
    feedback[np.abs(feedback) < _NO_FEEDBACK] = 0.0
    q: dict[int, np.ndarray] = {}
    for axis, tangent in tangents["q"].items():
        for other in np.flatnonzero(np.any(feedback[:, :, axis] != 0.0, axis=0)):
            part = feedback[:, other, axis, None] * tangent
            q[other] = q[other] + part if other in q else part
    if beyond is not None:
        beyond.by_loads(list(at(Station.GEAR)), lambda axis: sum(
            gravity[:, axis, other, None] * tangent for other, tangent in q.items()))
    return q


def _to_joints(tangents: Tangents, at, rows: np.ndarray, size: int, spring: np.ndarray,
               beyond: Beyond | None = None) -> None:
    """From phi and torque to q: gear effects, declared springs, what else gives way."""
    if beyond is not None:
        beyond.behind_gears(tangents)
    for recorded in at(Station.GEAR):
        if beyond is not None:
            beyond.behind_effect(tangents, recorded, size)
        moved(tangents, "phi", recorded, rows, size)
    q = dict(tangents["phi"])
    for axis, tangent in tangents["torque"].items():
        if np.any(spring[:, axis]):
            bent = spring[:, [axis]] * tangent
            q[axis] = q[axis] + bent if axis in q else bent
    tangents["q"] = q
    for recorded in at(Station.SPRING):
        moved(tangents, "q", recorded, rows, size)
