"""Frames: where the robot base stands in the measuring device's frame, and the target on the flange.

One effect per session: base (position, rotation vector) and tool (position, and a rotation vector where the
orientation is measured), those of the robot file: of DH frame 0, and in DH frame n.
x_measured = p_base + R_base (p_n + R_n p_tool).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.parameter_id import Group, ParameterId
from exactarm.numerics.rotation import exp, left_jacobian, log, skew
from exactarm.robot.controller_frames import apart, base_in_device, target_on_flange
from exactarm.robot.robot import Placement

_NAMES = tuple(f"{frame}_{axis}" for frame in ("base", "tool")
               for axis in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"))


@dataclass(frozen=True)
class Frames(Effect):
    """Base and tool frame of one session; `names`: which of their numbers are parameters."""

    session: int = 1
    names: tuple[str, ...] = _NAMES[:9]

    name = "frames"
    station = Station.GEOMETRY
    kinds = WITH_TARGET
    declared = True
    per_joint = False
    sentence = "base and tool frames of a set-up"

    @staticmethod
    def of(session: int, base, tool, orientation: bool) -> Frames:
        numbers = np.concatenate([base.position, log(base.rotation), tool.position, log(tool.rotation)])
        count = 12 if orientation else 9
        return Frames(None, tuple(float(v) for v in numbers[:count]), session, _NAMES[:count])

    def carries_from(self, joint: int) -> np.ndarray:
        return np.array([name.startswith("base") for name in self.names])

    @property
    def frames_of(self) -> int:
        return self.session

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(name, 10.0 if name.endswith("_m") else np.pi) for name in self.names)

    def parameter_label(self, parameter: Parameter) -> str:
        return f"session_{self.session}.{parameter.name}"

    def parameter_id(self, parameter: Parameter) -> ParameterId:
        symbol = parameter.name.split("_", 1)[0]
        return ParameterId(self.parameter_label(parameter), Group.FRAME, symbol, session=self.session)

    def place(self, session, base, tool):
        if session != self.session:
            return base, tool
        v = np.asarray(self.values)
        base = replace(base, position=v[:3], rotation=exp(v[3:6]))
        tool = replace(tool, position=v[6:9])
        return base, replace(tool, rotation=exp(v[9:12])) if len(v) == 12 else tool

    def in_frames_of(self, controller):
        """base C^-1 and F^-1 tool: the controller's base in the device's frame, the target on its flange."""
        v, slope = np.asarray(self.values), np.eye(len(self.values))
        if not apart(controller):
            return v, slope
        base = base_in_device(Placement(exp(v[3:6]), v[:3]), controller)
        turn = exp(v[9:12]) if len(v) == 12 else np.eye(3)
        tool = target_on_flange(Placement(turn, v[6:9]), controller)
        turned = left_jacobian(v[3:6])
        slope[:3, 3:6] = skew(base.rotation @ controller.base.position) @ turned
        slope[3:6, 3:6] = np.linalg.solve(left_jacobian(log(base.rotation)), turned)
        back = controller.flange.rotation.T
        slope[6:9, 6:9] = back
        if len(v) == 12:
            slope[9:, 9:] = np.linalg.solve(left_jacobian(log(tool.rotation)), back @ left_jacobian(v[9:]))
        numbers = [base.position, log(base.rotation), tool.position, log(tool.rotation)]
        return np.concatenate(numbers)[: len(v)], slope

    def change(self, view) -> Change:
        k = len(self.values)
        derivative = np.zeros((view.rows, 6, k))
        base, tool = view.target_by("base"), view.target_by("tool")
        if base is not None:
            rows = np.flatnonzero(view.data.session == self.session)
            columns = np.concatenate([base[rows], tool[rows]], axis=2)[:, :, :k]
            columns[:, :, 3:6] = columns[:, :, 3:6] @ left_jacobian(np.asarray(self.values[3:6]))
            if k == 12:
                columns[:, :, 9:12] = columns[:, :, 9:12] @ left_jacobian(np.asarray(self.values[9:12]))
            derivative[rows] = columns
        return Change(tuple(range(6)), np.zeros((view.rows, 6)), derivative)
