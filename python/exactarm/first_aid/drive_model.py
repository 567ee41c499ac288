"""Motions by a linear model of the drives: what the usual mistakes are tried on.

    tau = Y(q, q_dot, q_ddot) (pi + carried) + J ratio^2 q_ddot
          + coulomb sign(q_dot) + viscous q_dot + constant

Rigid, all of pi, J, friction and constant free (10 n + 4 n unknowns, a trace of ridge for those that the
motion does not show), every axis weighted by its own torque; carried: the declared payload. Share u_i: RMS of
what is left of axis i over that of its torque.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from exactarm import _core
from exactarm.chain import motion_record
from exactarm.chain.loaded_arms import carried_bodies
from exactarm.data.dataset import Dataset
from exactarm.robot.robot import Robot
from exactarm.view import SLIDES_RAD

MOST_ROWS = 300  # of the linear model: 1,800 numbers for the 84 unknowns of six axes
MOST_LOGGED = 20000  # rows that are filtered for it
_ROWS_SHARE = 0.3
_SIGN_RAD_S = 0.02
_RIDGE = 1e-7  # beside columns of length 1
# of the longest column: the shortest true one of six axes is 6e-7, one of rounding alone 3e-21. At length 1
# such a column is an unknown more, and what is left jumps by 0.5 % from one speed to the next
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Motion:
    """q, rate, acceleration (N, n) of the output sides of `robot`, whose gravity acts; clock: of `rate` over
    what was read, for where dry friction turns over does not follow it."""

    robot: Robot
    q: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    clock: float = 1.0

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """q, rate and acceleration as the core takes them."""
        return tuple(map(np.ascontiguousarray, (self.q, self.rate, self.acceleration)))

    @cached_property
    def links(self) -> np.ndarray:
        """(N, n, 10 n) columns of the links' inertial parameters, Nm."""
        return _core.dynamics_regressor(self.robot.core, *self.arrays)

    @cached_property
    def _links_held(self) -> np.ndarray:
        """`links` of the arm that is held at rest in these places."""
        rest = np.zeros_like(self.q)
        return replace(self, rate=rest, acceleration=rest).links

    @cached_property
    def columns(self) -> tuple[np.ndarray, ...]:
        """Of every axis (N, P_i), Nm, at its places."""
        own = np.stack([self.robot.controller_ratios**2 * self.acceleration,
                        dry_friction_of(self.rate / self.clock), self.rate, np.ones_like(self.rate)], axis=2)
        axes = range(self.robot.axes)
        return tuple(np.concatenate([self.links[:, i, 10 * i :], own[:, i]], axis=1) for i in axes)

    @cached_property
    def grams(self) -> np.ndarray:
        """(n, 14 n, 14 n) of every axis' columns."""
        n = self.robot.axes
        grams = np.zeros((n, 14 * n, 14 * n))
        for gram, columns, where in zip(grams, self.columns, _places(n)):
            gram[np.ix_(where, where)] = columns.T @ columns
        return grams

    @cached_property
    def dry(self) -> np.ndarray:
        """(n,) RMS of the columns of dry friction."""
        return np.array([np.sqrt(np.mean(columns[:, -3] ** 2)) for columns in self.columns])

    def at(self, speed: float) -> Motion:
        """The same path `speed` times as fast: what moves links goes with the square, what holds them not."""
        other = replace(self, rate=speed * self.rate, acceleration=speed**2 * self.acceleration, clock=speed)
        other.__dict__["links"] = self._links_held + speed**2 * (self.links - self._links_held)
        return other

    def under(self, gravity: np.ndarray) -> Motion:
        return replace(self, robot=replace(self.robot, gravity=gravity))


@lru_cache
def _places(n: int) -> tuple[np.ndarray, ...]:
    """Of every axis (P_i,) where the unknowns that it feels stand among all: the links from this axis on, for
    an axis carries no other, then its rotor, dry and viscous friction and constant."""
    return tuple(np.r_[10 * axis : 10 * n, (10 + np.arange(4)) * n + axis] for axis in range(n))


@dataclass(frozen=True)
class MotionSamples:
    """motion and torque (N, n) of the output sides on some rows; the scale of the columns of the file over
    the output side (n,), of angles and of torques; time (N,) of these rows, and logged_time (M,) of all
    torques, logged (M, n); s, one run behind the other; since (N,): s since its run began."""

    motion: Motion
    torque: np.ndarray
    angle_scale: np.ndarray
    torque_scale: np.ndarray
    time: np.ndarray
    logged_time: np.ndarray
    logged: np.ndarray
    since: np.ndarray
    carried: np.ndarray | None = None  # (N, 10) inertial parameters of the declared payload, frame n

    @property
    def moves(self) -> np.ndarray:
        """(n,) bool: axes whose gears slide; friction or a brake may hold any torque of the others."""
        return np.ptp(self.motion.q, axis=0) > SLIDES_RAD

    def with_angles(self, change: Callable[[np.ndarray], np.ndarray]) -> MotionSamples:
        """The columns of angles in the file changed, and with them their rates."""
        new = lambda values: change(values * self.angle_scale) / self.angle_scale
        motion, offset = self.motion, self.motion.robot.offsets
        return replace(self, motion=replace(motion, q=new(motion.q - offset) + offset, rate=new(motion.rate),
                                            acceleration=new(motion.acceleration)))

    def with_torques(self, change: Callable[[np.ndarray], np.ndarray]) -> MotionSamples:
        return replace(self, torque=change(self.torque / self.torque_scale) * self.torque_scale)

    def with_torques_of(self, later: np.ndarray) -> MotionSamples:
        """The torques that were logged `later` seconds (N,)."""
        columns = [np.interp(self.time + later, self.logged_time, values) for values in self.logged.T]
        return replace(self, torque=np.stack(columns, axis=1))


