"""Joint offset: the zero of an axis, q = phi + offset (thesis (3.7), the term in Delta q)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.parameter_id import Group, ParameterId


@dataclass(frozen=True)
class JointOffset(Effect):
    """The offset of one axis, in the robot's tables; in m where it slides."""

    slides: bool = False

    name = "joint_offset"
    station = Station.SPRING
    kinds = WITH_TARGET
    compensable = True
    declared = True

    @staticmethod
    def of(robot, index: int) -> JointOffset:
        joint = robot.joints[index]
        return JointOffset(index + 1, (joint.q_offset,), slides=joint.type == "prismatic")

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("q_offset_m" if self.slides else "q_offset_rad", 1e-2),)

    def parameter_label(self, parameter: Parameter) -> str:
        return f"q_offset_{self.joint}_{'m' if self.slides else 'rad'}"

    def parameter_id(self, parameter: Parameter) -> ParameterId:
        return ParameterId(self.parameter_label(parameter), Group.OFFSET, "q_offset", self.joint)

    def describe(self) -> str:
        return f"axis {self.joint} has its zero at {self.values[0]:.5f} {'m' if self.slides else 'rad'}"

    def bake(self, robot):
        # The controller goes on using its own constant.
        controller = robot.controller_offsets[self.index]
        return robot.with_joint(self.index, q_offset=self.values[0], controller_offset=float(controller))

    def change(self, view) -> Change:
        return Change((self.index,), np.zeros((view.rows, 1)), np.ones((view.rows, 1, 1)))
