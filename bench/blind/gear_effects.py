"""The causes of docs/effects.md that gear runs can show, with physics of their own.

    motor    adds to the motor angle that the sensor answers to     (N, n) rad
    gear     adds to the output angle of a gear                     (N, n) rad
    spring   adds to the joint angle                                (N, n) rad
    device   adds to the gyroscope's reading                        (N, 3) rad/s
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from blind.gear_runs import GearState


@dataclass(frozen=True)
class GearCause:
    """A cause in a gear run; `size` is what a scenario scales. `joint` from 1."""

    name: str = ""
    joint: int | None = None
    size: float = 1.0
    detail: dict = field(default_factory=dict)

    foreign = False
    measures = ""  # the parameter of docs/effects.md that `size` is

    @classmethod
    def draw(cls, random, state: GearState):
        moved = np.unique(state.runs.moved)
        return cls(joint=int(moved[random.integers(len(moved))]) + 1)

    def scaled(self, size: float):
        return replace(self, size=size)

    def on_axis(self, state: GearState, shape: np.ndarray) -> np.ndarray:
        out = np.zeros_like(state.phi)
        out[:, self.joint - 1] = self.size * shape
        return out

    def of(self, state: GearState, name: str) -> np.ndarray:
        return getattr(state, name)[:, self.joint - 1]

    def motor(self, state):
        return 0.0

    def gear(self, state):
        return 0.0

    def spring(self, state):
        return 0.0

    def device(self, reading, state):
        return 0.0

    def parameters(self) -> dict[str, float]:
        """Numbers of docs/effects.md that this cause has exactly; none where it is another form of it."""
        return {self.measures: self.size} if self.measures else {}

    def truth(self) -> dict:
        own = {"effect": self.name, "joint": self.joint, "size": self.size, "foreign": self.foreign}
        return own | {"parameters": self.parameters()} | self.detail


@dataclass(frozen=True)
class Wave(GearCause):
    """A wave over the output angle: order per revolution, phase."""

    order: float = 1.0
    phase: float = 0.0

    def wave(self, state):
        return np.sin(self.order * self.of(state, "phi") + self.phase) / self.order

    @classmethod
    def draw_orders(cls, random, state: GearState, **more):
        axis = int(random.choice(np.unique(state.runs.moved)))
        ratio = abs(state.arm.motor_per_output[axis])
        order = float((ratio, 2.0 * ratio, 0.5 * ratio, random.uniform(8.0, 1.2 * ratio))[random.integers(4)])
        declared = [t.order for t in (state.arm.tables[axis] if state.arm.tables else {}).values()]
        if declared and np.abs(np.concatenate(declared) - order).min() < 2.5:
            return None
        return cls(joint=axis + 1, size=1e-3, order=order, phase=random.uniform(0, 6.28),
                   detail={"order": order}, **more)


@dataclass(frozen=True)
class GearHarmonics(Wave):
    name: str = "gear_harmonics"

    draw = classmethod(lambda cls, random, state: cls.draw_orders(random, state))

    def gear(self, state):
        return self.on_axis(state, self.wave(state))


@dataclass(frozen=True)
class DirectionDependence(Wave):
    name: str = "direction_dependence"

    draw = classmethod(lambda cls, random, state: cls.draw_orders(random, state))

    def gear(self, state):
        # The tables of both directions meet at the angle zero, as declared ones do.
        wave = self.wave(state) - np.sin(self.phase) / self.order
        return self.on_axis(state, wave * self.of(state.runs, "direction"))


@dataclass(frozen=True)
class SpeedDependence(Wave):
    """A wave that grows with the speed, as the oil film does. Wants runs at different speeds."""

    name: str = "speed_dependence"

    @classmethod
    def draw(cls, random, state):
        cause = cls.draw_orders(random, state)
        if cause is None:
            return None
        speeds = [np.abs(cause.of(state, "rate")[state.runs.run == r]).max()
                  for r in np.unique(state.runs.run)]
        return cause if max(speeds) > 1.5 * min(speeds) else None

    def gear(self, state):
        wave = self.wave(state) - np.sin(self.phase) / self.order
        return self.on_axis(state, wave * np.abs(self.of(state, "rate")))


@dataclass(frozen=True)
class LoadDependence(GearCause):
    """The gear winds up with the torque that it carries."""

    name: str = "load_dependence"
    measures = "linear_rad_per_Nm"

    @classmethod
    def draw(cls, random, state):
        cause = super().draw(random, state)
        torque = cause.of(state, "torque")
        return replace(cause, size=1e-6) if np.ptp(torque) > 1.0 else None

    def gear(self, state):
        return self.on_axis(state, -self.of(state, "torque"))


@dataclass(frozen=True)
class GearEccentricity(GearCause):
    name: str = "gear_eccentricity"
    phase: float = 0.0
    oval: float = 0.0

    @classmethod
    def draw(cls, random, state):
        return replace(super().draw(random, state), size=1e-3, phase=random.uniform(0, 6.28),
                       oval=random.choice((0.0, 0.7)))

    def gear(self, state):
        x = self.of(state, "phi")
        return self.on_axis(state, np.sin(x + self.phase) + self.oval * np.cos(2.0 * x + self.phase))

    def parameters(self):
        first = self.size * np.exp(1j * self.phase)
        return {"first_cos_rad": first.imag, "first_sin_rad": first.real} | (
            {"second_cos_rad": self.oval * first.real, "second_sin_rad": -self.oval * first.imag}
            if self.oval else {}
        )


@dataclass(frozen=True)
class GearRatio(GearCause):
    name: str = "gear_ratio"
    measures = "scale"
    size: float = 1e-3

    def gear(self, state):
        return self.on_axis(state, self.of(state, "phi"))


@dataclass(frozen=True)
class JointCoupling(GearCause):
    name: str = "joint_coupling"
    measures = "coupling_rad_per_rad"
    motor_axis: int = 1

    @classmethod
    def draw(cls, random, state):
        moving = np.flatnonzero(np.ptp(state.phi, axis=0) > 0.1)
        turned = [a for a in state.runs.encoder_axes if a in moving]
        if len(moving) < 2 or not turned:
            return None
        joint = int(turned[random.integers(len(turned))])
        motor = int(random.choice([m for m in moving if m != joint]))
        return cls(joint=joint + 1, size=1e-3, motor_axis=motor + 1, detail={"motor": motor + 1})

    def gear(self, state):
        return self.on_axis(state,
                            state.theta[:, self.motor_axis - 1]
                            / state.arm.motor_per_output[self.motor_axis - 1])


@dataclass(frozen=True)
class Backlash(GearCause):
    """Loaded flank: the sign of gravity's torque plus friction against the motion, through a narrow
    transition."""

    name: str = "backlash"
    measures = "width_rad"
    friction: float = 1.0

    @classmethod
    def draw(cls, random, state):
        cause = super().draw(random, state)
        torque = cause.of(state, "torque")
        if not state.runs.encoder_axes or not 0.1 < np.mean(torque > 0) < 0.9 or np.ptp(torque) < 1.0:
            return None
        return replace(cause, size=3e-4, friction=random.uniform(0.02, 0.2) * np.abs(torque).max())

    def spring(self, state):
        pressed = self.of(state, "torque") + self.friction * np.tanh(self.of(state, "rate") / 0.01)
        return self.on_axis(state, -0.5 * np.tanh(pressed / (0.1 * self.friction)))


@dataclass(frozen=True)
class Hysteresis(GearCause):
    """Friction inside the drive: a spring of a given reach that slips (forward Euler of a stick-slip
    element)."""

    name: str = "hysteresis"
    reach: float = 1e-3

    @classmethod
    def draw(cls, random, state):
        if not state.runs.encoder_axes:
            return None
        return replace(super().draw(random, state), size=2e-4,
                       reach=float(np.exp(random.uniform(np.log(1e-3), np.log(5e-2)))))

    def spring(self, state):
        x, out = self.of(state,
                         "theta") / state.arm.motor_per_output[self.joint - 1], np.zeros(len(state.theta))
        for number in np.unique(state.runs.run):
            rows = np.flatnonzero(state.runs.run == number)
            z = 0.0
            for row, move in zip(rows[1:], np.diff(x[rows])):
                z = min(max(z + move, -self.reach), self.reach)
                out[row] = z / self.reach
        return self.on_axis(state, -out)

    def parameters(self):
        return {"size_rad": self.size, "reach_rad": self.reach}


@dataclass(frozen=True)
class TimeDelay(GearCause):
    name: str = "time_delay"
    measures = "delay_s"
    size: float = 1e-3

    @classmethod
    def draw(cls, random, state):
        return cls()

    def motor(self, state):
        out = np.zeros_like(state.theta)
        for number in np.unique(state.runs.run):
            rows = np.flatnonzero(state.runs.run == number)
            time = state.runs.time[rows]
            for i in np.flatnonzero(np.ptp(state.theta[rows], axis=0) > 0):
                out[rows, i] = np.interp(time - self.size, time, state.theta[rows, i]) - state.theta[rows, i]
        return out


@dataclass(frozen=True)
class GyroCause(GearCause):
    vector: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @classmethod
    def draw(cls, random, state):
        if state.runs.encoder_axes:
            return None
        v = random.normal(size=3)
        return cls(vector=tuple(v / np.linalg.norm(v)))


@dataclass(frozen=True)
class GyroScale(GyroCause):
    name: str = "gyro_scale"
    measures = "scale"
    size: float = 1e-3

    def device(self, reading, state):
        return self.size * reading


@dataclass(frozen=True)
class GyroBias(GyroCause):
    name: str = "gyro_bias"
    size: float = 1e-3

    def device(self, reading, state):
        return self.size * np.array(self.vector)


@dataclass(frozen=True)
class GyroGSensitivity(GyroCause):
    name: str = "gyro_g_sensitivity"
    size: float = 1e-3

    @classmethod
    def draw(cls, random, state):
        cause = super().draw(random, state)
        turning = cause is not None and np.ptp(state.torque[:, state.runs.moved[0]]) > 1.0
        return cause if turning else None

    def device(self, reading, state):
        out = np.zeros_like(reading)
        out[:, 2] = self.size * (state.force @ np.array(self.vector))
        return out


@dataclass(frozen=True)
class GyroMisalignment(GyroCause):
    """The mount slips: from one run on the sensor is tilted more."""

    name: str = "gyro_misalignment"
    size: float = 0.02
    share: float = 0.5

    def device(self, reading, state):
        numbers = np.unique(state.runs.run)
        later = state.runs.run >= numbers[len(numbers) // 2]
        turned = np.cross(np.array([self.vector[0], self.vector[1], 0.0]), reading)
        return self.size * later[:, None] * turned


@dataclass(frozen=True)
class ThermalDrift(GyroCause):
    """The bias of the gyroscope follows the temperature."""

    name: str = "thermal_drift"
    size: float = 1e-4

    def device(self, reading, state):
        return self.size * (state.runs.temperature - 20.0)[:, None] * np.array(self.vector)


@dataclass(frozen=True)
class HeatedGear(GearCause):
    """Foreign: the gear's wave grows and fades with time within each run, as no speed or load does."""

    name: str = "beating_wave"
    foreign = True

    def gear(self, state):
        x = self.of(state, "phi")
        return self.on_axis(state,
                            np.sin(23.0 * x + 5.0 * np.sin(2.0 * np.pi * 1.7 * state.runs.time)) / 23.0)


@dataclass(frozen=True)
class FloorVibration(GyroCause):
    """Foreign: a machine nearby shakes the floor at its own frequency."""

    name: str = "floor_vibration"
    size: float = 1e-3
    foreign = True

    def device(self, reading, state):
        return self.size * np.sin(2.0 * np.pi * 7.3 * state.runs.time)[:, None] * np.array(self.vector)


GEAR_EFFECTS = (
    GearHarmonics, DirectionDependence, SpeedDependence, LoadDependence, GearEccentricity, GearRatio,
    JointCoupling,
    Backlash, Hysteresis, TimeDelay, GyroScale, GyroBias, GyroGSensitivity, GyroMisalignment, ThermalDrift,
)
GEAR_FOREIGN = (HeatedGear, FloorVibration)
