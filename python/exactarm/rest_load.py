"""The load of an arm at rest: gravity of its links and of what the flange carries, or the measured torque.

    torque(q) = g(links; q) + m g_1(q) + sum_k m c_k (g_k(q) - g_1(q))

g_1, g_k: of a unit mass at the flange, and a metre along its axis k. m (kg) and c (m, DH frame n) may
differ from row to row (columns payload_kg, payload_x_m ...). An axis whose drive torque was measured in
static poses carries that torque instead, whatever the model says: tau_i, tau_motor_i, or current_i of a
motor whose torque constant is declared, without their friction and noise (identify/rest_torque.py).
Shapes: torque (N, n) Nm, its slope by q (N, n, n).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from exactarm import _core
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import kind_of
from exactarm.robot.generic_masses import first_moments
from exactarm.robot.robot import Link, Robot

TORQUES = ("tau", "tau_motor", "current")  # columns that tell a drive's torque, the first that is there
TORQUE_ERROR = "tau_error"  # standard deviation of such a load along any shape of unit mean square, all rows
TIP_SHARE = 0.1  # of the arm's mass, at the flange: the shape by which a generic distribution may be wrong
Body = tuple[_core.Robot, np.ndarray]  # a massive arm, and how much of it (N,) each row carries


@dataclass(frozen=True)
class RestLoad:
    """own: the links, or None; payload: what the flange carries; measured (N, n): NaN where it was not;
    payload_varies: rows carry different payloads that were weighed, beside the unknown ones of the links;
    error (N, n): TORQUE_ERROR of measured ones, None where nothing is known of it."""

    robot: Robot
    own: _core.Robot | None
    payload: tuple[Body, ...]
    measured: np.ndarray
    payload_varies: bool
    threads: int = 1
    error: np.ndarray | None = None

    @staticmethod
    def of(robot: Robot, data: Dataset, threads: int = 1, flange: np.ndarray | None = None) -> RestLoad:
        """flange (N, 4): as in `weighed`, where more is known of it than the data say."""
        own, known = None if robot.links is None else robot.core, weighed(data)
        payload = carried_bodies(robot, known if flange is None else flange) if own is not None else ()
        varies = own is not None and bool(np.any(known != known[:1]))
        return RestLoad(robot, own, payload, measured_at_rest(robot, data), varies, threads,
                        data.joints.get(TORQUE_ERROR))

    @cached_property
    def fixed(self) -> np.ndarray:
        """(N, n) bool: loads that were measured."""
        return ~np.isnan(self.measured)

    @property
    def any(self) -> bool:
        return self.own is not None or bool(self.fixed.any())

    def doubt(self, index: int) -> float:
        """Standard deviation, of its own, of the size of a measured load at axis `index` (from 0)."""
        spread = float(self.measured[:, index].std())
        return float(self.error[0, index]) / spread if self.error is not None and spread > 0.0 else 0.0

    def torque(self, q: np.ndarray) -> np.ndarray:
        return self.as_measured(self._gravity(q))

    def _gravity(self, q: np.ndarray) -> np.ndarray:
        if self.own is None:
            return np.zeros_like(q)
        torque = _core.gravity_torque(self.own, q, self.threads)
        for core, share in self.payload:
            torque = torque + share[:, None] * _core.gravity_torque(core, q, self.threads)
        return torque

    def as_measured(self, torque: np.ndarray) -> np.ndarray:
        """The torque (N, n) with the measured axes as they were measured."""
        return np.where(self.fixed, self.measured, torque) if self.fixed.any() else torque

    def slope(self, q: np.ndarray) -> np.ndarray:
        """(N, n, n) of `torque` by q."""
        if self.own is None:
            return np.zeros((*q.shape, q.shape[1]))
        slope = _core.gravity_torque_jacobian(self.own, q, self.threads)
        for core, share in self.payload:
            slope = slope + share[:, None, None] * _core.gravity_torque_jacobian(core, q, self.threads)
        return self.unless_measured(slope)

    def unless_measured(self, tangent: np.ndarray) -> np.ndarray:
        """A derivative (N, n, ...) of the torque with nothing in the measured axes."""
        return np.where(self.fixed[:, :, None], 0.0, tangent) if self.fixed.any() else tangent

    def parts(self, q: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Torque and slope: `own`, the links, and `tip`, a tenth of their mass at the flange."""
        share = TIP_SHARE * sum(link.mass for link in self.robot.links)
        tip = massive(self.robot, share, np.zeros(3))
        both = {"own": self.own, "tip": tip}
        return {
            name: (
                _core.gravity_torque(core, q, self.threads),
                _core.gravity_torque_jacobian(core, q, self.threads),
            )
            for name, core in both.items()
        }

    def moments(self, q: np.ndarray, index: int) -> np.ndarray:
        """(N, 3 (n - index)) Nm at axis `index` (from 0): the first moment of each link from there on, as
        large as the links have it, along x, y, z of its frame."""
        still = np.zeros_like(q)
        whole = _core.dynamics_regressor(self.robot.core, q, still, still, self.threads)[:, index]
        per_moment = whole.reshape(len(q), -1, 10)[:, index:, 1:4]
        return (per_moment * first_moments(self.robot)[index:, None]).reshape(len(q), -1)

    def moments_slope(self, q: np.ndarray, index: int, shares: np.ndarray) -> np.ndarray:
        """(N, n) by q of `moments` times `shares`."""
        moment = np.zeros((self.robot.axes, 3))
        moment[index:] = np.reshape(shares, (-1, 3)) * first_moments(self.robot)[index:, None]
        nothing = np.zeros((3, 3))
        there, without = (
            _core.gravity_torque_jacobian(
                replace(self.robot, links=tuple(Link(1.0, centre, nothing) for centre in centres)).core,
                q, self.threads,
            )[:, index]
            for centres in (moment, 0.0 * moment)
        )
        return there - without

    def by_flange(self, q: np.ndarray) -> np.ndarray:
        """(N, n, 4) of the torque by mass (kg) and first moment (kg m) at the flange."""
        still = np.zeros_like(q)
        return _core.dynamics_regressor(self.robot.core, q, still, still, self.threads)[:, :, -10:-6]


