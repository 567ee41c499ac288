"""Joint coupling: the motor of one axis also turns another (bevel gears of a hollow wrist, belts through an
arm).

change of phi of the turned axis = coupling * theta_motor / ratio_motor, with the ratio that the controller
takes the motor's gear for: what a calibration finds for that gear is no part of the coupling. Its unit is m
per rad where the turned axis slides, rad per m where the motor's does; the key in files stays.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import ALL_KINDS
from exactarm.data.kinds.base import Device
from exactarm.effects.axis_units import slides
from exactarm.effects.base import Change, Effect, Parameter, Station


@dataclass(frozen=True)
class JointCoupling(Effect):
    """`joint` is the axis that is turned; values: the axis whose motor turns it, and how far per radian
    (m) of output."""

    name = "joint_coupling"
    plain = "a motor that turns another axis too"
    station = Station.GEAR
    kinds = ALL_KINDS
    compensable = True
    by_design = True
    sentence = "the motor of axis {motor:.0f} turns axis {joint} by {coupling_rad_per_rad:.3g} rad per rad"
    source = "Siciliano et al., Robotics (2009), transmission coupling"
    parameter_table = (Parameter("motor", 1.0, fixed=True),
                       Parameter("coupling_rad_per_rad", 0.02, -10.0, 10.0))

    @property
    def label(self) -> str:
        return f"{self.name}_{self.joint}_by_{self.values[0]:.0f}"

    @property
    def title(self) -> str:
        return f"{super().title} by motor {self.values[0]:.0f}"

    @property
    def driven_by(self) -> int:
        return int(self.values[0])

    @property
    def other_axes(self) -> tuple[int, ...]:
        return (self.driven_by,)

    def in_units_of(self, robot, words: str) -> str:
        axes = self.joint, int(self.values[0])
        turned, motor = ("m" if slides(robot, joint) else "rad" for joint in axes)
        words = words.replace(" turns ", " moves ") if turned == "m" else words
        return (words.replace("rad_per_rad", f"{turned}_per_{motor}")
                .replace("rad per rad", f"{turned} per {motor}"))

    def change(self, view) -> Change:
        motor = int(self.values[0]) - 1
        by_theta = np.zeros((view.rows, 1, view.axes))
        by_theta[:, 0, motor] = self.values[1] / view.robot.controller_ratios[motor]
        turned = view.theta[:, motor] / view.robot.controller_ratios[motor]
        derivative = np.zeros((view.rows, 1, 2))
        derivative[:, 0, 1] = turned
        return Change((self.index,), (self.values[1] * turned)[:, None], derivative, {"theta": by_theta})

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        # In a torque a motor at rest shows it too: it holds its share of the load of the axis that it turns.
        in_drives = view.device is Device.DRIVES
        for motor in range(robot.axes) if in_drives else np.flatnonzero(view.moving):
            for turned in range(robot.axes):
                if turned != motor:
                    yield cls(turned + 1, (float(motor + 1), 0.0))
