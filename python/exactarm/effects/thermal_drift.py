"""Thermal drift: the robot or its sensor changes as it warms up.

Nine forms, x the temperature (or time, or row order, where no temperature was measured) from its reference:

    growth     displacement = growth x (flange - base origin): the structure expands (steel 1.2e-5 per K), the
               tool does not, nor the way of a sliding axis, which its scale measures
    link       displacement = growth x (what one link, a row of the table, spans): it alone grows, by the
               heat of its motor or against others of another material (aluminium 2.3e-5 per K)
    target     displacement = drift x: base or tool moves off in one direction
    zero       q_i += drift x: the zero of one axis moves (a warm gear or link turns it); beside a temperature
               with time, too: a thermometer in the room knows nothing of a gear that warms up by its work
    sensor     the gyroscope's bias drifts: rate += drift x
    lubricant  viscous friction falls: torque -= fall x viscous rate, on all axes alike
    friction   dry friction with it
    lubricant_of_axis, friction_of_axis    one axis alone: it warms up by its own work

Sources: Li and Zhao 2016 (structure), Bittencourt and Axelsson 2014 (friction and temperature), IEEE 952
(gyroscope).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from exactarm.data.kinds import ALL_KINDS, GEAR_RUN, MOTION, WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.drive import over_samples, sign_slopes
from exactarm.effects.moving_frames import MovingFrames
from exactarm.effects.slow_driver import ROW, Follows, clock, drivers, pair_of, settles_in, temperatures


@dataclass(frozen=True)
class ThermalDrift(Follows):
    """What all forms share; `driver` names the covariate that the drift follows, or time, or row."""

    name = "thermal_drift"
    plain = "drift with temperature or time"
    station = Station.GEOMETRY
    kinds = ALL_KINDS
    per_joint = False
    source = "Li and Zhao 2016; Bittencourt and Axelsson 2014; IEEE 952"
    form: ClassVar[str] = ""

    @property
    def label(self) -> str:
        common = f"{self.name}_{self.form}"
        return f"{common}_{self.joint}" if self.per_joint else common

    @property
    def of_record(self) -> bool:
        return self.driver == ROW or self.settles

    def to_table(self):
        return super().to_table() | {"form": self.form}

    def at(self, view, x) -> Change:
        """Of three columns, each by a value of its own."""
        return Change((0, 1, 2), x * np.asarray(self.rate_values), x[:, :, None] * np.eye(3))

    @classmethod
    def from_table(cls, table) -> Effect:
        form = next(sub for sub in ThermalDrift.__subclasses__() if sub.form == table["form"])
        raw = form(table.get("joint"), (), table["driver"], pair_of(table), settles_in(table))
        return raw.with_values(table[parameter.name] for parameter in raw.parameters())

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        for form in ThermalDrift.__subclasses__():
            if view.kind in form.kinds:
                for effect in form.of(robot, view):
                    yield from effect.forms_on(view.data)


@dataclass(frozen=True)
class ThermalGrowth(ThermalDrift):
    kinds = WITH_TARGET
    form = "growth"
    may_settle = in_record = True

    def rates(self) -> tuple[Parameter, ...]:
        return (Parameter(f"growth_1_per_{self.unit}", 1e-5),)

    def describe(self) -> str:
        return (f"the arm grows by {self.values[0]:.3g} of its length per {self.unit}{self.in_time} (it "
                f"follows {self.driver})")

    def sums(self, other: Effect) -> bool:
        return isinstance(other, ThermalLinkGrowth) and other.driver == self.driver

    def at(self, view, x) -> Change:
        base = view.signals["base_rotation"].reshape(view.rows, 3, 3)
        positions, rotations = view.frames()
        arm = np.einsum("nij,nj->ni", base, positions[:, -1])
        tool = view.signals["target"] - view.signals["base_position"] - arm
        arm = x * (arm - np.einsum("nij,nj->ni", base, _slid(view, rotations)))
        by_displacement = np.zeros((view.rows, 3, 6))
        by_displacement[:, :, :3] = np.eye(3)
        # The flange moves as the target does, less what a turn does to the tool between them.
        by_displacement[:, :, 3:] = np.cross(tool[:, :, None], np.eye(3), axis=1)
        by_displacement *= self.values[0] * x[:, :, None]
        return Change((0, 1, 2), self.values[0] * arm, arm[:, :, None], {"displacement": by_displacement})

    @classmethod
    def of(cls, robot, view) -> Iterable[Effect]:
        return (cls(None, (0.0,), driver) for driver in drivers(view.data))


def _slid(view, rotations: np.ndarray) -> np.ndarray:
    """(N, 3) m, in the robot's base, that the sliding axes have gone, by rotations (N, n + 1, 3, 3) of the
    frames: each along the z axis of the frame before it."""
    way = np.zeros((view.rows, 3))
    for i, joint in enumerate(view.robot.joints):
        if joint.type == "prismatic":
            way += joint.sign * view.q[:, i, None] * rotations[:, i, :, 2]
    return way


@dataclass(frozen=True)
class ThermalLinkGrowth(ThermalDrift):
    kinds = WITH_TARGET
    per_joint = True
    form = "link"
    may_settle = in_record = True

    @property
    def title(self) -> str:
        return f"thermal growth of link {self.joint}"

    def rates(self) -> tuple[Parameter, ...]:
        return (Parameter(f"growth_1_per_{self.unit}", 1e-5),)

    def describe(self) -> str:
        return (f"the link beyond axis {self.joint} grows by {self.values[0]:.3g} of its length per "
                f"{self.unit}{self.in_time} (it follows {self.driver})")

    def at(self, view, x) -> Change:
        frames, k = MovingFrames.of(view), self.index
        span = frames.origins[:, k + 1] - frames.origins[:, k]
        if not frames.revolute[k]:
            span -= view.q[:, k, None] * frames.axes[:, k]
        by_q = self.values[0] * x[:, :, None] * frames.direction_by_q(span, k)
        return Change((0, 1, 2), self.values[0] * x * span, (x * span)[:, :, None], {"q": by_q})

    @classmethod
    def of(cls, robot, view) -> Iterable[Effect]:
        return (cls(axis + 1, (0.0,), driver) for driver in drivers(view.data) for axis in range(robot.axes)
                if robot.joints[axis].a or robot.joints[axis].d)


@dataclass(frozen=True)
class ThermalTargetDrift(ThermalDrift):
    kinds = WITH_TARGET
    form = "target"
    in_record = True

    def rates(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"drift_{axis}_m_per_{self.unit}", 1e-4) for axis in "xyz")

    def describe(self) -> str:
        size = 1e6 * float(np.linalg.norm(self.values))
        return f"the target drifts by {size:.3g} micrometres per {self.unit} (it follows {self.driver})"

    @classmethod
    def of(cls, robot, view) -> Iterable[Effect]:
        """Only along a temperature: along time it is the drift of the measuring device."""
        return (cls(None, (0.0,) * 3, driver) for driver in temperatures(view.data))


@dataclass(frozen=True)
class ThermalZeroDrift(ThermalDrift):
    station = Station.SPRING
    kinds = WITH_TARGET
    per_joint = True
    form = "zero"
    may_settle = in_record = True

    def rates(self) -> tuple[Parameter, ...]:
        return (Parameter(f"zero_rad_per_{self.unit}", 2e-5),)

    def describe(self) -> str:
        return (f"the zero of axis {self.joint} drifts by {self.values[0]:.3g} rad per "
                f"{self.unit}{self.in_time} (it follows {self.driver})")

    def at(self, view, x) -> Change:
        return Change((self.index,), self.values[0] * x, x[:, :, None])

    @classmethod
    def of(cls, robot, view) -> Iterable[Effect]:
        followed = dict.fromkeys([*drivers(view.data), clock(view.data)])
        return (cls(axis + 1, (0.0,), driver) for driver in followed for axis in range(robot.axes))


@dataclass(frozen=True)
class ThermalSensorDrift(ThermalDrift):
    station = Station.DEVICE
    kinds = (GEAR_RUN.name,)
    form = "sensor"

    def rates(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"drift_{axis}_rad_s_per_{self.unit}", 1e-4) for axis in "xyz")

    def describe(self) -> str:
        size = float(np.linalg.norm(self.values))
        return (f"the bias of the gyroscope drifts by {size:.3g} rad/s per {self.unit} (it follows "
                f"{self.driver})")

    @classmethod
    def of(cls, robot, view) -> Iterable[Effect]:
        return ((cls(None, (0.0,) * 3, driver) for driver in drivers(view.data)) if view.data.gyro is not None
                else ())


class _FrictionFalls:
    """What the four forms of the drive share: a part of the friction that falls by `fall` of itself."""

    station = Station.DRIVE
    kinds = (MOTION.name,)
    dry: ClassVar[bool] = False

    def rates(self) -> tuple[Parameter, ...]:
        return (Parameter(f"fall_1_per_{self.unit}", 0.01),)

    def describe(self) -> str:
        what = ("all friction" if self.dry else "viscous friction") + (
            f" of axis {self.joint}" if self.per_joint else "")
        return f"{what} falls by {self.values[0]:.3g} of itself per {self.unit} (it follows {self.driver})"

    def at(self, view, x) -> Change:
        axes = np.array([self.index]) if self.per_joint else np.arange(view.axes)
        torque, slope = (part[:, axes] for part in self.friction(view))
        column = -x * torque
        falls = -self.values[0] * x * slope / view.robot.controller_ratios[axes]
        by_rate = falls[:, :, None] * np.eye(view.axes)[axes]
        return Change(tuple(int(axis) for axis in axes), self.values[0] * column, column[:, :, None],
                      {"theta_dot": by_rate})

    def friction(self, view) -> tuple[np.ndarray, np.ndarray]:
        """(N, n) Nm of what falls, and its slope by the rate."""
        joints = view.robot.joints
        viscous = np.array([joint.viscous or 0.0 for joint in joints])
        rate = view.signals["theta_dot"] / view.robot.controller_ratios
        torque, slope = viscous * rate, np.broadcast_to(viscous, rate.shape)
        if not self.dry:
            return torque, slope
        coulomb = np.array([joint.coulomb or 0.0 for joint in joints])
        sign = np.column_stack([over_samples(view, index) for index in range(view.axes)])
        sign_slope = np.column_stack([sign_slopes(view, index)[0] for index in range(view.axes)])
        return torque + coulomb * sign, slope + coulomb * sign_slope

    @classmethod
    def of(cls, robot, view) -> Iterable[Effect]:
        has = [bool(joint.coulomb if cls.dry else joint.viscous) for joint in view.robot.joints]
        joints = [axis + 1 for axis in np.flatnonzero(has)] if cls.per_joint else [None] if any(has) else []
        return (cls(joint, (0.0,), driver) for driver in drivers(view.data) for joint in joints)


@dataclass(frozen=True)
class ThermalLubricant(_FrictionFalls, ThermalDrift):
    form = "lubricant"


@dataclass(frozen=True)
class ThermalLubricantOfAxis(_FrictionFalls, ThermalDrift):
    per_joint = True
    form = "lubricant_of_axis"


@dataclass(frozen=True)
class ThermalFriction(_FrictionFalls, ThermalDrift):
    dry = True
    form = "friction"


@dataclass(frozen=True)
class ThermalFrictionOfAxis(_FrictionFalls, ThermalDrift):
    dry = True
    per_joint = True
    form = "friction_of_axis"
