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
from functools import cached_property

import numpy as np

from exactarm import _core
from exactarm.chain import motion_record
from exactarm.chain.loaded_arms import carried_bodies
from exactarm.dataset import Dataset
from exactarm.robot import Robot

MOST_ROWS = 300  # of the linear model: 1,800 numbers for the 84 unknowns of six axes
MOST_LOGGED = 20000  # rows that are filtered for it
_ROWS_SHARE = 0.3
_SIGN_RAD_S = 0.02
_RIDGE = 1e-7  # beside columns of length 1


@dataclass(frozen=True)
class MotionSamples:
    """q, q_dot, q_ddot, torque (N, n) of the output sides on some rows; gravity (3,); offset (n,) of q, and
    the scale of the columns of the file over the output side (n,), of angles and of torques; time (N,) of
    these rows, and logged_time (M,) of all torques, logged (M, n); s, one run behind the other."""

    q: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray
    gravity: np.ndarray
    offset: np.ndarray
    angle_scale: np.ndarray
    torque_scale: np.ndarray
    time: np.ndarray
    logged_time: np.ndarray
    logged: np.ndarray
    base_axes: np.ndarray  # (3, 3) rows: x, y, z of the controller's base in DH frame 0
    carried: np.ndarray | None = None  # (N, 10) inertial parameters of the declared payload, frame n
    clock: float = 1.0  # of `rate` over what was read: where dry friction turns over does not follow it

    def with_angles(self, change: Callable[[np.ndarray], np.ndarray]) -> MotionSamples:
        """The columns of angles in the file changed, and with them their rates."""
        new = lambda values: change(values * self.angle_scale) / self.angle_scale
        return replace(
            self,
            q=new(self.q - self.offset) + self.offset,
            rate=new(self.rate),
            acceleration=new(self.acceleration),
        )

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
    """The model's matrix (N, n, P) and its goal (N, n), both over the size of every axis' torque; dry (n,):
    RMS of the columns of dry friction."""

    matrix: np.ndarray
    goal: np.ndarray
    dry: np.ndarray

    @cached_property
    def normal(self) -> tuple[np.ndarray, np.ndarray]:
        flat = self.matrix.reshape(-1, self.matrix.shape[2])
        return flat.T @ flat, flat.T @ self.goal.ravel()


def torque_sizes(torque: np.ndarray) -> np.ndarray:
    """(n,) RMS of every axis; never zero."""
    size = np.sqrt(np.mean(torque**2, axis=0))
    return np.maximum(size, 1e-9 * max(size.max(), 1e-9))


def equations(robot: Robot, samples: MotionSamples, size: np.ndarray) -> Equations:
    rows, n = samples.q.shape
    columns = np.zeros((rows, n, 14 * n))
    core = replace(robot, gravity=samples.gravity).core
    columns[:, :, : 10 * n] = _core.dynamics_regressor(
        core, *map(np.ascontiguousarray, (samples.q, samples.rate, samples.acceleration))
    )
    own = (
        robot.controller_ratios**2 * samples.acceleration,
        dry_friction_of(samples.rate / samples.clock),
        samples.rate,
        np.ones_like(samples.rate),
    )
    for k, values in enumerate(own):
        columns[:, np.arange(n), (10 + k) * n + np.arange(n)] = values
    torque = samples.torque
    if samples.carried is not None:
        torque = torque - np.einsum("kip,kp->ki", columns[:, :, 10 * (n - 1) : 10 * n], samples.carried)
    return Equations(columns / size[:, None], torque / size, np.sqrt(np.mean(own[1] ** 2, axis=0)) / size)


def explained(blocks: Sequence[Equations]) -> Explained:
    """By one set of parameters for all blocks."""
    gram, product = (sum(parts) for parts in zip(*(block.normal for block in blocks)))
    length = np.sqrt(np.diag(gram))
    length[length == 0.0] = 1.0
    scaled = gram / np.outer(length, length) + _RIDGE * np.eye(len(length))
    x = np.linalg.solve(scaled, product / length) / length
    left = np.concatenate([block.goal - block.matrix @ x for block in blocks])
    n = left.shape[1]
    dry = np.sqrt(np.mean([block.dry**2 for block in blocks], axis=0))
    return Explained(np.sqrt(np.mean(left**2, axis=0)), x[11 * n : 12 * n] * dry)


def alone(robot: Robot) -> Model:
    """The model of samples by themselves."""
    return lambda samples: explained([equations(robot, samples, torque_sizes(samples.torque))])


def samples_of(robot: Robot, data: Dataset, most: int = MOST_ROWS,
               bandwidth_hz: float | None = None) -> MotionSamples:
    """At most `most` rows, evenly spread; bandwidth_hz: of the low-pass, by default that of the robot."""
    numbers = np.unique(data.run)
    each = max(MOST_LOGGED // len(numbers), 500)
    rows = np.sort(np.concatenate(
        [np.flatnonzero(data.run == number)[:each] for number in numbers[: MOST_LOGGED // 500]]
    ))
    record = motion_record(robot, data.select(rows), bandwidth_hz, _ROWS_SHARE)
    inside, kept = np.flatnonzero(record.inside), np.flatnonzero(record.keep)
    kept = kept[np.unique(np.linspace(0, kept.size - 1, min(kept.size, most)).astype(int))]
    output = lambda values: values[kept] / robot.ratios
    ones = np.ones(robot.axes)
    return MotionSamples(
        output(record.theta) + robot.offsets,
        output(record.theta_dot),
        output(record.theta_ddot),
        record.torque[kept],
        robot.gravity,
        robot.offsets,
        robot.ratios if "theta" in data.joints else ones,
        ones if "tau" in data.joints else robot.controller_ratios,
        record.step * kept,
        record.step * inside,
        record.torque[inside],
        robot.controller.base.rotation,
        carried_bodies(record.data.select(kept)) if data.payload is not None else None,
    )


def dry_friction_of(rate: np.ndarray) -> np.ndarray:
    """The sign of rates (N, n), turning over smoothly."""
    return np.tanh(rate / _SIGN_RAD_S)
