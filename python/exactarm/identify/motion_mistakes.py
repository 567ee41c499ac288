"""Usual mistakes in motions, each tried on a linear model of the drives: would the torques be explained
without it?

    tau = Y(q, q_dot, q_ddot) pi + J ratio^2 q_ddot + coulomb sign(q_dot) + viscous q_dot + constant

Rigid, all of pi, J, friction and constant free (10 n + 4 n unknowns, a trace of ridge for those that the
motion does not show), every axis weighted by its own torque. Share u_i: RMS of what is left of axis i over
that of its torque. A mistake is named where, undone, it lowers u without raising any axis'. Friction that
drives tells of a wrong sign by itself: friction takes power from an axis. Declared
masses, or the arm's size, tell of a wrong unit of torque.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import minimize_scalar

from exactarm import _core
from exactarm.chain import motion_record
from exactarm.dataset import Dataset
from exactarm.identify.reach import reach
from exactarm.identify.signal_mistakes import LONG_STEP_S
from exactarm.identify.suspicion import FALL, Suspicion, in_order, listed
from exactarm.robot import Robot
from exactarm.robot_file import load_robot, shipped_robots
from exactarm.signals import typical_step

MOST_ROWS = 300  # of the linear model: 1,800 numbers for the 84 unknowns of six axes
MOST_LOGGED = 20000  # rows that are filtered for it
_ROWS_SHARE = 0.3
_DEGREE = np.pi / 180.0
_SIGN_RAD_S = 0.02
_RIDGE = 1e-7  # beside columns of length 1
_NOT_WORSE = 1.05
_ALL_AXES_FALL = (
    1.8  # product over the axes, for mistakes that all axes feel a little: gravity, units of angles
)
_LAGS_S = (0.01, 0.03, 0.1, 0.3, 1.0)  # tried first; what filters and buses delay is below a hundredth
_DRIFTS = (0.0003, 0.001, 0.003, 0.01, 0.03)  # share of the time
_TIMES = (0.4, 0.6, 0.8, 1.2, 1.5, 2.0, 3.0)  # by which all times could be too long
_MUCH_BETTER = 2.0  # times in the product of shares: another robot is free to fit, and said last
_LEAST_TIME = 1.1  # model errors of good data ask for 0.95 (the TX40, and an arm with every mass 30 % off)
_REFINED = 12  # evaluations around the best of those
_MOST_LAG = 0.1  # of the log: what is left to compare overlaps
# Another robot must explain half of the axes so much better: a cause that is missing sits in one or two.
# Of 13 blind racers (bench/blind, wide motions 73400 to 73415 and 94102) under their own file none fell so in
# more than two axes; of 26 pairs under another robot's file 16 are told.
_ROBOT_FALL, _LEAST_OF_A_ROBOT = 1.3, 0.5
_CERTAIN_FRICTION = 0.03  # share of an axis' torque that its friction takes
_LEAST_OF_DECLARED, _MOST_OF_DECLARED = (
    1.0 / 3.0,
    10.0,
)  # masses are declared better than that; friction and payload come on top
# 99 % of the largest torque over reach^3, Nm/m^3: six shipped and simulated arms lie between 20 and 400, and
# arms of one build go with the cube
_LEAST_LOAD_NM_M3, _MOST_LOAD_NM_M3 = 0.5, 5000.0


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


@dataclass(frozen=True)
class _Explained:
    """shares (n,) u of every axis; friction (n,): share of an axis' torque that dry friction takes, negative
    where it drives."""

    shares: np.ndarray
    friction: np.ndarray


def motion_mistakes(robot: Robot, data: Dataset) -> list[Suspicion]:
    """The mistakes that explain these torques better, best first."""
    if not robot.has_geometry or not _is_measured_whole(data):
        return []
    samples = samples_of(robot, data)
    now = _explained(robot, samples)
    found = in_order(
        [
            Suspicion(words, fall)
            for words, changed in _candidates(samples)
            if (fall := _fall(now, _explained(robot, changed)))
        ]
    )
    if not found:
        found = list(_driving_friction(now))
    if not found:
        given = (robot, data, samples, now)
        own = min([*_other_clock(*given), *_scaled_time(*given)], key=lambda rival: rival[0], default=None)
        other = next(_other_robot(*given), None)
        better = other and (own is None or _MUCH_BETTER * other[0] < own[0])
        found = [best[1] for best in [other if better else own] if best]
    return found or list(_units(robot, data, samples, now))


def _is_measured_whole(data: Dataset) -> bool:
    """Whether every axis has a torque: a model of part of the arm's drives compares nothing."""
    torque = [data.joints[name] for name in ("tau", "tau_motor", "current") if name in data.joints]
    return bool(torque) and not np.isnan(np.stack([values[0] for values in torque])).all(axis=0).any()


