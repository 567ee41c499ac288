"""A serial arm in plain numpy, read from the tables of a robot file: kinematics, gravity, gears, springs.

    frame i:   T_i = Rot_z(sign q + zero) Trans_z(d) Trans_x(a) Rot_x(alpha) Rot_y(beta)
    gravity:   tau_i = - sum_{j >= i} m_j g . (z_i x (c_j - o_i))          work of gravity on a turn of axis i
    gear:      theta / ratio = phi + sum_k (a_k sin(w_k phi) + b_k (cos(w_k phi) - 1)) / w_k      (2.13), E5
    spring:    tau = linear e + cubic e^3, solved for e by Newton's method

N rows, n axes, SI units. Written apart from the package on purpose: it shares none of its code.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

DEFAULT_RANGE_RAD = 2.6  # where a robot file gives no limits


@dataclass(frozen=True)
class Table:
    """Harmonics of one gear in one direction: order (cycles per output revolution), a and b relative to the
    ratio."""

    order: np.ndarray
    a: np.ndarray
    b: np.ndarray

    def error(self, phi: np.ndarray) -> np.ndarray:
        angle = phi[:, None] * self.order
        return (np.sin(angle) * self.a + (np.cos(angle) - 1.0) * self.b) @ (1.0 / self.order)


@dataclass(frozen=True)
class Arm:
    """The tables of n axes. ratio is NaN where no gear, linear 0 where no spring, mass None where no link is
    declared."""

    name: str
    sign: np.ndarray
    zero: np.ndarray
    d: np.ndarray
    a: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    hayati: np.ndarray
    offset: np.ndarray
    ratio: np.ndarray
    linear: np.ndarray
    cubic: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    gravity: np.ndarray
    mass: np.ndarray | None = None
    centre: np.ndarray | None = None
    inertia: np.ndarray | None = None
    rotor: np.ndarray | None = None
    coulomb: np.ndarray | None = None
    viscous: np.ndarray | None = None
    tables: tuple[dict[str, Table], ...] = field(default=())

    @property
    def axes(self) -> int:
        return len(self.a)

    @property
    def has_gear(self) -> np.ndarray:
        return np.isfinite(self.ratio)

    @property
    def motor_per_output(self) -> np.ndarray:
        """(n,) the ratio, 1 where no gear is declared."""
        return np.where(self.has_gear, self.ratio, 1.0)

    def with_values(self, **changes) -> Arm:
        return replace(self, **changes)


@dataclass(frozen=True)
class Posture:
    """Where everything is, in the robot's base frame: origins (N, n + 1, 3), rotations (N, n + 1, 3, 3), axes
    (N, n, 3)."""

    origin: np.ndarray
    rotation: np.ndarray
    axis: np.ndarray
    centre: np.ndarray | None

    @property
    def flange(self) -> np.ndarray:
        return self.origin[:, -1]


def read_arm(path: str | Path) -> Arm:
    """The arm of a robot file (.toml)."""
    table = tomllib.loads(Path(path).read_text())
    joints, links = table["joints"], table.get("links")
    column = lambda key, default=0.0: np.array([float(joint.get(key, default)) for joint in joints])
    gears = tuple({side: _table(joint[f"gear_{side}"]) for side in ("cw", "ccw") if f"gear_{side}" in joint}
                  for joint in joints)
    bodies = {}
    if links is not None:
        bodies = {
            "mass": np.array([link["mass_kg"] for link in links]),
            "centre": np.array([link["centre_of_mass_m"] for link in links]),
            "inertia": np.array([link.get("inertia_kg_m2", np.zeros((3, 3))) for link in links]),
        }
    return Arm(
        table["name"], column("sign", 1.0), column("zero_rad"), column("d_m"), column("a_m"),
        column("alpha_rad"),
        column("beta_rad"), np.array(["beta_rad" in joint for joint in joints]), column("q_offset_rad"),
        column("ratio", np.nan), column("spring_linear_Nm_rad"), column("spring_cubic_Nm_rad3"),
        column("q_min_rad", -DEFAULT_RANGE_RAD), column("q_max_rad", DEFAULT_RANGE_RAD),
        np.array(table.get("gravity_m_s2", (0.0, 0.0, -9.81))), rotor=column("rotor_inertia_kg_m2"),
        coulomb=column("coulomb_Nm"), viscous=column("viscous_Nm_s_rad"), tables=gears, **bodies,
    )


def _table(entry) -> Table:
    return Table(*(np.array(entry[key], float) for key in ("order_per_output_rev", "a", "b")))


def rotation_about(axis: int, angle: np.ndarray) -> np.ndarray:
    """(..., 3, 3) turn about x, y or z (0, 1, 2)."""
    angle = np.asarray(angle, float)
    out = np.zeros(angle.shape + (3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[..., axis, axis] = 1.0
    out[..., i, i] = out[..., j, j] = np.cos(angle)
    out[..., j, i] = np.sin(angle)
    out[..., i, j] = -np.sin(angle)
    return out


def turn(vector: np.ndarray) -> np.ndarray:
    """(..., 3, 3) the rotation of a rotation vector (..., 3) (Rodrigues)."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    safe = np.maximum(angle, 1e-12)
    cross = np.zeros(vector.shape + (3,))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[..., k, j], cross[..., j, k] = vector[..., i], -vector[..., i]
    return np.eye(3) + np.sin(angle) / safe * cross + (1.0 - np.cos(angle)) / safe**2 * (cross @ cross)


