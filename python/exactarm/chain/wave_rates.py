"""d/dt of what waves of gears do, where differences between samples do not follow them.

A gyroscope reads rates. The chain takes them by differences of eighth order, which show 0.92 of a wave at
0.58 of half the sampling rate and nothing of one at half of it; one that passes faster still folds back with
the wrong sign. The motors' angles are smooth, and a wave is a function of them, so its rate is known:

    declared gears       phi_dot = theta_dot dphi/dtheta
    effects with rates   `Change.rate` holds d/dt of all that the change holds
    all else             differences

For values and tangents alike,   T + B T_up -> T' + B' T_up + B T_up',   ' = d/dt exactly; what is kept is the
difference D = T' - differences of T, of the angles phi (N, n) behind the gears. Springs behind them give way
by a thousandth of it, and pass it on as it is.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from exactarm import _core
from exactarm.chain.run_tangents import Recorded, Tangents
from exactarm.view import View

Rate = Callable[[np.ndarray], np.ndarray]


def prepare(view: View, rate: Rate, step_s: float, moved_motors: bool) -> None:
    """Tells the view what effects need to know of rates, behind the declared gears; moved_motors: whether an
    effect has moved the motors' angles."""
    turning = rate(view.theta) if moved_motors else view.signals["theta_dot"]
    slope = view.signals["gear_slope"]
    view.signals["phi_dot"] = slope * turning
    view.rate = rate
    view.turned_in_a_step = step_s * np.max(np.abs(view.signals["phi_dot"]), axis=0, initial=0.0)
    view.signals["gear_slope_dot"] = _slope_rate(view)


def _slope_rate(view: View) -> np.ndarray:
    """(N, n) d/dt of dphi/dtheta = 1 / u(phi)."""
    out = np.zeros((view.rows, view.axes))
    for axis in np.flatnonzero([joint.has_harmonics for joint in view.robot.joints] & view.moving):
        joint, way, phi = view.robot.joints[axis], view.direction[:, axis], view.phi[:, axis]
        cw, ccw = (_core.gear_ratio(joint.ratio, table.core(), phi, 1)
                   for table in (joint.cw or joint.ccw, joint.ccw or joint.cw))
        bends = 0.5 * (1.0 - way) * cw + 0.5 * (1.0 + way) * ccw
        out[:, axis] = -view.signals["gear_slope"][:, axis] ** 2 * bends * view.signals["phi_dot"][:, axis]
    return out


def fast_gears(view: View) -> list[int]:
    """Axes (from 0) whose declared waves pass faster than differences follow."""
    return [axis for axis, joint in enumerate(view.robot.joints)
            if joint.has_harmonics and view.is_fast(axis, joint.highest_order)]


def beyond_values(view: View, declared: np.ndarray, passed: list[Recorded], rate: Rate) -> np.ndarray:
    """(N, n) D of the angles, from those behind the declared gears on."""
    beyond, fast = np.zeros((view.rows, view.axes)), fast_gears(view)
    if fast:
        beyond[:, fast] = view.signals["phi_dot"][:, fast] - rate(declared[:, fast])
    for change in (recorded.change for recorded in passed if recorded.change.rate is not None):
        beyond[:, list(change.columns)] += change.rate.value - rate(change.value)
    return beyond


class TangentsBeyond:
    """D of the tangents of the angles on the rows of one run: by_axis, axis -> (R, P)."""

    def __init__(self, view: View, rows: np.ndarray, rate: Rate):
        self.view, self.rows, self.rate = view, rows, rate
        self.by_axis: dict[int, np.ndarray] = {}

    def behind_gears(self, tangents: Tangents) -> None:
        """Of the declared gears."""
        for axis in set(fast_gears(self.view)) & set(tangents["theta"]):
            upstream = tangents["theta"][axis]
            slope, bends = (self.view.signals[name][self.rows, axis, None]
                            for name in ("gear_slope", "gear_slope_dot"))
            self._add(axis, bends * upstream + self._product(slope, upstream))

    def behind_effect(self, tangents: Tangents, recorded: Recorded, size: int) -> None:
        """Of an effect of the gear; tangents: as they are before it."""
        change, rate = recorded.change, recorded.change.rate
        if rate is None:
            return
        rows, moves = self.rows, []
        for i, column in enumerate(change.columns):
            for name, factor in change.by_signal.items():
                for j, upstream in tangents.get(name, {}).items():
                    part = factor[rows, i, j, None]
                    moves.append((column, rate.by_signal[name][rows, i, j, None] * upstream))
                    moves.append((column, self._product(part, upstream)))
                    if name == "phi" and j in self.by_axis:
                        moves.append((column, part * self.by_axis[j]))
            if size and recorded.free.any():
                own, swings = (of.by_parameters[rows, i][:, recorded.free] for of in (change, rate))
                move = np.zeros((rows.size, size))
                move[:, recorded.layout.slices[recorded.index]] = swings - self.rate(own)
                moves.append((column, move))
        for column, move in moves:
            self._add(column, move)

    def by_loads(self, effects: list[Recorded], load: Callable[[int], np.ndarray]) -> None:
        """What effects add that follow a load, whose tangent (R, P) on an axis is what moved angles make of
        it."""
        for recorded in (each for each in effects if each.change.rate is not None):
            for axis in recorded.change.columns if "torque" in recorded.change.by_signal else ():
                self.behind_effect({"torque": {axis: load(axis)}}, recorded, 0)

    def _product(self, slow: np.ndarray, upstream: np.ndarray) -> np.ndarray:
        return slow * self.rate(upstream) - self.rate(slow * upstream)

    def _add(self, axis: int, move: np.ndarray) -> None:
        self.by_axis[axis] = self.by_axis[axis] + move if axis in self.by_axis else move