def samples_of(robot: Robot, data: Dataset) -> MotionSamples:
    numbers = np.unique(data.run)
    each = max(MOST_LOGGED // len(numbers), 500)
    rows = np.sort(np.concatenate(
        [np.flatnonzero(data.run == number)[:each] for number in numbers[: MOST_LOGGED // 500]]
    ))
    record = motion_record(robot, data.select(rows), None, _ROWS_SHARE)
    inside, kept = np.flatnonzero(record.inside), np.flatnonzero(record.keep)
    kept = kept[np.unique(np.linspace(0, kept.size - 1, min(kept.size, MOST_ROWS)).astype(int))]
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
    )


def dry_friction_of(rate: np.ndarray) -> np.ndarray:
    """The sign of rates (N, n), turning over smoothly."""
    return np.tanh(rate / _SIGN_RAD_S)


def _explained(robot: Robot, samples: MotionSamples) -> _Explained:
    rows, n = samples.q.shape
    size = np.sqrt(np.mean(samples.torque**2, axis=0))
    size = np.maximum(size, 1e-9 * max(size.max(), 1e-9))
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
    matrix = (columns / size[:, None]).reshape(rows * n, -1)
    goal = samples.torque / size
    length = np.linalg.norm(matrix, axis=0)
    length[length == 0.0] = 1.0
    matrix /= length
    x = np.linalg.solve(matrix.T @ matrix + _RIDGE * np.eye(14 * n), matrix.T @ goal.ravel())
    left = goal - (matrix @ x).reshape(rows, n)
    dry = (x / length)[11 * n : 12 * n] * np.sqrt(np.mean(own[1] ** 2, axis=0)) / size
    return _Explained(np.sqrt(np.mean(left**2, axis=0)), dry)


def _fall(now: _Explained, other: _Explained) -> float:
    """How many times smaller the share of the axis that gains most would be; 0 where the other is no better
    explanation."""
    falls = now.shares / np.maximum(other.shares, 1e-9)
    most, product = float(falls.max()), float(np.prod(falls))
    drives = np.sum(other.friction < -_CERTAIN_FRICTION) > np.sum(now.friction < -_CERTAIN_FRICTION)
    if drives or falls.min() < 1.0 / _NOT_WORSE or (most < FALL and product < _ALL_AXES_FALL):
        return 0.0
    return most


def _candidates(samples: MotionSamples) -> Iterator[tuple[str, MotionSamples]]:
    n = samples.q.shape[1]
    yield "degrees labelled as radians", samples.with_angles(lambda values: _DEGREE * values)
    yield "radians labelled as degrees", samples.with_angles(lambda values: values / _DEGREE)
    yield "whole turns labelled as radians", samples.with_angles(lambda values: 2.0 * np.pi * values)
    for i, j in combinations(range(n), 2):
        order = list(range(n))
        order[i], order[j] = j, i
        yield (
            f"the angles of {listed((i, j))} exchanged",
            samples.with_angles(lambda values, order=order: values[:, order]),
        )
        yield (
            f"the torques of {listed((i, j))} exchanged",
            samples.with_torques(lambda values, order=order: values[:, order]),
        )
    up = samples.gravity
    yield "gravity pointing the other way", replace(samples, gravity=-up)
    for k, name in enumerate("xyz"):
        for sign in (1.0, -1.0):
            along = sign * np.linalg.norm(up) * samples.base_axes[k]
            if np.linalg.norm(np.cross(along, up)) > 0.5 * np.linalg.norm(up) ** 2:
                yield (
                    f"gravity along {'+' if sign > 0 else '-'}{name} of the base (the arm's mounting)",
                    replace(samples, gravity=along),
                )
    for i in range(n):
        other = np.where(np.arange(n) == i, -1.0, 1.0)
        turned = samples.with_angles(lambda values, other=other: values * other)
        yield (
            f"the opposite sign of axis {i + 1} (angle and torque)",
            turned.with_torques(lambda values, other=other: values * other),
        )
        for angle in (90.0, -90.0, 180.0):
            zero = np.where(np.arange(n) == i, angle * _DEGREE, 0.0)
            words = f"another zero of axis {i + 1} (by {angle:+.0f} degrees)"
            yield words, replace(samples, q=samples.q + zero)
    for i, j in combinations(range(n), 2):
        order = list(range(n))
        order[i], order[j] = j, i
        yield (
            f"{listed((i, j))} exchanged",
            samples.with_angles(lambda values, order=order: values[:, order]).with_torques(
                lambda values, order=order: values[:, order]),
        )


def _driving_friction(now: _Explained) -> Iterator[Suspicion]:
    driving = np.flatnonzero(now.friction < -_CERTAIN_FRICTION)
    braking = np.flatnonzero(now.friction > _CERTAIN_FRICTION)
    if driving.size == 0:
        return
    if braking.size == 0 and driving.size > 1:
        yield Suspicion(
            "the friction of all axes would drive the arm: do the torques have the opposite sign?",
            sentence=True,
        )
        return
    verb = "drives" if driving.size == 1 else "drive"
    sign = "its torque or its angle" if driving.size == 1 else "their torques or their angles"
    yield Suspicion(
        f"the friction of {listed(driving)} {verb} instead of braking: does {sign} have the opposite sign?",
        sentence=True,
    )


_Rival = tuple[float, Suspicion]  # product of the axes' shares with the mistake undone


def _other_clock(robot: Robot, data: Dataset, samples: MotionSamples, now: _Explained) -> Iterator[_Rival]:
    """The torques lag behind the angles, or were logged by a clock that drifts."""
    if typical_step(data.time[data.run == data.run[0]]) > LONG_STEP_S:
        return
    since = samples.time - samples.logged_time[0]
    most, found = _MOST_LAG * float(since[-1]), []
    for shape, tried in ((np.ones_like(since), _LAGS_S), (since, _DRIFTS)):
        def left(size: float, shape: np.ndarray = shape) -> float:
            return float(np.prod(_explained(robot, samples.with_torques_of(size * shape)).shares))

        grid = [sign * size for size in tried for sign in (1.0, -1.0)
                if _LAGS_S[0] <= size * shape[-1] <= most]
        if not grid:
            continue
        near = min(grid, key=left)
        around = sorted((0.3 * near, np.sign(near) * min(2.0 * abs(near), most / shape[-1])))
        best = float(minimize_scalar(left, bounds=around, method="bounded", options={"maxiter": _REFINED}).x)
        best = min(near, best, key=left)
        if shape is since:
            way = "slower" if best > 0.0 else "faster"
            words = f"torques of a clock that runs {1e2 * abs(best):.2g} % {way} than that of the angles"
        else:
            words = f"the torques logged {abs(best):.2g} s {'later' if best > 0.0 else 'earlier'}"
        fall = _fall(now, _explained(robot, samples.with_torques_of(best * shape)))
        found.append((left(best), Suspicion(words, fall)))
    if found and (best := min(found, key=lambda pair: pair[0]))[1].fall:
        yield best


def _scaled_time(robot: Robot, data: Dataset, samples: MotionSamples, now: _Explained) -> Iterator[_Rival]:
    """All times too long or too short: masses hold against gravity and against acceleration, in
    proportion."""
    def at(k: float) -> _Explained:
        return _explained(robot, replace(samples, rate=k * samples.rate, clock=k,
                                         acceleration=k**2 * samples.acceleration))

    left = lambda k: float(np.prod(at(k).shares))
    near = min(_TIMES, key=left)
    best = float(minimize_scalar(left, bounds=(0.7 * near, 1.4 * near), method="bounded",
                                 options={"maxiter": _REFINED}).x)
    times, way = max(best, 1.0 / best), "shorter" if best > 1.0 else "longer"
    if times >= _LEAST_TIME and (fall := _fall(now, at(best))):
        yield left(best), Suspicion(f"all times {times:.2g} times {way}", fall)


def _other_robot(robot: Robot, data: Dataset, samples: MotionSamples, now: _Explained) -> Iterator[_Rival]:
    """Another robot that is shipped: it need not explain every axis better, for both are free to fit."""
    for name in shipped_robots():
        other = load_robot(name)
        geared = all(joint.has_gear for joint in other.joints)
        if not other.has_geometry or other.axes != robot.axes or other.name == robot.name or not geared:
            continue
        shares = np.maximum(_explained(other, samples_of(other, data)).shares, 1e-9)
        falls = now.shares / shares
        many = 2 * np.sum(falls >= _ROBOT_FALL) >= robot.axes
        if many and np.prod(falls) >= _ALL_AXES_FALL and falls.min() >= _LEAST_OF_A_ROBOT:
            yield float(np.prod(shares)), Suspicion(f"data of {name}", float(falls.max()))
            return


def _units(robot: Robot, data: Dataset, samples: MotionSamples, now: _Explained) -> Iterator[Suspicion]:
    """Torques far from what declared masses, or an arm of this size, can ask for."""
    torque = float(np.quantile(np.abs(samples.torque), 0.99, axis=0).max())
    if robot.links is not None and sum(link.mass for link in robot.links) > 0.0:
        arrays = map(np.ascontiguousarray, (samples.q, samples.rate, samples.acceleration))
        declared = float(np.quantile(np.abs(_core.inverse_dynamics(robot.core, *arrays)), 0.99, axis=0).max())
        share = torque / max(declared, 1e-12)
        if not _LEAST_OF_DECLARED < share < _MOST_OF_DECLARED:
            yield Suspicion(
                f"the torques are {share:.2g} times those of the declared masses: are they in another unit "
                "(mNm, N cm), at the motor's shaft, or is it the file of another arm?",
                sentence=True,
            )
        return
    size = reach(robot)
    if size > 0.0 and not _LEAST_LOAD_NM_M3 < torque / size**3 < _MOST_LOAD_NM_M3:
        yield Suspicion(
            f"torques of {torque:.3g} Nm at an arm that reaches {size:.2g} m: are they in another unit (mNm, "
            "N cm), or at the motor's shaft?",
            sentence=True,
        )
