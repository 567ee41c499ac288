"""Declared harmonics: the coefficients of one direction's gear table, re-identified (thesis (3.5), E5).

theta = Xi(phi), so dphi/da_j = -ratio sin(w_j phi) / (w_j u(phi)) and dphi/db_j = -ratio (cos(w_j phi) - 1) /
(w_j u(phi)), on the rows in which the axis moves in that direction; at rest (direction 0, the mean of both
tables) half of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import GEAR_RUN
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.numerics.harmonics import basis, waves
from exactarm.robot.robot import GearTable

_PLAUSIBLE = 3e-3


@dataclass(frozen=True)
class DeclaredHarmonics(Effect):
    """values: a_1 ... a_m, b_1 ... b_m of the table `side` (cw: the motor angle falls)."""

    side: str = "cw"
    orders: tuple[float, ...] = ()

    drawn_to_declared = True
    name = "declared_harmonics"
    station = Station.GEAR
    kinds = (GEAR_RUN.name,)
    compensable = True
    declared = True
    sentence = "harmonics of gear {joint}"
    source = "thesis (2.10), (3.5), E5"

    @classmethod
    def of(cls, robot, index: int, side: str) -> DeclaredHarmonics:
        """The coefficients of joint `index` (from 0) on one side as they stand in the robot's tables."""
        joint = robot.joints[index]
        table = getattr(joint, side) or joint.cw or joint.ccw
        return cls(index + 1, (*table.a, *table.b), side, tuple(table.order))

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"{c}_{order:g}", _PLAUSIBLE) for c in "ab" for order in self.orders)

    def parameter_label(self, parameter: Parameter) -> str:
        return f"gear_{self.joint}_{self.side}.{parameter.name}"

    def bake(self, robot):
        a, b = np.array(self.values).reshape(2, -1)
        table = GearTable(np.array(self.orders), a, b)
        joint = robot.joints[self.index]
        # A table that the axis lacks is the other direction's until it gets its own.
        other = {"cw": "ccw", "ccw": "cw"}[self.side]
        kept = getattr(joint, other) or getattr(joint, self.side)
        return robot.with_joint(self.index, **{self.side: table, other: kept})

    def change(self, view) -> Change:
        direction, way = view.direction[:, self.index], {"cw": -1.0, "ccw": 1.0}[self.side]
        share = np.where(direction == way, 1.0, np.where(direction == 0.0, 0.5, 0.0))
        slope = view.signals["gear_slope"][:, self.index] * view.robot.ratios[self.index]
        sine, cosine = basis(view.phi[:, self.index], np.array(self.orders))
        columns = -(share * slope)[:, None] * np.concatenate([sine, cosine], axis=1)
        none, rate = np.zeros((view.rows, 1)), None
        if view.is_fast(self.index, max(self.orders)):
            turns = share * slope * view.signals["phi_dot"][:, self.index]
            bends = view.signals["gear_slope_dot"][:, self.index] / view.signals["gear_slope"][:, self.index]
            sine, cosine = waves(view.phi[:, self.index], np.array(self.orders))
            swings = bends[:, None] * columns - turns[:, None] * np.concatenate([cosine, -sine], axis=1)
            rate = Change((self.index,), none, swings[:, None, :])
        return Change((self.index,), none, columns[:, None, :], rate=rate)
