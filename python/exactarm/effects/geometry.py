"""Geometry: deviations of the modified Denavit-Hartenberg parameters of one frame (thesis (3.7), E8).

Displacement of the target = identification Jacobian times deviation; a Hayati frame has `beta` and no `d`
(but for a d that a calibration has put on record). A frame without `beta` whose axis is (nearly) parallel to
the next one has it beside `d` all the same: nothing else lets that axis lean, and no arm is made without.
So has the frame of a sliding axis behind the first: no zero of its own turns what it carries, as the zero of
a revolute axis does (two guides that are not square; of the first axis, the base's frame holds this turn).
Values are the parameters themselves, in the robot's tables.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.parameter_id import Group, ParameterId
from exactarm.robot.mdh_frames import NEARLY_PARALLEL, tilt_of_next

_NAMES = ("d_m", "a_m", "alpha_rad", "beta_rad")


@dataclass(frozen=True)
class Geometry(Effect):
    """One frame's d (or Hayati's beta), a and alpha. `names`: which of them the frame has."""

    names: tuple[str, ...] = ("d_m", "a_m", "alpha_rad")

    name = "geometry"
    station = Station.GEOMETRY
    kinds = WITH_TARGET
    compensable = True
    declared = True
    sentence = "frame {joint} deviates from its drawing"

    @staticmethod
    def of(robot, index: int) -> Geometry:
        """The geometry of frame `index` (from 0) as it stands in the robot's tables."""
        joint = robot.joints[index]
        fields = {"d_m": joint.d, "a_m": joint.a, "alpha_rad": joint.alpha}
        if joint.beta is not None and f"d_{index + 1}_m" not in robot.intervals:
            del fields["d_m"]
        leans = tilt_of_next(joint) < NEARLY_PARALLEL or (index > 0 and joint.type == "prismatic")
        if joint.beta is not None or (leans and index + 1 < robot.axes):
            fields["beta_rad"] = joint.beta or 0.0
        return Geometry(index + 1, tuple(fields.values()), tuple(fields))

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(name, 3e-3 if name.endswith("_m") else 5e-3) for name in self.names)

    def parameter_label(self, parameter: Parameter) -> str:
        symbol, unit = parameter.name.rsplit("_", 1)
        return f"{symbol}_{self.joint}_{unit}"

    def parameter_id(self, parameter: Parameter) -> ParameterId:
        symbol = parameter.name.rsplit("_", 1)[0]
        return ParameterId(self.parameter_label(parameter), Group.GEOMETRY, symbol, self.joint)

    def carries_from(self, joint: int) -> np.ndarray:
        """Its own place on the axis, d and a, moves the carriage of a slide along."""
        along = [name in ("d_m", "a_m") for name in self.names]
        return np.array(along) if self.joint == joint else np.full(len(self.names), self.joint < joint)

    def with_all_columns(self, robot) -> Geometry:
        joint = robot.joints[self.index]
        return Geometry(self.joint, (joint.d, joint.a, joint.alpha, joint.beta or 0.0), _NAMES)

    def bake(self, robot):
        fields = {name.rsplit("_", 1)[0]: value for name, value in zip(self.names, self.values)}
        return robot.with_joint(self.index, **fields)

    def change(self, view) -> Change:
        derivative = np.zeros((view.rows, 6, len(self.names)))
        for k, name in enumerate(self.names):
            by_frame = view.target_by(name.rsplit("_", 1)[0])
            if by_frame is not None:
                derivative[:, :, k] = by_frame[:, :, self.index]
        return Change(tuple(range(6)), np.zeros((view.rows, 6)), derivative)
