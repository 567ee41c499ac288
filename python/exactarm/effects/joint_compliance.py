"""Joint compliance: the drive train of an axis gives way under the torque that it carries.

change of q = -(linear torque + cubic torque^3), in rad; the joint torque of a static pose is the gravity torque.
Linear and cubic compliance, as the thesis takes for gears 2 and 3 (1.1.2, (2.18)); E4 for the sign. A declared
spring stays in the robot's tables; this is what is missing beside it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from exactarm.effects.base import Change, Effect, Parameter, Station


@dataclass(frozen=True)
class JointCompliance(Effect):
    """Compliance of one axis beyond its declared spring; `cubic_free` adds the cubic term to the estimate.

    beside_spring: only there may the linear term be negative, where the declared spring is too soft.
    """

    cubic_free: bool = False
    beside_spring: bool = True

    name: ClassVar[str] = "joint_compliance"
    plain: ClassVar[str] = "a joint that gives way under load"
    station: ClassVar[Station] = Station.SPRING
    kinds: ClassVar[tuple[str, ...]] = ("poses", "motion", "tracked_motion")
    compensable: ClassVar[bool] = True
    sentence: ClassVar[str] = "axis {joint} gives way by {linear_rad_per_Nm:.3g} rad for every Nm that it carries"
    source: ClassVar[str] = "thesis 1.1.2, (2.18), E4; Caenen and Angue 1990"

    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("linear_rad_per_Nm", 5e-6, -np.inf if self.beside_spring else 0.0),
            Parameter("cubic_rad_per_Nm3", 1e-12, fixed=not self.cubic_free),
        )

    def possible(self, robot) -> bool:
        stiffness = robot.joints[self.index].spring_linear
        return self.values[0] + (1.0 / stiffness if stiffness else 0.0) >= 0.0

    def change(self, view) -> Change:
        linear, cubic = self.values
        torque = view.torque[:, self.index]
        derivative = np.stack([-torque, -(torque**3)], axis=1)[:, None, :]
        by_torque = np.zeros((view.rows, 1, view.axes))
        by_torque[:, 0, self.index] = -(linear + 3.0 * cubic * torque**2)
        value = -(linear * torque + cubic * torque**3)
        return Change((self.index,), value[:, None], derivative, {"torque": by_torque})

    @classmethod
    def none_of(cls, robot, index: int, cubic_free: bool = False) -> JointCompliance:
        """That of axis `index` (from 0) at zero size."""
        return cls(index + 1, (0.0, 0.0), cubic_free, bool(robot.joints[index].spring_linear))

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        if not view.has_masses:
            return ()
        return (cls.none_of(robot, i, cubic) for i in range(robot.axes) for cubic in (False, True))
