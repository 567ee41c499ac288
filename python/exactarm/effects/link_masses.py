"""Link masses: masses, centres and inertias of the links that are not those of the robot file.

Change of the inertial parameters of every link (link_inertia.py), each with a Gaussian prior around zero:

    mass m               MASS m
    first moment         MASS m (|c| + r), each way     c centre of mass, r radius of gyration about it
    inertia              2 MASS m (|c|^2 + r^2)

Combinations that no motion shows stay where their prior has them. Parameters without mass in the file stay
zero. It acts in motions only. MASS is a plausible size, no measurement: castings are within some per cent of
their nominal weight, and cables, grease, covers and screws are in few drawings.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.data.kinds import MOTION
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.link_inertia import PLAUSIBLE, LinkInertia, column_name

MASS = 0.03  # relative, standard deviation
_MOST_LINKS = 32  # in a robot file


@dataclass(frozen=True)
class LinkMasses(Effect):
    """columns: which of the 10 n inertial parameters the values change, by default the first ones; sizes:
    standard deviation of each, empty where they are not estimated."""

    columns: tuple[int, ...] = ()
    sizes: tuple[float, ...] = ()

    name = "link_masses"
    plain = "true masses of the links"
    station = Station.LOAD
    kinds = (MOTION.name,)
    inertia_of = "links"
    per_joint = False
    source = "Atkeson, An and Hollerbach 1986"
    open_parameters = "the inertial parameters of every link that has a mass"

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", self.columns or tuple(range(len(self.values))))

    def parameters(self) -> tuple[Parameter, ...]:
        sizes = self.sizes or (np.inf,) * len(self.columns)
        return tuple(Parameter(column_name(c), PLAUSIBLE[c % 10], prior=size)
                     for c, size in zip(self.columns, sizes))

    def describe(self) -> str:
        changed = [f"link {c // 10 + 1} {value:+.3g} kg" for c, value in zip(self.columns, self.values)
                   if c % 10 == 0]
        return f"the masses of the links are not those of the robot file: {', '.join(changed)}"

    def caveat(self, covariance):
        return "how the links share the change is a guess: `exactarm identify` estimates what a motion shows"

    def bake(self, robot):
        own = LinkInertia.of(robot, self.columns)
        return replace(own, values=tuple(np.add(own.values, self.values))).bake(robot)

    def change(self, view) -> Change:
        return LinkInertia(None, self.values, self.columns).change(view)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        if not view.has_masses or robot.generic_masses:
            return ()
        sizes = tolerance(robot)
        columns = tuple(int(c) for c in np.flatnonzero(sizes))
        return (cls(None, (0.0,) * len(columns), columns, tuple(map(float, sizes[list(columns)]))),)

    @classmethod
    def from_table(cls, table):
        columns = tuple(c for c in range(10 * _MOST_LINKS) if column_name(c) in table)
        if not columns:
            raise KeyError(column_name(0))
        return cls(None, tuple(float(table[column_name(c)]) for c in columns), columns)


def tolerance(robot) -> np.ndarray:
    """(10 n,) standard deviation of every inertial parameter of a robot file's links."""
    links = np.array(_core.inertial_parameters(robot.core)).reshape(-1, 10)
    mass = links[:, 0]
    centre = links[:, 1:4] / np.maximum(mass, 1e-300)[:, None]
    about_origin = links[:, [4, 7, 9]].sum(axis=1) / (2.0 * np.maximum(mass, 1e-300))
    gyration = np.maximum(about_origin - np.sum(centre**2, axis=1), 0.0)
    first = MASS * mass * (np.linalg.norm(centre, axis=1) + np.sqrt(gyration))
    second = 2.0 * MASS * mass * (np.sum(centre**2, axis=1) + gyration)
    return np.column_stack([MASS * mass] + [first] * 3 + [second] * 6).ravel()
