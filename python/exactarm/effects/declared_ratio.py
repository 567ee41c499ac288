"""Declared ratio: the constant gear ratio of an axis without a harmonics table, re-identified (thesis
(3.12)).

phi = theta / ratio, hence dphi/dratio = -phi / ratio.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.parameter_id import Group, ParameterId


@dataclass(frozen=True)
class DeclaredRatio(Effect):
    name = "declared_ratio"
    station = Station.GEAR
    kinds = WITH_TARGET
    compensable = True
    declared = True
    sentence = "axis {joint} has the gear ratio {ratio:.6g}"

    @staticmethod
    def of(robot, index: int) -> DeclaredRatio:
        return DeclaredRatio(index + 1, (float(robot.ratios[index]),))

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("ratio", 2e-3 * abs(self.values[0]) if self.values else 0.1),)

    def parameter_label(self, parameter: Parameter) -> str:
        return f"ratio_{self.joint}"

    def parameter_id(self, parameter: Parameter) -> ParameterId:
        return ParameterId(self.parameter_label(parameter), Group.RATIO, "ratio", self.joint)

    def bake(self, robot):
        # The controller goes on reporting by its own constant.
        controller = robot.controller_ratios[self.index]
        return robot.with_joint(self.index, ratio=self.values[0], controller_ratio=float(controller))

    def change(self, view) -> Change:
        phi = view.theta[:, self.index] / self.values[0]
        return Change((self.index,), np.zeros((view.rows, 1)), (-phi / self.values[0])[:, None, None])
