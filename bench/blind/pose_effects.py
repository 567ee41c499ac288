"""The causes of docs/effects.md that static poses can show, with physics of their own.

Each class draws itself for a setting (`draw`, None where it cannot act there) and enters where `hidden` says.
`unit_size` is a first size; a scenario scales it to what it wants to see.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from blind.arm import weight_moment
from blind.device_effects import Outliers, TrackerDrift, TrackerScale, TrackerStep
from blind.hidden import Hidden, Setting


def pick(random: np.random.Generator, values) -> int | None:
    values = list(values)
    return int(values[random.integers(len(values))]) if values else None


@dataclass(frozen=True)
class Backlash(Hidden):
    """The link hangs on the flank that the load presses; Coulomb friction holds the other one at small
    loads."""

    name: str = "backlash"
    measures = "width_rad"
    friction: float = 0.0

    @classmethod
    def draw(cls, random, setting: Setting):
        both = [i for i in setting.loaded_axes() if 0.2 < np.mean(setting.torque[:, i] > 0) < 0.8]
        i = pick(random, both)
        if i is None:
            return None
        friction = random.uniform(0.0, 0.03) * np.abs(setting.torque[:, i]).max()
        return cls(joint=i + 1, size=3e-4, friction=friction)

    def spring(self, arm, q, torque, rows):
        pressed = torque[:, self.index] + self.friction * rows.direction[:, self.index]
        edge = 1e-3 * np.abs(torque[:, self.index]).max() + 1e-9
        return self.at_joint(-0.5 * np.clip(pressed / edge, -1.0, 1.0), arm.axes)


@dataclass(frozen=True)
class JointCompliance(Hidden):
    """A drive train that gives way, in one case out of three the less the more it carries."""

    name: str = "joint_compliance"
    hardening: float = 0.0
    reference: float = 1.0

    @classmethod
    def draw(cls, random, setting: Setting):
        i = pick(random, setting.loaded_axes())
        if i is None:
            return None
        hardening = random.uniform(0.2, 0.8) if random.random() < 0.33 else 0.0
        return cls(joint=i + 1, size=3e-6, hardening=hardening, reference=np.abs(setting.torque[:, i]).max(),
                   detail={"hardening": hardening})

    def spring(self, arm, q, torque, rows):
        load = torque[:, self.index]
        return self.at_joint(-load / (1.0 + self.hardening * (load / self.reference) ** 2), arm.axes)

    def parameters(self):
        return {} if self.hardening else {"linear_rad_per_Nm": self.size}


@dataclass(frozen=True)
class LinkCompliance(Hidden):
    """A bearing that tilts, or a link that bends, across its axis under the weight beyond it."""

    name: str = "link_compliance"
    measures = "rad_per_Nm"

    @classmethod
    def draw(cls, random, setting: Setting):
        if setting.arm.mass is None:
            return None
        return cls(joint=pick(random, range(2, max(3, setting.arm.axes - 1))), size=1e-6)

    def structure(self, arm, at, target, rows):
        moment = weight_moment(arm, at, self.index)
        axis = at.axis[:, self.index]
        turned = self.size * np.cross(axis, np.cross(moment, axis))
        return np.cross(turned, target - at.origin[:, self.index]), turned


@dataclass(frozen=True)
class BaseCompliance(Hidden):
    """A foundation that tilts about both horizontal axes under the overturning moment."""

    name: str = "base_compliance"
    measures = "rad_per_Nm"

    @classmethod
    def draw(cls, random, setting: Setting):
        return None if setting.arm.mass is None else cls(size=1e-6)

    def structure(self, arm, at, target, rows):
        turned = self.size * weight_moment(arm, at, 0) * np.array([1.0, 1.0, 0.0])
        return np.cross(turned, target), turned


@dataclass(frozen=True)
class GearEccentricity(Hidden):
    """Run-out of the output wheel: once per revolution, and in half of the cases oval too."""

    name: str = "gear_eccentricity"
    phase: tuple[float, float] = (0.0, 0.0)
    oval: float = 0.0

    @classmethod
    def draw(cls, random, setting: Setting):
        oval = random.uniform(0.3, 1.5) if random.random() < 0.5 else 0.0
        return cls(joint=pick(random, range(1, setting.arm.axes + 1)), size=3e-4, oval=oval,
                   phase=tuple(random.uniform(0, 2 * np.pi, 2)), detail={"oval": oval})

    def gear(self, arm, phi, rows):
        x = phi[:, self.index]
        return self.at_joint(np.sin(x + self.phase[0]) + self.oval * np.sin(2.0 * x + self.phase[1]),
                             arm.axes)

    def parameters(self):
        first, second = self.size * np.exp(1j * self.phase[0]), self.size * self.oval * np.exp(
            1j * self.phase[1]
        )
        return {"first_cos_rad": first.imag, "first_sin_rad": first.real} | (
            {"second_cos_rad": second.imag, "second_sin_rad": second.real} if self.oval else {}
        )


@dataclass(frozen=True)
class GearHarmonics(Hidden):
    """A wheel inside the gear or the encoder: an order of 3 and more per output revolution, or that of the
    motor; at times with its first overtone."""

    name: str = "gear_harmonics"
    order: float = 3.0
    phase: float = 0.0
    overtone: float = 0.0

    @classmethod
    def draw(cls, random, setting: Setting):
        i = pick(random, range(setting.arm.axes))
        ratio = abs(setting.arm.ratio[i]) if setting.arm.has_gear[i] else np.nan
        if np.isfinite(ratio) and random.random() < 0.4:
            order = float(ratio * pick(random, (1, 2)))
        else:
            order = float(random.integers(3, 2 * int(ratio if np.isfinite(ratio) else 100)))
        declared = [table.order for table in setting.arm.tables[i].values()] if setting.arm.tables else []
        if declared and np.abs(np.concatenate(declared) - order).min() < 1.5:
            return None
        return cls(joint=i + 1, size=2e-4, order=order, phase=random.uniform(0, 2 * np.pi),
                   detail={"order": order},
                   overtone=random.uniform(0.3, 0.8) if random.random() < 0.35 else 0.0)

    def gear(self, arm, phi, rows):
        x = self.order * phi[:, self.index]
        return self.at_joint(np.cos(x + self.phase) + self.overtone * np.cos(2.0 * x - self.phase), arm.axes)


@dataclass(frozen=True)
class DirectionDependence(Hidden):
    """A gear error that has another sign in the other direction of motion; nought at angle 0, as both tables
    are."""

    name: str = "direction_dependence"
    order: float = 3.0
    phase: float = 0.0

    @classmethod
    def draw(cls, random, setting: Setting):
        if "approach" not in setting.rows.has:
            return None
        i = pick(random, range(setting.arm.axes))
        orders = [o for table in (setting.arm.tables[i] if setting.arm.tables else {}).values()
                  for o in table.order]
        order = float(orders[random.integers(len(orders))]) if orders else float(random.integers(3, 100))
        return cls(joint=i + 1, size=3e-4, order=order, phase=random.uniform(0, 2 * np.pi),
                   detail={"order": order})

    def gear(self, arm, phi, rows):
        wave = np.cos(self.order * phi[:, self.index] + self.phase) - np.cos(self.phase)
        return self.at_joint(wave * rows.direction[:, self.index], arm.axes)


@dataclass(frozen=True)
class GearRatio(Hidden):
    """A ratio other than declared, on an axis whose ratio the declared model does not re-identify."""

    name: str = "gear_ratio"
    measures = "scale"

    @classmethod
    def draw(cls, random, setting: Setting):
        tables = setting.arm.tables or ({},) * setting.arm.axes
        free = [i for i in range(setting.arm.axes) if not setting.arm.has_gear[i] or tables[i]]
        i = pick(random, free)
        return None if i is None else cls(joint=i + 1, size=3e-4)

    def gear(self, arm, phi, rows):
        return self.at_joint(phi[:, self.index], arm.axes)


@dataclass(frozen=True)
class JointCoupling(Hidden):
    """The motor of another axis turns this one along, mostly in the wrist."""

    name: str = "joint_coupling"
    measures = "coupling_rad_per_rad"
    motor: int = 1

    @classmethod
    def draw(cls, random, setting: Setting):
        n = setting.arm.axes
        if random.random() < 0.7:
            turned, motor = ((n - 1, n - 2), (n, n - 1), (n, n - 2))[random.integers(3)]
        else:
            turned, motor = (int(v) + 1 for v in random.permutation(n)[:2])
        return cls(joint=turned, size=1e-3, motor=motor, detail={"motor": motor})

    def gear(self, arm, phi, rows):
        motor = rows.command[:, self.motor - 1] / arm.motor_per_output[self.motor - 1]
        return self.at_joint(motor, arm.axes)


@dataclass(frozen=True)
class Hysteresis(Hidden):
    """A drive that stops short of where its friction lets go, in the direction from which it came."""

    name: str = "hysteresis"
    measures = "size_rad"

    @classmethod
    def draw(cls, random, setting: Setting):
        if "approach" not in setting.rows.has:
            return None
        return cls(joint=pick(random, range(1, setting.arm.axes + 1)), size=2e-4)

    def spring(self, arm, q, torque, rows):
        return self.at_joint(-rows.direction[:, self.index], arm.axes)


@dataclass(frozen=True)
class Payload(Hidden):
    """A body at the flange that is not in the file; it shows where springs are declared. size: its mass."""

    name: str = "payload"
    measures = "mass_kg"
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def draw(cls, random, setting: Setting):
        if setting.arm.mass is None or not np.any(setting.arm.linear):
            return None
        centre = tuple(random.uniform((-0.08, -0.08, 0.0), (0.08, 0.08, 0.2)))
        return cls(size=5.0, centre=centre, detail={"centre_m": list(centre)})

    def links(self, arm):
        mass, centre = arm.mass.copy(), arm.centre.copy()
        total = mass[-1] + self.size
        centre[-1] = (mass[-1] * centre[-1] + self.size * np.array(self.centre)) / total
        mass[-1] = total
        return arm.with_values(mass=mass, centre=centre)


@dataclass(frozen=True)
class ThermalGrowth(Hidden):
    """All lengths of the arm grow with the temperature, or while it runs where none is measured."""

    name: str = "thermal_drift"

    @classmethod
    def draw(cls, random, setting: Setting):
        rows = setting.rows
        if not {"temperature", "time"} & rows.has:
            return None
        return cls(size=2e-5, detail={"form": "growth"})

    def stretch(self, rows):
        driver = rows.temperature - 20.0 if "temperature" in rows.has else rows.time / 3600.0
        return 1.0 + self.size * driver


@dataclass(frozen=True)
class ThermalShift(Hidden):
    """The foundation or the tool moves off in one direction as the temperature changes."""

    name: str = "thermal_drift"
    way: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @classmethod
    def draw(cls, random, setting: Setting):
        if "temperature" not in setting.rows.has:
            return None
        way = random.normal(size=3)
        return cls(size=2e-5, way=tuple(way / np.linalg.norm(way)), detail={"form": "target"})

    def device(self, measured, rows):
        return self.size * (rows.temperature - 20.0)[:, None] * np.array(self.way)


@dataclass(frozen=True)
class ThermalZero(Hidden):
    """The zero of one axis moves with the temperature."""

    name: str = "thermal_drift"

    @classmethod
    def draw(cls, random, setting: Setting):
        if "temperature" not in setting.rows.has:
            return None
        return cls(joint=pick(random, range(1, setting.arm.axes)), size=2e-5, detail={"form": "zero"})

    def spring(self, arm, q, torque, rows):
        return self.at_joint(rows.temperature - 20.0, arm.axes)


POSE_EFFECTS = (
    Backlash, JointCompliance, LinkCompliance, BaseCompliance, GearEccentricity, GearHarmonics,
    DirectionDependence,
    GearRatio, JointCoupling, Hysteresis, Payload, ThermalGrowth, ThermalShift, ThermalZero, TrackerScale,
    TrackerDrift, TrackerStep, Outliers,
)