def posture(arm: Arm, q: np.ndarray, stretch: np.ndarray | float = 1.0) -> Posture:
    """Frames of every row; `stretch` (N,) scales all lengths of the arm (a and d)."""
    rows = len(q)
    stretch = np.broadcast_to(np.asarray(stretch, float), (rows,))
    origin, rotation = np.zeros((rows, arm.axes + 1, 3)), np.zeros((rows, arm.axes + 1, 3, 3))
    axis = np.zeros((rows, arm.axes, 3))
    rotation[:, 0] = np.eye(3)
    for i in range(arm.axes):
        axis[:, i] = arm.sign[i] * rotation[:, i, :, 2]
        turned = rotation[:, i] @ rotation_about(2, arm.sign[i] * q[:, i] + arm.zero[i])
        origin[:, i + 1] = origin[:, i] + stretch[:, None] * (turned @ np.array([arm.a[i], 0.0, arm.d[i]]))
        rotation[:, i + 1] = turned @ (rotation_about(0, arm.alpha[i]) @ rotation_about(1, arm.beta[i]))
    centre = (
        None if arm.mass is None else origin[:, 1:] + np.einsum("nkij,kj->nki", rotation[:, 1:], arm.centre)
    )
    return Posture(origin, rotation, axis, centre)


def gravity_torque(arm: Arm, at: Posture) -> np.ndarray:
    """(N, n) torque that each joint has to hold against gravity: the slope of the potential energy."""
    torque = np.zeros(at.axis.shape[:2])
    if arm.mass is None:
        return torque
    for i in range(arm.axes):
        first_moment = np.einsum("nki,k->ni", at.centre[:, i:] - at.origin[:, i : i + 1], arm.mass[i:])
        torque[:, i] = -np.einsum("ni,ni->n", at.axis[:, i], np.cross(first_moment, arm.gravity))
    return torque


def weight_moment(arm: Arm, at: Posture, index: int) -> np.ndarray:
    """(N, 3) moment of the weight of everything beyond joint `index` (from 0) about its origin."""
    arms = at.centre[:, index:] - at.origin[:, index : index + 1]
    return np.einsum("nki,k->ni", np.cross(arms, arm.gravity), arm.mass[index:])


def spring_deflection(arm: Arm, torque: np.ndarray) -> np.ndarray:
    """(N, n) how far the declared springs give way."""
    out = np.zeros_like(torque)
    for i in np.flatnonzero(arm.linear):
        e = torque[:, i] / arm.linear[i]
        for _ in range(20 if arm.cubic[i] else 0):
            e = e - (arm.linear[i] * e + arm.cubic[i] * e**3
                     - torque[:, i]) / (arm.linear[i] + 3.0 * arm.cubic[i] * e**2)
        out[:, i] = e
    return out


def output_angle(arm: Arm, theta: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(N, n) what the declared gears deliver; direction (N, n) of the motor: -1 cw, +1 ccw, 0 the mean of
    both tables."""
    phi = theta / arm.motor_per_output
    for i, tables in enumerate(arm.tables):
        if not tables:
            continue
        cw, ccw = tables.get("cw", tables.get("ccw")), tables.get("ccw", tables.get("cw"))
        # An axis that stands still is worked out once.
        still = np.ptp(theta[:, i]) == 0.0 and np.ptp(direction[:, i]) == 0.0
        rows = slice(0, 1) if still else slice(None)
        share, wanted = 0.5 * (1.0 + direction[rows, i]), phi[rows, i].copy()
        x = wanted
        for _ in range(15):
            before = x
            x = wanted - share * ccw.error(x) - (1.0 - share) * cw.error(x)
            if np.max(np.abs(x - before)) < 1e-14:
                break
        phi[:, i] = x
    return phi
