"""The causes of docs/effects.md that motion data can show, with physics of their own.

    links    changes masses                torque   adds to the drive torque, output side (N, n) Nm
    gear     adds to the output angle      record   changes what is written down
    carried  what virtual work makes of it at the motors (N, n) Nm
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from blind.arm import posture
from blind.motion import SMOOTH_RAD_S, slope


@dataclass(frozen=True)
class MotionCause:
    """A cause in a motion; `size` is what a scenario scales. `joint` from 1."""

    name: str = ""
    joint: int | None = None
    size: float = 1.0
    detail: dict = field(default_factory=dict)
    largest: float = np.inf  # size that would still be plausible

    foreign = False
    measures = ""  # the parameter of docs/effects.md that `size` is

    @classmethod
    def draw(cls, random, arm, drive, played):
        return cls(joint=int(random.integers(arm.axes)) + 1)

    def scaled(self, size: float):
        return replace(self, size=size)

    def on_axis(self, drive, shape):
        out = np.zeros_like(drive.q)
        out[:, self.joint - 1] = self.size * shape
        return out

    def of(self, values):
        return values[:, self.joint - 1]

    def links(self, arm):
        return arm

    def torque(self, arm, drive, played):
        return 0.0

    def gear(self, arm, drive, phi):
        return 0.0

    def carried(self, arm, drive, phi, link):
        return 0.0

    def record(self, tau, drive):
        return tau

    def parameters(self) -> dict[str, float]:
        """Numbers of docs/effects.md that this cause has exactly; none where it is another form of it."""
        return {self.measures: self.size} if self.measures else {}

    def truth(self) -> dict:
        own = {"effect": self.name, "joint": self.joint, "size": self.size, "foreign": self.foreign}
        return own | {"parameters": self.parameters()} | self.detail


@dataclass(frozen=True)
class Stribeck(MotionCause):
    name: str = "stribeck_friction"
    fades: float = 0.05

    @classmethod
    def draw(cls, random, arm, drive, played):
        return replace(super().draw(random, arm, drive, played),
                       fades=float(np.exp(random.uniform(np.log(0.02), np.log(0.2)))))

    def torque(self, arm, drive, played):
        v = self.of(drive.rate)
        return self.on_axis(drive, np.tanh(v / SMOOTH_RAD_S) * np.exp(-((v / self.fades) ** 2)))

    def parameters(self):
        return {"breakaway_Nm": self.size, "velocity_rad_s": self.fades}


@dataclass(frozen=True)
class Asymmetric(MotionCause):
    """More friction one way than the other."""

    name: str = "asymmetric_friction"

    def torque(self, arm, drive, played):
        v = self.of(drive.rate)
        return self.on_axis(drive, np.tanh(v / SMOOTH_RAD_S) ** 2 + 0.3 * np.abs(v))

    def parameters(self):
        return {"coulomb_Nm": self.size, "viscous_Nm_s": 0.3 * self.size}


@dataclass(frozen=True)
class LoadFriction(MotionCause):
    name: str = "load_friction"
    measures = "coefficient"

    @classmethod
    def draw(cls, random, arm, drive, played):
        cause = replace(super().draw(random, arm, drive, played), largest=0.6)
        return cause if np.abs(cause.of(played.link)).std() > 1.0 else None

    def torque(self, arm, drive, played):
        return self.on_axis(drive, np.tanh(self.of(drive.rate) / SMOOTH_RAD_S) * np.abs(self.of(played.link)))


@dataclass(frozen=True)
class TorqueRipple(MotionCause):
    """Cogging: an order of the motor's own angle."""

    name: str = "torque_ripple"
    order: float = 6.0
    phase: float = 0.0

    @classmethod
    def draw(cls, random, arm, drive, played):
        order = float(random.choice((1.0, 2.0, 6.0)))
        return replace(super().draw(random, arm, drive, played), order=order, phase=random.uniform(0, 6.28),
                       detail={"order": order})

    def torque(self, arm, drive, played):
        return self.on_axis(drive, np.sin(self.order * self.of(played.theta) + self.phase))


