"""Gravity sensors on the flange: an inclinometer or an accelerometer at rest, read in many poses.

    v = R_s R' u                    u (3,): up in the base frame, tilted from the declared one by two angles
    w = v + C v                       C (3, 3) strictly lower triangular: axes that are not at right angles
    tilt    (1 + s_k) asin(w_k) + b_k     k = x, y: angle of the sensor's axis above the horizon, rad
    accel   (1 + s_k) w_k + b_k / g        k = x, y, z: specific force in units of g; at rest it points up

R (3, 3): orientation of the target in the base frame, R_s: of the sensor on it (mounting); s: gain, b: zero
or bias. Numbers are angles: an error of 1 mrad is 1 mm at a lever of 1 m. Unknown of each session: mounting
(3), tilt of the base (2), gain and zero of each axis, sensitivity across the axes (1 or 3: what is left once
the mounting has taken its turn), all but the first with a prior. Gravity's direction shows no length, nor a
turn about the vertical. Limits: no curved response; no tilt beyond some 87 degrees, where the arc sine has
no slope. Source: IEEE Std 1293 (accelerometers).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from exactarm.effects.base import Parameter
from exactarm.errors import InputError
from exactarm.measurement.contact import Contact
from exactarm.numerics.factors import lstsq, svd
from exactarm.numerics.rotation import exp, left_jacobian, nearest, skew
from exactarm.robot.robot import GRAVITY_M_S2

GAIN = 0.05  # standard deviation before any data; data sheets of cheap sensors: 3 to 5 %
BIAS_M_S2, ZERO_RAD = 0.5, 0.05  # the same: 50 mg, 3 degrees
CROSS = 0.02  # sensitivity across the axes, the same: 1 to 2 %
BASE_TILT_RAD = 0.2  # beside the robot file's gravity, which says how the arm is mounted
_STEEPEST = 1.0 - 1.5e-3  # sine of 87 degrees: beyond it the reading of a tilt has no slope
_ANOTHER_UNIT = float(np.log(1.5))  # eight standard deviations of a gain
_MIRRORED = 0.3  # a mirrored sensor must leave less than this share of the best rotation's error

_Values = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class GravitySensor(Contact):
    """One sensor of one session; `reference` (3, 3): the mounting that its rotation vector counts from."""

    reference: tuple[tuple[float, ...], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    zero: ClassVar[tuple[str, float]] = ("", 0.0)  # name with {} for the axis, prior

    @property
    def title(self) -> str:
        return f"{type(self).__name__.lower()} of session {self.session}"

    def parameter_label(self, parameter: Parameter) -> str:
        return f"session_{self.session}.{self.contact}_{parameter.name}"

    def parameters(self) -> tuple[Parameter, ...]:
        axes, (name, prior) = "xyz"[: self.numbers], self.zero
        return (
            *(Parameter(f"mount_{axis}_rad", np.pi) for axis in "xyz"),
            *(Parameter(f"base_tilt_{axis}_rad", np.pi, prior=BASE_TILT_RAD) for axis in "uv"),
            *(Parameter(f"gain_{axis}", 1.0, lower=-0.9, prior=GAIN) for axis in axes),
            *(Parameter(name.format(axis), 10.0, prior=prior) for axis in axes),
            *(Parameter(f"cross_{axes[k]}{axes[j]}", 0.5, prior=CROSS) for k, j in self._crossed()),
        )

    @classmethod
    def _crossed(cls) -> list[tuple[int, int]]:
        """(k, j): the sensor's axis k feels what points along j."""
        return [(k, j) for k in range(cls.numbers) for j in range(k)]

    @classmethod
    def size(cls) -> int:
        """How many parameters there are."""
        return 5 + 2 * cls.numbers + len(cls._crossed())

    def started(self, view, at):
        zeros = np.zeros(self.size())
        up = self.with_values(zeros).direction(view, at)[0]
        reference = self._mounted(up, self.reading(view.data, at), view.data)
        rows = tuple(tuple(map(float, row)) for row in reference)
        return replace(self.with_values(zeros), reference=rows)

    def _mounted(self, up: np.ndarray, reading: np.ndarray, data) -> np.ndarray:
        """(3, 3) mounting that turns `up` (K, 3) in the target's axes into the readings."""
        raise NotImplementedError

    def _scaled(self, v: np.ndarray) -> _Values:
        """(K, c) what a perfect sensor reads, and its derivative by v (K, c, 3)."""
        raise NotImplementedError

    def direction(self, view, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Up in the sensor's axes (K, 3), by a turn of the target (K, 3, 3), by mounting and base tilt
        (K, 3, 5)."""
        values = np.asarray(self.values)
        turned, mount = values[:3], exp(values[:3]) @ np.asarray(self.reference)
        declared = -np.asarray(view.robot.gravity) / np.linalg.norm(view.robot.gravity)
        level = svd(declared[None])[2][1:]  # (2, 3) axes of the base's tilt
        leaning = values[3:5] @ level
        up = exp(leaning) @ declared
        base = view.signals["base_rotation"][at].reshape(-1, 3, 3)
        target = view.signals["target_rotation"][at].reshape(-1, 3, 3)
        target = exp(view.signals["displacement"][at, 3:]) @ target
        to_sensor = mount @ np.swapaxes(target, -1, -2)
        seen = base @ up
        v = np.einsum("kij,kj->ki", to_sensor, seen)
        by_mount = -skew(v) @ left_jacobian(turned)
        by_tilt = to_sensor @ base @ (-skew(up) @ left_jacobian(leaning) @ level.T)
        return v, to_sensor @ skew(seen), np.concatenate([by_mount, by_tilt], axis=2)

    def numbers_at(self, view, at):
        c = self.numbers
        v, by_turn, by_frame = self.direction(view, at)
        gain, zero, cross = np.split(np.asarray(self.values[5:]), [c, 2 * c])
        skewed = np.eye(3)
        for (k, j), value in zip(self._crossed(), cross):
            skewed[k, j] = value
        perfect, by_felt = self._scaled(v @ skewed.T)
        by_felt = (1.0 + gain)[:, None] * by_felt
        by_v = by_felt @ skewed
        own = np.zeros((len(at), c, 2 * c + len(cross)))
        own[:, range(c), range(c)] = perfect
        own[:, range(c), range(c, 2 * c)] = self._unit
        for place, (k, j) in enumerate(self._crossed(), 2 * c):
            own[:, :, place] = by_felt[:, :, k] * v[:, j, None]
        turn = by_v @ by_turn
        by_target = np.concatenate([np.zeros_like(turn), turn], axis=2)
        numbers = (1.0 + gain) * perfect + zero * self._unit
        return numbers, by_target, np.concatenate([by_v @ by_frame, own], axis=2)

    @property
    def _unit(self) -> float:
        """Of the zero or bias, in numbers."""
        return 1.0


@dataclass(frozen=True)
class Inclinometer(GravitySensor):
    """Two axes, each read as its angle above the horizon."""

    contact: ClassVar[str] = "tilt"
    numbers: ClassVar[int] = 2
    zero: ClassVar[tuple[str, float]] = ("zero_{}_rad", ZERO_RAD)

    def reading(self, data, at):
        return np.zeros((len(at), 2)) if data.tilt is None else data.tilt[at]

    def _scaled(self, v):
        sine = np.clip(v[:, :2], -_STEEPEST, _STEEPEST)
        by_v = np.zeros((len(v), 2, 3))
        by_v[:, range(2), range(2)] = 1.0 / np.sqrt(1.0 - sine**2)
        return np.arcsin(sine) + (v[:, :2] - sine) * by_v[:, range(2), range(2)], by_v

    def _mounted(self, up, reading, data):
        """Of an arm that turns about the vertical alone `up` is one direction, which says nothing of two
        axes: then one of the mountings whose third axis points up, or down, throughout."""
        level = np.sin(reading)
        u, _, vt = svd(lstsq(up, level, rcond=None)[0].T, full_matrices=False)
        x, y = u @ vt
        third = np.sqrt(np.maximum(1.0 - np.sum(level**2, axis=1, keepdims=True), 0.0))
        found = [np.stack([x, y, np.cross(x, y)])]
        found += [nearest(np.hstack([level, sign * third]).T @ up) for sign in (1.0, -1.0)]
        return min(found, key=lambda mounting: float(np.linalg.norm(level - up @ mounting[:2].T)))


@dataclass(frozen=True)
class Accelerometer(GravitySensor):
    """Three axes, read as specific force in m/s^2 and compared in units of g."""

    contact: ClassVar[str] = "accel"
    numbers: ClassVar[int] = 3
    zero: ClassVar[tuple[str, float]] = ("bias_{}_m_s2", BIAS_M_S2)

    def reading(self, data, at):
        return np.zeros((len(at), 3)) if data.accel is None else data.accel[at] / GRAVITY_M_S2

    def _scaled(self, v):
        return v, np.tile(np.eye(3), (len(v), 1, 1))

    @property
    def _unit(self) -> float:
        return 1.0 / GRAVITY_M_S2

    def _mounted(self, up, reading, data):
        size = float(np.median(np.linalg.norm(reading, axis=1)))
        if abs(np.log(max(size, 1e-12))) > _ANOTHER_UNIT:
            raise InputError(
                f"the accelerometer of session {self.session} reads {GRAVITY_M_S2 * size:.3g} m/s^2 at rest; "
                "expected some 9.81: is it in g, or in mg?", file=data.first_file, column="accel_x_m_s2")
        product = reading.T @ up
        rotation, mirror = nearest(product), -nearest(-product)
        left, mirrored = (np.linalg.norm(reading - up @ each.T) for each in (rotation, mirror))
        if mirrored < _MIRRORED * left:
            raise InputError(
                f"the accelerometer of session {self.session} is mirrored: expected right-handed axes, and "
                "at rest a reading of some 9.81 m/s^2 that points up (specific force)", file=data.first_file,
                column="accel_x_m_s2",
            )
        return rotation
