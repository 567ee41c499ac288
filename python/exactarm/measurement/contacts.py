"""Contacts: what the target touches stands for the device of the chain, at the station where a tracker would
measure.

    socket   p - c                      (3 numbers)      c: centre
    plane    n'(p - m) - h              (1)              n = n0 + a u + b v, normalised; h; m, n0, u, v: fixed
             reference
    sphere   |p - c| - r                (1)              c, r = radius of the sphere + that of the tip
    bar      |p - c| - l0               (1)              c: far end; l0: the bar's length, or the zero of what
             is read

p (N, 3): target in the robot's base frame, m. A good model makes a contact's numbers vanish (the bar's: equal
the length that was read). Centres, planes and lengths are nuisances: effects of the declared model, one
object a contact and session.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from exactarm.effects.base import Parameter
from exactarm.measurement.camera import Camera
from exactarm.measurement.contact import Contact
from exactarm.measurement.gravity_sensors import Accelerometer, Inclinometer
from exactarm.measurement.partner import Partner
from exactarm.numerics.factors import lstsq, svd

_CENTRE = tuple(Parameter(f"{axis}_m", 10.0) for axis in "xyz")
_UNSEEN_M = 1e-9  # a centre nearer than this to the target has no direction

@dataclass(frozen=True)
class Touched(Contact):
    """A contact that shows where the target is, not how it is turned."""

    def start(self, points: np.ndarray, length: np.ndarray | None) -> Touched:
        """The contact that fits `points` (K, 3) best, up to outliers; `length` (K,): what was read, or
        None."""
        raise NotImplementedError

    def touch(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers (K, c) of a touch at `points`, by point (K, c, 3), by the parameters (K, c, k)."""
        raise NotImplementedError

    def counted_anew(self) -> Touched:
        """The same, its values counted from where it is."""
        return self

    def started(self, view, at):
        return self.start(_points(view, at), None)

    def numbers_at(self, view, at):
        numbers, by_point, by_values = self.touch(_points(view, at))
        return numbers, np.concatenate([by_point, np.zeros_like(by_point)], axis=2), by_values


@dataclass(frozen=True)
class Socket(Touched):
    """A seat that holds the ball's centre at one point."""

    contact: ClassVar[str] = "socket"
    numbers: ClassVar[int] = 3

    def parameters(self) -> tuple[Parameter, ...]:
        return _CENTRE

    def start(self, points, length):
        return self.with_values(np.median(points, axis=0))

    def touch(self, points):
        count = len(points)
        return points - np.asarray(self.values), np.tile(np.eye(3),
                                                         (count, 1, 1)), np.tile(-np.eye(3), (count, 1, 1))


@dataclass(frozen=True)
class Plane(Touched):
    """A flat face; `reference`: point m and orthonormal n0, u, v (4, 3) that the parameters count from."""

    reference: tuple[tuple[float, ...], ...] = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0),
                                                (0.0, 1.0, 0.0))

    contact: ClassVar[str] = "plane"

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("tilt_u_rad", np.pi), Parameter("tilt_v_rad", np.pi), Parameter("h_m", 10.0))

    def start(self, points, length):
        middle = points.mean(axis=0)
        v, u, normal = svd(points - middle, full_matrices=False)[2]
        axes = (middle, normal, u, v)
        height = float(np.median((points - middle) @ normal))
        return replace(self, values=(0.0, 0.0, height),
                       reference=tuple(tuple(float(x) for x in axis) for axis in axes))

    def counted_anew(self):
        n = self.normal[0]
        u, v = svd(n[None])[2][1:]
        axes = (self.reference[0], n, u, v)
        return replace(self, values=(0.0, 0.0, self.values[2]),
                       reference=tuple(tuple(float(x) for x in axis) for axis in axes))

    @property
    def normal(self) -> tuple[np.ndarray, np.ndarray]:
        """n (3,) and its derivative by the two tilts (3, 2)."""
        _, n0, u, v = np.asarray(self.reference)
        raw = n0 + self.values[0] * u + self.values[1] * v
        size = np.linalg.norm(raw)
        n = raw / size
        return n, (np.eye(3) - np.outer(n, n)) @ np.stack([u, v], axis=1) / size

    @property
    def point(self) -> np.ndarray:
        """(3,) a point of the face, next to the touched ones."""
        return np.asarray(self.reference[0]) + self.values[2] * self.normal[0]

    def touch(self, points):
        n, by_tilt = self.normal
        arm = points - np.asarray(self.reference[0])
        by_values = np.concatenate([arm @ by_tilt, -np.ones((len(points), 1))], axis=1)
        return (arm @ n - self.values[2])[:, None], np.tile(n, (len(points), 1, 1)), by_values[:, None, :]


