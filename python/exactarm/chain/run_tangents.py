"""Tangents of a time series, one run at a time, from the changes that were recorded when the values passed.

    T_signal += change.by_parameters + sum_s change.by_signal[s] @ T_s
The load is an unknown of the fixed point q(torque(q)), as in static poses:
    (I - B G) T_q = T_0 + B T_L,    B = dq/dtorque, G = dg/dq, T_L = direct tangent of the load.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm import _core
from exactarm.chain.layout import Layout
from exactarm.chain.view import View
from exactarm.effects.base import Change, Station


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


def moved(tangents: dict[str, np.ndarray], signal: str, recorded: Recorded, rows: np.ndarray) -> None:
    """Adds one recorded change to the tangent (R, m, P) of a signal on `rows`, in place."""
    change, tangent = recorded.change, tangents[signal]
    moves = []
    for name, factor in change.by_signal.items():
        if name not in tangents:
            continue
        factor, upstream = factor[rows], tangents[name]
        for j in np.flatnonzero(np.any(factor != 0.0, axis=(0, 1))):
            moves.append(factor[:, :, j, None] * upstream[:, None, j])
    for move in moves:
        tangent[:, list(change.columns)] += move
    if recorded.free.any():
        where = recorded.layout.slices[recorded.index]
        tangent[:, list(change.columns), where] += change.by_parameters[rows][:, :, recorded.free]


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


def joint_tangents(view: View, layout: Layout, passed: list[Recorded], rows: np.ndarray) -> dict[str, np.ndarray]:
    """Tangents (R, n, P) of theta, torque, phi and q on the rows of one run."""
    n, size = view.axes, layout.size
    wide = size + (n if view.has_masses else 0)  # the last n columns: a unit change of each joint torque
    tangents = {"theta": np.zeros((rows.size, n, wide))}
    at = lambda station: (recorded for recorded in passed if recorded.station == station)
    for recorded in at(Station.MOTOR):
        moved(tangents, "theta", recorded, rows)
    unit = np.zeros((rows.size, n, wide))
    if view.has_masses:
        unit[:, :, size:] = np.eye(n)
    tangents["torque"], tangents["q"] = unit.copy(), np.zeros((rows.size, n, wide))
    for recorded in at(Station.LOAD):
        moved(tangents, "torque", recorded, rows)
    direct = tangents["torque"] - unit
    tangents["torque"] = unit if view.has_masses else tangents["torque"]
    tangents["phi"] = view.signals["gear_slope"][rows][:, :, None] * tangents["theta"]
    for recorded in at(Station.GEAR):
        moved(tangents, "phi", recorded, rows)
    spring = view.signals["spring_slope"][rows]
    tangents["q"] = tangents["phi"] + spring[:, :, None] * tangents["torque"]
    for recorded in at(Station.SPRING):
        moved(tangents, "q", recorded, rows)
    if not view.has_masses:
        return tangents
    by_torque, q = tangents["q"][:, :, size:], tangents["q"][:, :, :size] + 0.0
    if np.any(by_torque):
        q += by_torque @ direct[:, :, :size]
        gravity = _core.gravity_torque_jacobian(view.robot.core, view.q[rows], view.threads)
        q = np.linalg.solve(np.eye(n) - by_torque @ gravity, q)
    return {"theta": tangents["theta"][:, :, :size], "q": q}
