"""Link inertia: some of the inertial parameters of the links, as the tables have them, identified.

pi_i = (m, m cx, m cy, m cz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz) in link frame i, inertia about its origin; the
torque is linear in them, tau = Y pi (Atkeson, An and Hollerbach 1986). `columns`: which of the 10 n are the
values.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.data.kinds import MOTION
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.robot.robot import Link

SYMBOLS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
_UNITS = ("kg",) + ("kg_m",) * 3 + ("kg_m2",) * 6
PLAUSIBLE = (10.0,) + (2.0,) * 3 + (1.0,) * 6


@dataclass(frozen=True)
class LinkInertia(Effect):
    columns: tuple[int, ...] = ()

    name = "link_inertia"
    station = Station.LOAD
    kinds = (MOTION.name,)
    declared = True
    inertia_of = "links"
    per_joint = False
    sentence = "inertial parameters of the links"

    @staticmethod
    def of(robot, columns) -> LinkInertia:
        pi = _core.inertial_parameters(robot.core)
        return LinkInertia(None, tuple(float(pi[c]) for c in columns), tuple(int(c) for c in columns))

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(column_name(c), PLAUSIBLE[c % 10]) for c in self.columns)

    def parameter_label(self, parameter: Parameter) -> str:
        return parameter.name

    def from_tables(self, robot) -> LinkInertia:
        return LinkInertia.of(robot, self.columns)

    def bake(self, robot):
        pi = np.array(_core.inertial_parameters(robot.core))
        pi[list(self.columns)] = self.values
        touched = {c // 10 for c in self.columns}
        links = tuple(
            _link(pi[10 * i : 10 * i + 10]) if i in touched else link for i, link in enumerate(robot.links))
        return replace(robot, links=links)

    def change(self, view) -> Change:
        derivative = np.zeros((view.rows, view.axes, len(self.columns)))
        if view.tangents:
            motion = (view.q, view.signals["q_dot"], view.signals["q_ddot"])
            derivative = _core.dynamics_regressor(view.robot.core, *motion,
                                                  view.threads)[:, :, list(self.columns)]
        return Change(tuple(range(view.axes)), np.zeros((view.rows, view.axes)), derivative)


def column_name(column: int) -> str:
    """Such as mx_3_kg_m: the first moment along x of link 3."""
    link, k = divmod(column, 10)
    return f"{SYMBOLS[k]}_{link + 1}_{_UNITS[k]}"


def _link(pi: np.ndarray) -> Link:
    core = _core.link_inertia(pi)
    return Link(float(core.mass), np.array(core.centre_of_mass), np.array(core.inertia))
