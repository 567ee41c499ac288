"""Gravity compensator: a spring beside the drive that carries part of the weight of an axis.

A torsion spring takes stiffness q + preload off the joint torque, one that stiffens, as a bundle of hoses
and cables does, quadratic q^2 + cubic q^3 more; a spring on a crank arm, hinged beside the axis, cosine cos q
+ sine sin q, where its free length is zero. With any free length (Klimchik et al. 2013), phi = q - dead
centre, and a hinge r times as far from the axis as the crank is long, it takes

    T sin(phi) (1 - lambda (1 - rho cos(phi))^(-1/2))  =  T (1 - lambda) sin(phi) + bend sin(phi) h
    rho = 2 r / (1 + r^2),    h = 2 / rho ((1 - rho cos(phi))^(-1/2) - 1),    bend = -T lambda rho / 2

with lambda = free length / (a^2 + b^2)^(1/2); h is cos(phi) where the hinge is far away. The first term is
that of zero free length, and stays a cosine and a sine, so that a weight which is not as declared moves no
dead centre. r = 1 + 2 e^hinge is never below one; what is usual, 1.5 to 9, is the prior of `hinge`: short
arcs do not tell it. What the spring carries, the gear does not. No candidate where the masses are generic
(robot/generic_masses.py) and the load of the axis is not measured: it would only mend a load that nobody
knows.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from exactarm.data.kinds import MOTION, TRACKED_MOTION
from exactarm.effects.axis_units import slides
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.change import CERTAIN

_TIMES = 5.0  # the weight of the arm's own links: payloads and forces of processes are lifted as well
_PLAIN = 4  # values in front of those of a crank with a free length
_CENTRES = tuple(np.linspace(-np.pi, np.pi, 24, endpoint=False))
_USUAL, _HINGES = 0.7, (-1.4, 0.0, 1.25)  # standard deviation of `hinge`, and hinges at 1.5, 3 and 8
_HINGE_ENDS = -4.0, 4.0  # at 1.04 and 110: no prior lets it come there


class Spring(Enum):
    """Which values of a gravity compensator are estimated; see the module."""

    TORSION, STIFFENING, CRANK, HINGED = range(4)


@dataclass(frozen=True)
class GravityCompensator(Effect):
    """Spring of one axis: `form`, of which the values are estimated."""

    form: Spring = Spring.TORSION

    name = "gravity_compensator"
    plain = "a spring beside the drive"
    family = "spring beside a drive"
    station = Station.LOAD
    kinds = (MOTION.name, TRACKED_MOTION.name)
    compensable = True
    source = "Klimchik, Wu, Dumas, Caro, Furet and Pashkevich 2013"

    def parameters(self) -> tuple[Parameter, ...]:
        crank = self.form in (Spring.CRANK, Spring.HINGED)
        plain = (Parameter("stiffness_Nm_per_rad", 200.0, fixed=crank),
                 Parameter("preload_Nm", 100.0, fixed=crank),
                 Parameter("cosine_Nm", 200.0, fixed=not crank), Parameter("sine_Nm", 200.0, fixed=not crank))
        if self.form == Spring.STIFFENING:
            return (*plain, Parameter("quadratic_Nm_per_rad2", 100.0), Parameter("cubic_Nm_per_rad3", 100.0))
        if self.form == Spring.HINGED:
            return (*plain, Parameter("bend_Nm", 200.0), Parameter("dead_centre_rad", 1.0, search=_CENTRES),
                    Parameter("hinge", 1.0, *_HINGE_ENDS, search=_HINGES, prior=_USUAL))
        return plain

    @classmethod
    def from_table(cls, table) -> Effect:
        form = (Spring.HINGED if "bend_Nm" in table else Spring.STIFFENING if "cubic_Nm_per_rad3" in table
                else Spring.TORSION)
        if form == Spring.TORSION and not (table["stiffness_Nm_per_rad"] or table["preload_Nm"]):
            form = Spring.CRANK
        raw = cls(table.get("joint"), (), form)
        return raw.with_values(float(table[parameter.name]) for parameter in raw.parameters())

    def describe(self) -> str:
        stiffness, preload, cosine, sine = self.values[:_PLAIN]
        parts = []
        if stiffness or preload:
            parts = [f"{stiffness:.3g} Nm/rad", f"preload {preload:.3g} Nm"]
        if self.form == Spring.STIFFENING:
            parts += [f"{value:.3g} {unit}"
                      for value, unit in zip(self.values[_PLAIN:], ("Nm/rad²", "Nm/rad³"))]
        if cosine or sine:
            parts += [f"on a crank {np.hypot(cosine, sine):.3g} Nm"]
        if self.form == Spring.HINGED:
            bend, centre, hinge = self.values[_PLAIN:]
            parts += [f"{abs(bend):.3g} Nm for its free length (dead centre at {np.degrees(centre):.0f} deg, "
                      f"hinge {_far(hinge):.3g} times as far away as the crank is long)"]
        return f"a spring takes load off axis {self.joint}: " + ", ".join(parts)

    def possible(self, robot, deviation) -> bool:
        """What carries weight is no stronger than weight, a radian from zero: a curve of the axis would pass
        for it else."""
        if not robot.links or robot.generic_masses:
            return True
        sizes = np.abs([v for v, p in zip(self.values, self.parameters()) if not p.fixed])
        least = np.maximum(sizes - CERTAIN * deviation, 0.0)
        crank = self.form in (Spring.CRANK, Spring.HINGED)
        bends = least[2:3] if crank else least[2:]  # of a hinge: behind it stand angles
        strength = max(np.hypot(*least[:2]) if crank else max(least[:2]), *bends, 0.0)
        return bool(strength <= _TIMES * _greatest_load(robot, self.index))

    def change(self, view) -> Change:
        q = view.q[:, self.index]
        columns = [q, np.ones_like(q), np.cos(q), np.sin(q)]
        slope = self.values[0] - self.values[2] * np.sin(q) + self.values[3] * np.cos(q)
        value = np.stack(columns, axis=1) @ np.asarray(self.values[:_PLAIN])
        if self.form == Spring.HINGED:
            hinged, by_values, by_q = _hinged(q, *self.values[_PLAIN:])
            columns, value, slope = [*columns, *by_values], value + hinged, slope + by_q
        elif self.form == Spring.STIFFENING:
            quadratic, cubic = self.values[_PLAIN:]
            columns = [*columns, q**2, q**3]
            value = value + (quadratic + cubic * q) * q**2
            slope = slope + (2.0 * quadratic + 3.0 * cubic * q) * q
        derivative = -np.stack(columns, axis=1)[:, None, :]
        return Change((self.index,), -value[:, None], derivative, {"q": self.by_own_entry(view, -slope)})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        known = [i for i in range(robot.axes) if not view.guessed_load(i)]
        for i in known:
            yield cls(i + 1, (0.0,) * _PLAIN)
            yield cls(i + 1, (0.0,) * (_PLAIN + 2), Spring.STIFFENING)
            if slides(robot, i + 1):
                continue
            yield cls(i + 1, (0.0,) * _PLAIN, Spring.CRANK)
            yield cls(i + 1, (0.0,) * (_PLAIN + 1) + (_CENTRES[0], _HINGES[0]), Spring.HINGED)


def _far(hinge: float) -> float:
    """How many times as far from the axis as the crank is long."""
    return float(1.0 + 2.0 * np.exp(hinge))


def _hinged(q: np.ndarray, bend: float, centre: float,
            hinge: float) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """bend sin(phi) h (N,) at angles (N,), its derivatives with respect to the values, and to the angle."""
    sine, cosine, far = np.sin(q - centre), np.cos(q - centre), _far(hinge)
    rho = 2.0 * far / (1.0 + far**2)
    by_hinge = 2.0 * (1.0 - far**2) / (1.0 + far**2) ** 2 * (far - 1.0)
    power = (1.0 - rho * cosine) ** -1.5
    h = 2.0 / rho * np.expm1(-0.5 * np.log1p(-rho * cosine))
    by_q = bend * (cosine * h - sine**2 * power)
    return bend * sine * h, [sine * h, -by_q, bend * sine * (cosine * power - h) / rho * by_hinge], by_q


def _greatest_load(robot, index: int) -> float:
    """Nm about an axis, N along a sliding one, at most: the links beyond it stretched out, or lifted."""
    lever, load, lifts = 0.0, 0.0, slides(robot, index + 1)
    for link, joint in zip(robot.links[index:], (None, *robot.joints[index + 1 :])):
        if joint is not None:
            lever += float(np.hypot(joint.a, joint.d))
        load += link.mass * (1.0 if lifts else lever + float(np.linalg.norm(link.centre_of_mass)))
    return load * float(np.linalg.norm(robot.gravity))