def massive(robot: Robot, mass: float, centre: np.ndarray) -> _core.Robot:
    """The arm without any mass but one at `centre` of the last frame."""
    nothing = Link(0.0, np.zeros(3), np.zeros((3, 3)))
    links = (nothing,) * (robot.axes - 1) + (Link(mass, np.asarray(centre, float), np.zeros((3, 3))),)
    return replace(robot, links=links).core


def weighed(data: Dataset) -> np.ndarray:
    """(N, 4) payload of the rows as it is known: kg, and its first moment in DH frame n, kg m."""
    if data.payload is None:
        return np.zeros((len(data), 4))
    mass, centre = data.payload
    return np.column_stack([mass, mass[:, None] * centre])


def carried_bodies(robot: Robot, flange: np.ndarray) -> tuple[Body, ...]:
    """What the flange carries (N, 4), as unit masses there and a metre along its axes."""
    shares = [flange[:, 0] - flange[:, 1:].sum(axis=1), *flange[:, 1:].T]
    points = [np.zeros(3), *np.eye(3)]
    return tuple((massive(robot, 1.0, point), share) for point, share in zip(points, shares) if np.any(share))


def measured_at_rest(robot: Robot, data: Dataset) -> np.ndarray:
    """(N, n) Nm measured in static poses, NaN where none was; currents only with a declared constant."""
    if not kind_of(data.kind).at_rest:
        return np.full((len(data), robot.axes), np.nan)
    return drive_torque(robot, data, declared_constants(robot))


def declared_constants(robot: Robot, otherwise: float = np.nan) -> np.ndarray:
    """(n,) Nm/A of the motors; `otherwise` where none is declared."""
    declared = (joint.torque_constant for joint in robot.joints)
    return np.array([otherwise if constant is None else constant for constant in declared])


def drive_torque(robot: Robot, data: Dataset, constants: np.ndarray) -> np.ndarray:
    """(N, n) output-side torque in Nm as the drives tell it, NaN where none; constants (n,): Nm/A."""
    torque, ratios = np.full((len(data), robot.axes), np.nan), robot.controller_ratios
    for name, factor in zip(TORQUES, (1.0, ratios, ratios * constants)):
        if name in data.joints:
            torque = np.where(np.isnan(torque), data.joints[name] * factor, torque)
    return torque