@dataclass(frozen=True)
class Sphere(Touched):
    """A ball of unknown place touched from outside: all touches are at one distance from its centre."""

    contact: ClassVar[str] = "sphere"

    def parameters(self) -> tuple[Parameter, ...]:
        return (*_CENTRE, Parameter("radius_m", 1.0, lower=0.0))

    def start(self, points, length):
        return self.with_values(_sphere(points, None))

    def touch(self, points):
        arm = points - np.asarray(self.values[:3])
        distance = np.maximum(np.linalg.norm(arm, axis=1), _UNSEEN_M)
        towards = arm / distance[:, None]
        by_values = np.concatenate([-towards, -np.ones((len(points), 1))], axis=1)
        return (distance - self.values[3])[:, None], towards[:, None, :], by_values[:, None, :]


@dataclass(frozen=True)
class Bar(Sphere):
    """A ball bar, telescopic bar or wire from the target to a fixed point; `absolute`: its zero is known."""

    absolute: bool = False

    contact: ClassVar[str] = "bar"

    def parameters(self) -> tuple[Parameter, ...]:
        return (*_CENTRE, Parameter("zero_m", 1.0, fixed=self.absolute))

    def started(self, view, at):
        length = None if view.data.length is None else view.data.length[at]
        length = None if length is None or np.isnan(length).any() else length
        known = length is not None and self.number not in view.data.fixture.free_bars
        return replace(self, absolute=known).start(_points(view, at), length)

    def reading(self, data, at):
        return super().reading(data, at) if data.length is None else np.nan_to_num(data.length[at])[:, None]

    def start(self, points, length):
        if length is None:
            return self.with_values(_sphere(points, None))
        return self.with_values([*_sphere(points, length)[:3], 0.0])


TOUCHED: dict[str, type[Touched]] = {cls.contact: cls for cls in (Socket, Plane, Sphere, Bar)}
SENSORS: dict[str, type[Contact]] = {cls.contact: cls for cls in (Inclinometer, Accelerometer)}
CAMERA: dict[str, type[Contact]] = {Camera.contact: Camera}
ARMS: dict[str, type[Contact]] = {Partner.contact: Partner}
CONTACT_CLASSES: dict[str, type[Contact]] = TOUCHED | SENSORS | CAMERA | ARMS


def _points(view, at: np.ndarray) -> np.ndarray:
    """(K, 3) m: the target of the rows `at`."""
    return view.signals["target"][at] + view.signals["displacement"][at, :3]


def _sphere(points: np.ndarray, length: np.ndarray | None) -> np.ndarray:
    """(4,) centre and radius by linear least squares: 2 c'p + (r^2 - |c|^2) = |p|^2 (- l^2 where lengths are
    read)."""
    middle = points.mean(0)
    arm = points - middle
    right = np.sum(arm**2, axis=1) - (0.0 if length is None else length**2)
    solution = lstsq(np.column_stack([2.0 * arm, np.ones(len(arm))]), right, rcond=None)[0]
    radius = np.sqrt(max(solution[3] + solution[:3] @ solution[:3], 0.0)) if length is None else 0.0
    return np.array([*(solution[:3] + middle), radius])
