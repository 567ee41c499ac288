"""Gravity compensator: a spring beside the drive that carries part of the weight of an axis.

A torsion spring takes stiffness q + preload off the joint torque; a spring on a crank arm, hinged beside
the axis, cosine cos q + sine sin q (zero free length; Klimchik et al. 2013 give the crank with free length,
whose first harmonic this is). What the spring carries, the gear does not. No candidate where the masses are
generic (robot/generic_masses.py) and the load of the axis is not measured: it would only mend a load that
nobody knows.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import MOTION, TRACKED_MOTION
from exactarm.effects.axis_units import slides
from exactarm.effects.base import Change, Effect, Parameter, Station

_CERTAIN = 2.0  # standard deviations
_TIMES = 5.0  # the weight of the arm's own links: payloads and forces of processes are lifted as well


@dataclass(frozen=True)
class GravityCompensator(Effect):
    """Spring of one axis; `crank`: the harmonic pair is estimated, otherwise the linear spring."""

    crank: bool = False

    name = "gravity_compensator"
    station = Station.LOAD
    kinds = (MOTION.name, TRACKED_MOTION.name)
    compensable = True
    sentence = (
        "a spring takes load off axis {joint}: {stiffness_Nm_per_rad:.3g} Nm/rad, preload {preload_Nm:.3g} "
        "Nm, "
        "crank {cosine_Nm:.3g} and {sine_Nm:.3g} Nm")
    source = "Klimchik, Wu, Dumas, Caro, Furet and Pashkevich 2013"

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("stiffness_Nm_per_rad", 200.0, fixed=self.crank),
                Parameter("preload_Nm", 100.0, fixed=self.crank),
                Parameter("cosine_Nm", 200.0, fixed=not self.crank),
                Parameter("sine_Nm", 200.0, fixed=not self.crank))

    def possible(self, robot, deviation) -> bool:
        """What carries weight is no stronger than weight: a curve of the axis would pass for it else."""
        if not robot.links or robot.generic_masses:
            return True
        sizes = np.abs([v for v, p in zip(self.values, self.parameters()) if not p.fixed])
        least = np.maximum(sizes - _CERTAIN * deviation, 0.0)
        strength = np.hypot(*least) if self.crank else max(least)
        return bool(strength <= _TIMES * _greatest_load(robot, self.index))

    def change(self, view) -> Change:
        stiffness, _, cosine, sine = self.values
        q = view.q[:, self.index]
        columns = -np.stack([q, np.ones_like(q), np.cos(q), np.sin(q)], axis=1)
        by_q = self.by_own_entry(view, -(stiffness - cosine * np.sin(q) + sine * np.cos(q)))
        value = columns @ np.asarray(self.values)
        return Change((self.index,), value[:, None], columns[:, None, :], {"q": by_q})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        known = [i for i in range(robot.axes) if not view.guessed_load(i)]
        return (cls(i + 1, (0.0,) * 4, crank) for i in known for crank in (False, True))


def _greatest_load(robot, index: int) -> float:
    """Nm about an axis, N along a sliding one, at most: the links beyond it stretched out, or lifted."""
    lever, load, lifts = 0.0, 0.0, slides(robot, index + 1)
    for link, joint in zip(robot.links[index:], (None, *robot.joints[index + 1 :])):
        if joint is not None:
            lever += float(np.hypot(joint.a, joint.d))
        load += link.mass * (1.0 if lifts else lever + float(np.linalg.norm(link.centre_of_mass)))
    return load * float(np.linalg.norm(robot.gravity))
