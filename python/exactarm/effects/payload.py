"""Payload: a mass at the flange that the robot file does not know of.

    pi_n += (m, s, I),  s = m c the first moment in DH frame n,
    I = m / (m^2 + m0^2) (|s|^2 1 - s s') + J     about the flange: that of a point mass at c for m >> m0,
                                                  and J, of the body about c

Mass and first moment are the parameters, so that a mass of zero is no singular point (m0 = 1 g); the centre
of mass is c = s / m. J shows in fast motions alone: a point, and a body where the data ask for it. At rest
there is none. The derivative of the joint torque is the regressor's (Atkeson, An and Hollerbach 1986).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.data.kinds import MOTION, POSES, TRACKED_MOTION
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.change import CERTAIN
from exactarm.robot.pseudo_inertia import ENTRIES

_MASS_FLOOR_KG = 1e-3
_OF_A_POINT = 4  # values: mass and first moment
_GYRATION_M = 0.1  # of what flanges carry
HEAVY = 2.0  # times the arm's own mass: light arms carry up to their own, grams are a thousand times too much


@dataclass(frozen=True)
class Payload(Effect):
    """Mass (kg) and first moment (kg m, DH frame n) of what the flange carries beside the declared links; of
    a body with its six moments of inertia (kg m^2) about its centre."""

    name = "payload"
    told_by = "mass_kg"
    plain = "a payload that is not as declared"
    station = Station.LOAD
    kinds = (POSES.name, MOTION.name, TRACKED_MOTION.name)
    compensable = True
    by_load = True
    carried = True
    per_joint = False
    source = "Atkeson, An and Hollerbach 1986; Swevers, Verdonck and De Schutter 2007"

    def parameters(self) -> tuple[Parameter, ...]:
        moments = tuple(Parameter(f"moment_{axis}_kg_m", 1.0) for axis in "xyz")
        own = tuple(Parameter(f"inertia_{'xyz'[i]}{'xyz'[j]}_kg_m2", 5.0 * _GYRATION_M**2)
                    for i, j in ENTRIES)
        return (Parameter("mass_kg", 5.0), *moments, *(own if len(self.values) > _OF_A_POINT else ()))

    @classmethod
    def from_table(cls, table) -> Effect:
        body = any(name.startswith("inertia_") for name in table)
        raw = cls(None, (0.0,) * (_OF_A_POINT + (len(ENTRIES) if body else 0)))
        return raw.with_values(float(table[parameter.name]) for parameter in raw.parameters())

    @property
    def centre_of_mass(self) -> np.ndarray:
        """(3,) m in DH frame n; NaN where the mass is zero."""
        mass, moment = self.values[0], self.values[1:_OF_A_POINT]
        return np.array(moment) / mass if mass else np.full(3, np.nan)

    def describe(self) -> str:
        x, y, z = 1e3 * self.centre_of_mass
        return (
            f"the flange carries {self.values[0]:.3g} kg more than declared, centred at ({x:.0f}, {y:.0f}, "
            f"{z:.0f}) mm of the last DH frame")

    def derived(self, covariance):
        """Centre of mass s / m, by the delta method: d(s / m) = (ds - c dm) / m."""
        mass = self.values[0]
        if not self._weighs(covariance):
            return ()
        found = []
        for k, axis in enumerate("xyz", start=1):
            slope = np.zeros(len(self.values))
            slope[0], slope[k] = -self.values[k] / mass**2, 1.0 / mass
            found.append((f"com_{axis}_m", self.values[k] / mass, float(np.sqrt(slope @ covariance @ slope))))
        return tuple(found)

    def caveat(self, covariance):
        if self._weighs(covariance):
            return ""
        return ("this data tells its moment but not its mass apart from the lever arm: no centre of mass is "
                "given")

    def possible(self, robot, deviation) -> bool:
        """Not lighter than nothing, nor HEAVY times as heavy as the arm, beyond what the estimate leaves; a
        body with no negative moment of inertia."""
        links, doubt = robot.links or (), CERTAIN * deviation[0]
        own = sum(link.mass for link in links)
        lightest = -links[-1].mass if links else 0.0
        about = zip(ENTRIES, self.values[_OF_A_POINT:], deviation[_OF_A_POINT:])
        body = all(value + CERTAIN * doubt >= 0.0 for (i, j), value, doubt in about if i == j)
        return body and self.values[0] + doubt >= lightest and not 0.0 < HEAVY * own < self.values[0] - doubt

    def _weighs(self, covariance) -> bool:
        return abs(self.values[0]) > max(CERTAIN * np.sqrt(covariance[0, 0]), _MASS_FLOOR_KG)

    def bake(self, robot):
        if robot.links is None:
            return robot
        link = robot.links[-1]
        return replace(robot, links=robot.links[:-1] + (with_added(link, inertial(self.values)[0]),))

    def station_in(self, view) -> Station:
        return self.station if view.is_series else Station.FLANGE

    def change(self, view) -> Change:
        """Its weight is that of the last link (`bake`); here is its derivative: at rest through all that
        gives way under what the flange carries, in a motion through the torque of the joints."""
        count = len(self.values)
        if not view.is_series:
            by_values = np.tile(np.eye(_OF_A_POINT, count), (view.rows, 1, 1))
            return Change(tuple(range(_OF_A_POINT)), np.zeros((view.rows, _OF_A_POINT)), by_values)
        derivative = np.zeros((view.rows, view.axes, count))
        if view.tangents and view.has_masses:
            q = view.q
            rates = [view.signals.get(name, np.zeros_like(q)) for name in ("q_dot", "q_ddot")]
            regressor = _core.dynamics_regressor(view.robot.core, q, *rates, view.threads)[:, :, -10:]
            derivative = regressor @ inertial(self.values)[1]
        return Change(tuple(range(view.axes)), np.zeros((view.rows, view.axes)), derivative)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        if not view.has_masses or robot.generic_masses:
            return
        yield cls(None, (0.0,) * _OF_A_POINT)
        if view.is_series:
            yield cls(None, (0.0,) * (_OF_A_POINT + len(ENTRIES)))


def inertial(values) -> tuple[np.ndarray, np.ndarray]:
    """pi (10,) of mass, first moment and, of a body, its own inertia; its derivative (10, k)."""
    mass, s, own = np.split(np.asarray(values, float), [1, _OF_A_POINT])
    mass = mass[0]
    square = mass**2 + _MASS_FLOOR_KG**2
    inverse, by_mass = mass / square, (_MASS_FLOOR_KG**2 - mass**2) / square**2
    second = s @ s * np.eye(3) - np.outer(s, s)
    pick = lambda matrix: np.array([matrix[i, j] for i, j in ENTRIES])
    pi = np.concatenate([[mass], s, inverse * pick(second)])
    pi[_OF_A_POINT:] += own if own.size else 0.0
    slope = np.eye(10, len(values))
    slope[4:, 0] = by_mass * pick(second)
    for k in range(3):
        unit = np.eye(3)[k]
        slope[4:, 1 + k] = inverse * pick(2.0 * s[k] * np.eye(3) - np.outer(unit, s) - np.outer(s, unit))
    return pi, slope


def with_added(link, pi: np.ndarray):
    """A link with more inertial parameters (10,), about the origin of its frame."""
    mass, centre = link.mass, np.asarray(link.centre_of_mass, float)
    moved = lambda m, c: m * (c @ c * np.eye(3) - np.outer(c, c))
    about_origin = np.asarray(link.inertia, float) + moved(mass, centre)
    added = np.zeros((3, 3))
    for value, (i, j) in zip(pi[4:], ENTRIES):
        added[i, j] = added[j, i] = value
    total = mass + pi[0]
    moment = mass * centre + pi[1:4]
    if total == 0.0:  # only then is there no centre; the moments are zero with the mass in any real body
        return replace(link, mass=0.0, centre_of_mass=np.zeros(3), inertia=about_origin + added)
    new_centre = moment / total
    return replace(link, mass=total, centre_of_mass=new_centre,
                   inertia=about_origin + added - moved(total, new_centre))
