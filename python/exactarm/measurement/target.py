"""Target: where on the flange the touching ball, tip or sensor sits, one point for all sessions that share
it.

    x = p_base + R_base (p_n + R_n p_tool)

The base frame is no unknown: contacts are wherever the robot touches them. Its rotation is that of the robot
file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from exactarm.data.kinds import CLOSURES, POSES
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.parameter_id import Group, ParameterId
from exactarm.robot.controller_frames import target_on_flange
from exactarm.robot.robot import Placement


@dataclass(frozen=True)
class Target(Effect):
    """The tool point (3,) m in DH frame n, at each of `sessions`; `shared`: the only one, named without a
    session."""

    sessions: tuple[int, ...] = (1,)
    shared: bool = False

    station: ClassVar[Station] = Station.GEOMETRY
    kinds: ClassVar[tuple[str, ...]] = (POSES.name, CLOSURES.name)
    declared: ClassVar[bool] = True
    per_joint: ClassVar[bool] = False

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"{axis}_m", 10.0) for axis in "xyz")

    def parameter_label(self, parameter: Parameter) -> str:
        return (
            f"tool_{parameter.name}" if self.number is None
            else f"session_{self.number}.tool_{parameter.name}"
        )

    def parameter_id(self, parameter: Parameter) -> ParameterId:
        return ParameterId(self.parameter_label(parameter), Group.FRAME, "tool", session=self.number)

    @property
    def number(self) -> int | None:
        """The session, where it is the tool of one alone."""
        return None if self.shared else self.sessions[0]

    def place(self, session, base, tool):
        return base, replace(tool, position=np.asarray(self.values)) if session in self.sessions else tool

    def in_frames_of(self, controller):
        there = target_on_flange(Placement(position=np.asarray(self.values)), controller)
        return there.position, controller.flange.rotation.T

    def change(self, view) -> Change:
        derivative = np.zeros((view.rows, 6, 3))
        tool = view.target_by("tool")
        if tool is not None:
            rows = np.flatnonzero(np.isin(view.data.session, self.sessions))
            derivative[rows] = tool[rows, :, :3]
        return Change(tuple(range(6)), np.zeros((view.rows, 6)), derivative)