@dataclass(frozen=True)
class TorqueConstant(MotionCause):
    name: str = "torque_constant"
    measures = "scale"

    def record(self, tau, drive):
        out = tau.copy()
        out[:, self.joint - 1] *= 1.0 + self.size
        return out


@dataclass(frozen=True)
class RotorInertia(MotionCause):
    name: str = "rotor_inertia"

    def torque(self, arm, drive, played):
        return self.on_axis(drive, self.of(drive.acceleration))


@dataclass(frozen=True)
class GravityCompensator(MotionCause):
    """A spring cylinder beside an axis: pulls with the sine of the angle from its dead centre."""

    name: str = "gravity_compensator"
    centre: float = 0.0

    @classmethod
    def draw(cls, random, arm, drive, played):
        if arm.mass is None:
            return None
        return cls(joint=int(random.integers(2, 4)), size=10.0, centre=random.uniform(-1.0, 1.0))

    def torque(self, arm, drive, played):
        return self.on_axis(drive, -np.sin(self.of(drive.q) - self.centre))

    def parameters(self):
        return {"cosine_Nm": -self.size * np.sin(self.centre), "sine_Nm": self.size * np.cos(self.centre)}


@dataclass(frozen=True)
class Payload(MotionCause):
    name: str = "payload"
    measures = "mass_kg"
    centre: tuple[float, float, float] = (0.0, 0.0, 0.05)

    @classmethod
    def draw(cls, random, arm, drive, played):
        return cls(size=2.0, centre=tuple(random.uniform((-0.05, -0.05, 0.0), (0.05, 0.05, 0.15))))

    def links(self, arm):
        mass, centre, inertia = arm.mass.copy(), arm.centre.copy(), arm.inertia.copy()
        total = mass[-1] + self.size
        new = (mass[-1] * centre[-1] + self.size * np.array(self.centre)) / total
        for m, c in ((mass[-1], centre[-1] - new), (self.size, np.array(self.centre) - new)):
            inertia[-1] = inertia[-1] + m * (c @ c * np.eye(3) - np.outer(c, c))
        mass[-1], centre[-1] = total, new
        return arm.with_values(mass=mass, centre=centre, inertia=inertia)


@dataclass(frozen=True)
class GearRatio(MotionCause):
    """The output turns 1 + size times as far as declared, and carries so much more at the motor."""

    name: str = "gear_ratio"
    measures = "scale"
    size: float = 1e-3
    largest: float = 0.05

    def gear(self, arm, drive, phi):
        return self.on_axis(drive, self.of(phi) / (1.0 + self.size))

    def carried(self, arm, drive, phi, link):
        return self.on_axis(drive, self.of(link))


@dataclass(frozen=True)
class JointCoupling(MotionCause):
    """The motor of another axis turns this one; so it is loaded by it."""

    name: str = "joint_coupling"
    measures = "coupling_rad_per_rad"
    motor_axis: int = 1
    size: float = 1e-2
    largest: float = 1.0

    @classmethod
    def draw(cls, random, arm, drive, played):
        joint, motor = (int(k) + 1 for k in random.permutation(arm.axes)[:2])
        return cls(joint=joint, motor_axis=motor, detail={"motor": motor})

    def gear(self, arm, drive, phi):
        return self.on_axis(drive, phi[:, self.motor_axis - 1])

    def carried(self, arm, drive, phi, link):
        out = np.zeros_like(link)
        out[:, self.motor_axis - 1] = self.size * self.of(link)
        return out


@dataclass(frozen=True)
class GearWave(MotionCause):
    """The error of the gear: a wave of the output angle. size: of the ratio."""

    order: float = 1.0
    phase: float = 0.0
    size: float = 1e-3

    def gear(self, arm, drive, phi):
        return self.on_axis(drive, np.sin(self.order * self.of(phi) + self.phase) / self.order)

    def carried(self, arm, drive, phi, link):
        swing = self.size * np.cos(self.order * self.of(phi) + self.phase)
        return self.on_axis(drive, self.of(link) * swing / (1.0 - swing) / self.size)


