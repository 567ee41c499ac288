"""Reference trajectories of the flange: position, velocity, acceleration in closed form, and orientation.

Time law (thesis (4.4), signs of E9), with s = t / t_e from 0 to 1:
    lambda(s) = 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7
at rest with zero acceleration and jerk at both ends. Line (4.7); conical spiral (4.8) with its centre (E12):
    x = x_c + r mu cos mu,  y = y_c + r mu sin mu,  z = z(t),   r = radius_max / (2 pi turns)
where mu and z follow the time law from start to end; via-points on a spline of degree 5 (C4), at rest with
zero acceleration at both ends. Orientation: constant, interpolated on the sphere (SLERP) between two with the
time law, or through one per via-point on a C2 rotation spline.
Lengths in m, time in s, quaternions (w, x, y, z), everything in the controller's base frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy  # scipy.interpolate is imported at its first use
from scipy.spatial.transform import Rotation, RotationSpline, Slerp

from exactarm.errors import InputError

TIME_LAW = (0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0)  # coefficients of s^0 to s^7

# t -> (value, first, second derivative), each (N, ...)
Motion = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Reference:
    """Samples at equal steps: time (N,), position, velocity, acceleration (N, 3), rotation (N, 3, 3)."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    rotation: np.ndarray

    @property
    def step(self) -> float:
        return float(self.time[-1] / (len(self.time) - 1))


@dataclass(frozen=True)
class Line:
    start: np.ndarray
    end: np.ndarray

    def motion(self, duration: float) -> Motion:
        def at(t):
            return tuple(shape[:, None] * (self.end - self.start) + (self.start if k == 0 else 0.0)
                         for k, shape in enumerate(time_law(t, duration)))

        return at


@dataclass(frozen=True)
class Spiral:
    centre: np.ndarray  # (2,)
    radius_max: float
    turns: float
    angle_start: float
    z_start: float
    z_end: float

    def motion(self, duration: float) -> Motion:
        growth, angle_end = self.radius_max / (2.0 * np.pi * self.turns), 2.0 * np.pi * self.turns

        def at(t):
            law, rate, second = time_law(t, duration)
            mu = self.angle_start + (angle_end - self.angle_start) * law
            mu_dot, mu_ddot = (angle_end - self.angle_start) * rate, (angle_end - self.angle_start) * second
            # w = mu exp(i mu) and its derivatives by mu
            turn = np.exp(1j * mu)
            w, w1, w2 = mu * turn, (1.0 + 1j * mu) * turn, (2j - mu) * turn
            plane = [w, w1 * mu_dot, w2 * mu_dot**2 + w1 * mu_ddot]
            height = [self.z_start + (self.z_end - self.z_start) * law,
                      (self.z_end - self.z_start) * rate, (self.z_end - self.z_start) * second]
            values = [np.column_stack([growth * p.real, growth * p.imag, z]) for p, z in zip(plane, height)]
            values[0][:, :2] += self.centre
            return tuple(values)

        return at


@dataclass(frozen=True)
class Points:
    points: np.ndarray  # (m, 3)
    times: np.ndarray | None = None  # (m,) s; None: chord lengths, and the time law over the whole path

    def motion(self, duration: float) -> Motion:
        if self.times is not None:
            spline = self._spline(self.times)
            return lambda t: tuple(spline(t, nu=k) for k in range(3))
        spline = self._spline(self.progress)

        def at(t):
            law, rate, second = time_law(t, duration)
            p1, p2 = spline(law, nu=1), spline(law, nu=2)
            return spline(law), p1 * rate[:, None], p2 * rate[:, None] ** 2 + p1 * second[:, None]

        return at

    @property
    def progress(self) -> np.ndarray:
        """(m,) share of the chord length at each point, from 0 to 1."""
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.points, axis=0), axis=1))])
        return length / length[-1]

    def _spline(self, knots: np.ndarray):
        rest = [(1, np.zeros(3)), (2, np.zeros(3))]
        if self.times is None:  # the time law brings the rest; the curve itself ends without curvature
            return scipy.interpolate.make_interp_spline(knots, self.points, k=5,
                                      bc_type=([(2, np.zeros(3)), (3, np.zeros(3))],) * 2)
        return scipy.interpolate.make_interp_spline(knots, self.points, k=5, bc_type=(rest, rest))


Curve = Line | Spiral | Points


def time_law(t: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """lambda (N,) from 0 to 1 over `duration`, and its first two derivatives by time."""
    s, law = np.asarray(t) / duration, np.polynomial.Polynomial(TIME_LAW)
    return law(s), law.deriv(1)(s) / duration, law.deriv(2)(s) / duration**2


def sample_reference(curve: Curve, orientation_wxyz: np.ndarray, duration: float,
                     rate_hz: float) -> Reference:
    """The curve sampled from 0 to `duration`, both ends included; the step is the nearest to 1 / rate that
    fits."""
    samples = int(round(duration * rate_hz)) + 1
    time = np.linspace(0.0, duration, samples)
    position, velocity, acceleration = curve.motion(duration)(time)
    rotation = _orientation(curve, np.atleast_2d(orientation_wxyz), time, duration)
    return Reference(time, position, velocity, acceleration, rotation)


def _orientation(curve: Curve, wxyz: np.ndarray, time: np.ndarray, duration: float) -> np.ndarray:
    turns = Rotation.from_quat(np.roll(wxyz, -1, axis=1))
    if len(turns) == 1:
        return np.broadcast_to(turns.as_matrix()[0], (len(time), 3, 3)).copy()
    law = np.clip(time_law(time, duration)[0], 0.0, 1.0)
    if len(turns) == 2 and not (isinstance(curve, Points) and curve.times is not None):
        return Slerp([0.0, 1.0], turns)(law).as_matrix()
    if not isinstance(curve, Points) or len(turns) != len(curve.points):
        raise InputError(f"orientation_wxyz: found {len(turns)} orientations, expected 1, 2 or one per point")
    if curve.times is not None:
        return RotationSpline(curve.times, turns)(np.clip(time, curve.times[0], curve.times[-1])).as_matrix()
    return RotationSpline(curve.progress, turns)(law).as_matrix()