Model = Callable[[MotionSamples], "Explained"]


@dataclass(frozen=True)
class Explained:
    """shares (n,) u of every axis; friction (n,): share of an axis' torque that dry friction takes, negative
    where it drives."""

    shares: np.ndarray
    friction: np.ndarray


@dataclass(frozen=True)
class Equations:
    """The model of some rows, over the size (n,) of every axis' torque; goal (N, n): the torque without what
    the declared payload asks for. own_friction: friction and constant are unknowns of these rows alone."""

    motion: Motion
    goal: np.ndarray
    size: np.ndarray
    own_friction: bool = False

    @staticmethod
    def of(samples: MotionSamples, size: np.ndarray) -> Equations:
        torque = samples.torque
        if samples.carried is not None:
            last = (columns[:, -14:-4] for columns in samples.motion.columns)
            torque = torque - np.stack([np.sum(each * samples.carried, axis=1) for each in last], axis=1)
        return Equations(samples.motion, torque / size, size)

    @cached_property
    def normal(self) -> tuple[np.ndarray, np.ndarray]:
        gram, product = np.tensordot(self.size**-2.0, self.motion.grams, 1), np.zeros(14 * len(self.size))
        for axis, where in enumerate(_places(len(self.size))):
            product[where] += self.motion.columns[axis].T @ self.goal[:, axis] / self.size[axis]
        if not self.own_friction:
            return gram, product
        wide = np.zeros((17 * len(self.size),) * 2)
        wide[np.ix_(self._unknowns, self._unknowns)] = gram
        return wide, np.bincount(self._unknowns, product)

    @property
    def _unknowns(self) -> np.ndarray:
        n = len(self.size)
        return np.r_[: 11 * n, 14 * n : 17 * n] if self.own_friction else np.arange(14 * n)

    def left(self, x: np.ndarray) -> np.ndarray:
        """(N, n) of the goal."""
        own = x[self._unknowns]
        columns = zip(self.motion.columns, _places(len(self.size)), self.size)
        return self.goal - np.stack([each @ (own[where] / size) for each, where, size in columns], axis=1)


def torque_sizes(torque: np.ndarray) -> np.ndarray:
    """(n,) RMS of every axis; never zero."""
    size = np.sqrt(np.mean(torque**2, axis=0))
    return np.maximum(size, 1e-9 * max(size.max(), 1e-9))


def explained(blocks: Sequence[Equations]) -> Explained:
    """By one set of parameters for all blocks."""
    unknowns = max(len(block.normal[1]) for block in blocks)
    gram, product = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
    for block in blocks:
        part = slice(len(block.normal[1]))
        gram[part, part] += block.normal[0]
        product[part] += block.normal[1]
    length = np.sqrt(np.diag(gram))
    length[length <= _ROUNDING * length.max()] = np.inf
    scaled = gram / np.outer(length, length) + _RIDGE * np.eye(len(length))
    x = np.linalg.solve(scaled, product / length) / length
    left = np.concatenate([block.left(x) for block in blocks])
    n, counts = left.shape[1], np.isfinite(blocks[0].size)
    dry = np.sqrt(np.mean([(block.motion.dry / block.size) ** 2 for block in blocks], axis=0))
    return Explained(np.where(counts, np.sqrt(np.mean(left**2, axis=0)), 1.0), x[11 * n : 12 * n] * dry)


def alone(samples: MotionSamples, at_rest: np.ndarray | None = None) -> Explained:
    """The model of samples by themselves; at_rest (n,) bool: axes that count for nothing, a share of
    1."""
    size = torque_sizes(samples.torque)
    return explained([Equations.of(samples, size if at_rest is None else np.where(at_rest, np.inf, size))])


def samples_of(robot: Robot, data: Dataset, most: int = MOST_ROWS,
               bandwidth_hz: float | None = None) -> MotionSamples:
    """At most `most` rows, evenly spread; bandwidth_hz: of the low-pass, by default that of the robot."""
    numbers = np.unique(data.run)
    each = max(MOST_LOGGED // len(numbers), 500)
    rows = np.sort(np.concatenate(
        [np.flatnonzero(data.run == number)[:each] for number in numbers[: MOST_LOGGED // 500]]))
    record = motion_record(robot, data.select(rows), bandwidth_hz, _ROWS_SHARE)
    inside, kept = np.flatnonzero(record.inside), np.flatnonzero(record.keep)
    kept = kept[np.unique(np.linspace(0, kept.size - 1, min(kept.size, most)).astype(int))]
    output, since = lambda values: values[kept] / robot.ratios, np.zeros(len(record.inside))
    for run in record.runs:
        since[run] = record.step * np.arange(len(run))
    ones = np.ones(robot.axes)
    return MotionSamples(Motion(robot, output(record.theta) + robot.offsets, output(record.theta_dot),
                                output(record.theta_ddot)),
                         record.torque[kept],
                         robot.ratios if "theta" in data.joints else ones,
                         ones if "tau" in data.joints else robot.controller_ratios,
                         record.step * kept, record.step * inside, record.torque[inside], since[kept],
                         carried_bodies(record.data.select(kept)) if data.payload is not None else None)


def dry_friction_of(rate: np.ndarray) -> np.ndarray:
    """The sign of rates (N, n), turning over smoothly."""
    return np.tanh(rate / _SIGN_RAD_S)