@dataclass(frozen=True)
class GearHarmonics(GearWave):
    name: str = "gear_harmonics"
    largest: float = 0.01

    @classmethod
    def draw(cls, random, arm, drive, played):
        cause = super().draw(random, arm, drive, played)
        order = abs(arm.motor_per_output[cause.joint - 1]) * float(random.choice((1.0, 2.0)))
        if order * np.abs(cause.of(drive.rate)).max() > 2.0 * np.pi * 15.0:  # beyond any drive's bandwidth
            return None
        return replace(cause, order=order, phase=random.uniform(0, 6.28), detail={"order": order})


@dataclass(frozen=True)
class GearEccentricity(GearWave):
    name: str = "gear_eccentricity"
    largest: float = 0.02

    @classmethod
    def draw(cls, random, arm, drive, played):
        return replace(super().draw(random, arm, drive, played), phase=random.uniform(0, 6.28))


@dataclass(frozen=True)
class MotorLinkCoupling(MotionCause):
    """Spinning rotors on moving links: the rate of their momentum loads the links, the links' turn loads the
    rotors."""

    name: str = "motor_link_coupling"
    measures = "share"
    largest: float = 1.5

    @classmethod
    def draw(cls, random, arm, drive, played):
        return cls() if np.any(arm.rotor) else None

    def torque(self, arm, drive, played):
        at = posture(arm, drive.q)
        out, omega = np.zeros_like(drive.q), np.zeros((len(drive.q), 3))
        for i in range(arm.axes):
            axis = at.axis[:, i]
            spin = arm.rotor[i] * arm.motor_per_output[i]
            out[:, i] += spin * slope(np.sum(axis * omega, axis=1), drive)
            moment = slope(spin * drive.rate[:, i : i + 1] * axis, drive)
            for j in range(i):
                out[:, j] += np.sum(at.axis[:, j] * moment, axis=1)
            omega = omega + axis * drive.rate[:, i : i + 1]
        return self.size * out


@dataclass(frozen=True)
class ThermalDrift(MotionCause):
    """The lubricant thins out as it warms up: all friction falls with the temperature."""

    name: str = "thermal_drift"
    size: float = 0.01
    largest: float = 0.06
    dry: bool = False

    @classmethod
    def draw(cls, random, arm, drive, played):
        return cls(dry=bool(random.random() < 0.5))

    def torque(self, arm, drive, played):
        friction = arm.viscous * drive.rate + self.dry * arm.coulomb * np.tanh(drive.rate / SMOOTH_RAD_S)
        return -self.size * (drive.temperature - 25.0)[:, None] * friction


@dataclass(frozen=True)
class TimeDelay(MotionCause):
    name: str = "time_delay"
    measures = "delay_s"
    size: float = 1e-3

    @classmethod
    def draw(cls, random, arm, drive, played):
        return cls()

    def record(self, tau, drive):
        out = tau.copy()
        for number in np.unique(drive.run):
            rows = np.flatnonzero(drive.run == number)
            for i in range(tau.shape[1]):
                out[rows, i] = np.interp(drive.time[rows] - self.size, drive.time[rows], tau[rows, i])
        return out


@dataclass(frozen=True)
class FloorShock(MotionCause):
    """Foreign: a torque that follows the time and nothing else."""

    name: str = "machine_nearby"
    foreign = True

    def torque(self, arm, drive, played):
        return self.on_axis(drive,
                            np.sin(2.0 * np.pi * 3.3 * drive.time)
                            * (1.0 + 0.5 * np.sin(2.0 * np.pi * 0.21 * drive.time)))


@dataclass(frozen=True)
class CableBundle(MotionCause):
    """Foreign: cables wind up with two axes at once."""

    name: str = "cable_bundle"
    foreign = True

    def torque(self, arm, drive, played):
        return self.on_axis(drive, drive.q[:, -1] * drive.q[:, -2] ** 2)


MOTION_EFFECTS = (
    Stribeck, Asymmetric, LoadFriction, TorqueRipple, TorqueConstant, RotorInertia, GravityCompensator,
    Payload, TimeDelay,
    GearRatio, JointCoupling, GearHarmonics, GearEccentricity, MotorLinkCoupling, ThermalDrift,
)
MOTION_FOREIGN = (FloorShock, CableBundle)
