"""Usual mistakes in motions, each tried on a linear model of the drives: would the torques be explained
without it?

The model is that of `drive_model`. A mistake is named where, undone, it lowers the share of torque that is
left without raising any axis'. Friction that drives tells of a wrong sign by itself: friction takes power
from an axis. Declared masses, or the arm's size, tell of a wrong unit of torque.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import combinations

import numpy as np
import scipy  # scipy.optimize is imported at its first use

from exactarm import _core
from exactarm.chain.motion_record import default_bandwidth
from exactarm.data.dataset import Dataset
from exactarm.first_aid.drive_model import (
    Explained,
    Model,
    MotionSamples,
    alone,
    dry_friction_of,
    samples_of,
    torque_sizes,
)
from exactarm.first_aid.signal_mistakes import LONG_STEP_S
from exactarm.first_aid.suspicion import FALL, Suspicion, in_order
from exactarm.numerics.stamps import typical_step
from exactarm.robot.axes_in_words import axes_in_words
from exactarm.robot.robot import GRAVITY_M_S2, Robot
from exactarm.robot_file import load_robot, shipped_robots

_DEGREE = np.pi / 180.0
_NOT_WORSE = 1.05
# product over the axes, for mistakes that all axes feel a little: gravity, units of angles
_ALL_AXES_FALL = 1.8
_LAGS_S = (0.01, 0.03, 0.1, 0.3, 1.0)  # tried first; what filters and buses delay is below a hundredth
_DRIFTS = (0.0003, 0.001, 0.003, 0.01, 0.03)  # share of the time
_TIMES = (0.4, 0.6, 0.8, 1.2, 1.5, 2.0, 3.0)  # by which all times could be too long
_MUCH_BETTER = 2.0  # times in the product of shares: another robot is free to fit, and said last
_LEAST_TIME = 1.1  # model errors of good data ask for 0.95 (the TX40, and an arm with every mass 30 % off)
_REFINED = 12  # evaluations around the best of those
_LAST_RUN = 0.8  # of the log: more is one run
_MOST_LAG = 0.1  # of the log: what is left to compare overlaps
# Another robot must explain half of the axes so much better: a cause that is missing sits in one or two.
# Of 13 blind racers (bench/blind, wide motions 73400 to 73415 and 94102) under their own file none fell so in
# more than two axes; of 26 pairs under another robot's file 16 are told.
_ROBOT_FALL, _LEAST_OF_A_ROBOT = 1.3, 0.5
# What rest leaves unexplained of the torque of an axis whose angle never changes: of its own spread, and of
# the largest of all axes. Overwritten angles of the TX40 and a UR10 leave 0.31 to 0.92 and 0.12 to 0.55, axes
# that stand still in two blind motions (bench/blind, 97803 and 97812) 0.01 to 0.42 and less than 0.001
_UNEXPLAINED_AT_REST, _OF_THE_LARGEST = 0.2, 0.03
_CERTAIN_FRICTION = 0.03  # share of an axis' torque that its friction takes
# masses are declared better than that; beyond, a payload comes on top
_LEAST_OF_DECLARED, _MOST_OF_DECLARED = 1.0 / 3.0, 10.0
UNITS = {"mNm": 1e-3, "kNm": 1e3, "N cm": 1e-2, "kgf m": 9.80665, "kgf cm": 0.0980665, "lbf ft": 1.355818,
         "lbf in": 0.1129848, "ozf in": 7.061552e-3}  # Nm
_LEAST_SHARE = 0.7  # axes that hardly feel the masses may fit a little worse
_NEAR_A_UNIT = 0.05, 0.3  # of ln: of a unit near Nm, and of others
# 99 % of the largest torque over reach^3, Nm/m^3: six shipped and simulated arms lie between 20 and 400, and
# arms of one build go with the cube
_LEAST_LOAD_NM_M3, _MOST_LOAD_NM_M3 = 0.5, 2000.0

Candidate = tuple[str, MotionSamples]
Rival = tuple[float, Suspicion]  # product of the axes' shares with the mistake undone


def motion_mistakes(robot: Robot, data: Dataset) -> list[Suspicion]:
    """The mistakes that explain these torques better, best first."""
    if not robot.has_geometry or not is_measured_whole(data):
        return []
    samples = samples_of(robot, data)
    now = alone(samples)
    if found := list(_angles_that_never_change(data, samples, now)):
        return found
    model: Model = alone
    if not samples.moves.all():
        model = partial(alone, at_rest=~samples.moves)
        now = model(samples)
    found = undone(candidates(samples), model, now)
    if not found:
        found = list(_driving_friction(now))
    if not found:
        step = typical_step(data.time[data.run == data.run[0]])
        own = min(clocks(model, samples, now, step), key=lambda rival: rival[0], default=None)
        other = next(_other_robot(robot, data, model, now), None)
        better = other and (own is None or _MUCH_BETTER * other[0] < own[0])
        found = [best[1] for best in [other if better else own] if best]
    return found or list(_units(robot, samples))


def _angles_that_never_change(data: Dataset, samples: MotionSamples, now: Explained) -> Iterator[Suspicion]:
    """Of axes whose torque does what no axis at rest asks for."""
    spread = np.std(samples.torque, axis=0)
    left = now.shares * torque_sizes(samples.torque)
    moves = (left > _UNEXPLAINED_AT_REST * spread) & (left > _OF_THE_LARGEST * spread.max())
    name = "theta" if "theta" in data.joints else "q"
    for i in np.flatnonzero((np.ptp(data.joints[name], axis=0) == 0.0) & moves):
        yield Suspicion(
            f"{name}_{i + 1} is the same in every row, and {100.0 * min(left[i] / spread[i], 1.0):.0f} % of "
            "what its torque does is none that an axis at rest asks for: was its angle never measured?")


def undone(tried: Iterator[Candidate], model: Model, now: Explained) -> list[Suspicion]:
    """Those of the mistakes without which the torques are explained better than `now`, best first."""
    found = [Suspicion(words, fall(now, model(changed))) for words, changed in tried]
    return in_order([each for each in found if each.fall])


def is_measured_whole(data: Dataset) -> bool:
    """Whether every axis has a torque: a model of part of the arm's drives compares nothing."""
    torque = [data.joints[name] for name in ("tau", "tau_motor", "current") if name in data.joints]
    return bool(torque) and not np.isnan(np.stack([values[0] for values in torque])).all(axis=0).any()


def fall(now: Explained, other: Explained) -> float:
    """How many times smaller the share of the axis that gains most would be; 0: no better explanation."""
    falls = now.shares / np.maximum(other.shares, 1e-9)
    most, product = float(falls.max()), float(np.prod(falls))
    drives, drove = (np.sum(each.friction < -_CERTAIN_FRICTION) for each in (other, now))
    # where friction still drives, little is explained
    little = most < FALL and (product < _ALL_AXES_FALL or drives)
    if drives > drove or falls.min() < 1.0 / _NOT_WORSE or little:
        return 0.0
    return most


def candidates(samples: MotionSamples) -> Iterator[Candidate]:
    motion = samples.motion
    n, pairs = motion.robot.axes, {}
    yield "degrees labelled as radians", samples.with_angles(lambda values: _DEGREE * values)
    yield "radians labelled as degrees", samples.with_angles(lambda values: values / _DEGREE)
    yield "whole turns labelled as radians", samples.with_angles(lambda values: 2.0 * np.pi * values)
    for i, j in combinations(np.flatnonzero(samples.moves).tolist(), 2):
        order = list(range(n))
        order[i], order[j] = j, i
        exchange = lambda values, order=order: values[:, order]
        pairs[i, j] = samples.with_angles(exchange), exchange
        yield f"the angles of {axes_in_words((i, j))} exchanged", pairs[i, j][0]
        yield f"the torques of {axes_in_words((i, j))} exchanged", samples.with_torques(exchange)
    up = motion.robot.gravity
    none = not up.any()
    if not none:
        yield "gravity pointing the other way", replace(samples, motion=motion.under(-up))
    size = GRAVITY_M_S2 if none else np.linalg.norm(up)
    for k, name in enumerate("xyz"):
        for sign in (1.0, -1.0):
            along = sign * size * motion.robot.controller.base.rotation[k]
            if none or np.linalg.norm(np.cross(along, up)) > 0.5 * size**2:
                yield (f"gravity along {'+' if sign > 0 else '-'}{name} of the base (the arm's mounting)",
                       replace(samples, motion=motion.under(along)))
    for i in range(n):
        other = np.where(np.arange(n) == i, -1.0, 1.0)
        turned = samples.with_angles(lambda values, other=other: values * other)
        yield (f"the opposite sign of axis {i + 1} (angle and torque)",
               turned.with_torques(lambda values, other=other: values * other))
        for angle in (90.0, -90.0, 180.0):
            zero = np.where(np.arange(n) == i, angle * _DEGREE, 0.0)
            words = f"another zero of axis {i + 1} (by {angle:+.0f} degrees)"
            yield words, replace(samples, motion=replace(motion, q=motion.q + zero))
    for pair, (exchanged, exchange) in pairs.items():
        yield f"{axes_in_words(pair)} exchanged", exchanged.with_torques(exchange)


def _driving_friction(now: Explained) -> Iterator[Suspicion]:
    driving = np.flatnonzero(now.friction < -_CERTAIN_FRICTION)
    braking = np.flatnonzero(now.friction > _CERTAIN_FRICTION)
    if driving.size == 0:
        return
    if braking.size == 0 and driving.size > 1:
        yield Suspicion(
            "the friction of all axes would drive the arm: do the torques have the opposite sign?")
        return
    verb = "drives" if driving.size == 1 else "drive"
    sign = "its torque or its angle" if driving.size == 1 else "their torques or their angles"
    yield Suspicion(
        f"the friction of {axes_in_words(driving)} {verb} instead of braking: does {sign} have the opposite "
        "sign?")


def clocks(model: Model, samples: MotionSamples, now: Explained, step: float) -> Iterator[Rival]:
    """Torques or times of another clock; step: of the log, s."""
    if step <= LONG_STEP_S:
        yield from _other_clock(model, samples, now)
    yield from _scaled_time(model, samples, now)


def _other_clock(model: Model, samples: MotionSamples, now: Explained) -> Iterator[Rival]:
    """The torques lag behind the angles, or were logged by a clock that drifts."""
    since = samples.time - samples.logged_time[0]
    most, found = _MOST_LAG * float(since[-1]), []
    step = float(np.median(np.diff(samples.logged_time)))
    shapes = [(np.ones_like(since), _LAGS_S), (since, _DRIFTS)]
    if samples.since[-1] < _LAST_RUN * since[-1]:  # of several runs: clocks that begin together in each
        shapes.append((samples.since, _DRIFTS))
    for shape, tried in shapes:
        @cache
        def late(size: float, shape: np.ndarray = shape) -> Explained:
            return model(samples.with_torques_of(size * shape))

        left = lambda size, late=late: float(np.prod(late(size).shares))

        grid = [sign * size for size in tried for sign in (1.0, -1.0)
                if _LAGS_S[0] <= size * shape.max() <= most]
        if not grid:
            continue
        near = min(grid, key=left)
        around = sorted((0.3 * near, np.sign(near) * min(2.0 * abs(near), most / shape.max())))
        best = float(scipy.optimize.minimize_scalar(left, bounds=around, method="bounded",
                                                    options={"maxiter": _REFINED}).x)
        best = min(near, best, key=left)
        if abs(best * shape.max()) < _LAGS_S[0]:
            continue
        if shape is not shapes[0][0]:
            way = "slower" if best > 0.0 else "faster"
            words = f"torques of a clock that runs {1e2 * abs(best):.2g} % {way} than that of the angles"
            words += " in each run" if shape is samples.since else ""
        else:
            words = f"the torques logged {abs(best):.2g} s {'later' if best > 0.0 else 'earlier'}"
        # interpolation alone takes noise away: as much of it without whole samples is what to compare with
        within = best * shape - step * np.round(best * shape / step)
        interpolated = model(samples.with_torques_of(within))
        better = min(fall(now, late(best)), fall(interpolated, late(best)))
        found.append((left(best), Suspicion(words, better)))
    if found and (best := min(found, key=lambda pair: pair[0]))[1].fall:
        yield best


def _scaled_time(model: Model, samples: MotionSamples, now: Explained) -> Iterator[Rival]:
    """All times too long or too short: masses hold against gravity and acceleration in proportion."""
    @cache
    def at(k: float) -> Explained:
        return model(replace(samples, motion=samples.motion.at(k)))

    left = lambda k: float(np.prod(at(k).shares))
    near = min(_TIMES, key=left)
    best = float(scipy.optimize.minimize_scalar(left, bounds=(0.7 * near, 1.4 * near), method="bounded",
                                                options={"maxiter": _REFINED}).x)
    times, way = max(best, 1.0 / best), "shorter" if best > 1.0 else "longer"
    if times >= _LEAST_TIME and (better := fall(now, at(best))):
        yield left(best), Suspicion(f"all times {times:.2g} times {way}", better)


def _other_robot(robot: Robot, data: Dataset, model: Model, now: Explained) -> Iterator[Rival]:
    """Another robot that is shipped: it need not explain every axis better, for both are free to fit. But it
    is better behind this robot's low-pass, too: behind a narrower one any arm leaves less."""
    bandwidth = default_bandwidth(robot, data)
    for name in shipped_robots():
        other = load_robot(name)
        geared = all(joint.has_gear for joint in other.joints)
        if not other.has_geometry or other.axes != robot.axes or other.name == robot.name or not geared:
            continue
        explained = lambda hz, other=other: model(samples_of(other, data, bandwidth_hz=hz)).shares
        shares = np.maximum(explained(None), 1e-9)
        falls = now.shares / shares
        many = 2 * np.sum(falls >= _ROBOT_FALL) >= robot.axes
        better = many and np.prod(falls) >= _ALL_AXES_FALL and falls.min() >= _LEAST_OF_A_ROBOT
        if better and np.prod(explained(bandwidth)) < np.prod(now.shares):
            yield float(np.prod(shares)), Suspicion(f"data of {name}", float(falls.max()))
            return


def _units(robot: Robot, samples: MotionSamples) -> Iterator[Suspicion]:
    """Torques that declared masses, or an arm of this size, cannot ask for."""
    if robot.links is not None and sum(link.mass for link in robot.links) > 0.0:
        yield from _units_of_masses(robot, samples)
        return
    torque, size = float(np.quantile(np.abs(samples.torque), 0.99, axis=0).max()), robot.reach
    if size > 0.0 and not _LEAST_LOAD_NM_M3 < torque / size**3 < _MOST_LOAD_NM_M3:
        yield Suspicion(
            f"torques of {torque:.3g} Nm at an arm that reaches {size:.2g} m: are they in another unit (mNm, "
            "N cm), or at the motor's shaft?")


def _units_of_masses(robot: Robot, samples: MotionSamples) -> Iterator[Suspicion]:
    """One factor of all torques, beside rotors, friction and constants of every axis that moves (what a brake
    holds is no torque). A unit near Nm is told only where the torques of two axes then follow the declared
    masses, which may be off by as much."""
    moves = samples.moves
    if not moves.any():
        return
    rigid, torque = (values[:, moves] for values in _beside_own_terms(robot, samples))
    share = float(np.sum(rigid * torque) / max(np.sum(rigid**2), 1e-300))
    left = lambda times: np.maximum(np.sqrt(np.mean((torque - times * rigid) ** 2, axis=0)), 1e-9)
    unit, factor = min(UNITS.items(), key=lambda pair: abs(np.log(max(share, 1e-12) * pair[1])))
    near = _NEAR_A_UNIT[0 if _LEAST_OF_DECLARED < factor < 1.0 / _LEAST_OF_DECLARED else 1]
    if not robot.generic_masses and abs(np.log(max(share, 1e-12) * factor)) < near:
        falls = left(1.0) / left(1.0 / factor)
        if falls.min() > _LEAST_SHARE and np.sum(falls > FALL) >= min(2, moves.sum()):
            yield Suspicion(f"{unit} labelled as Nm", float(falls.max()))
            return
    if not _LEAST_OF_DECLARED < share < _MOST_OF_DECLARED:
        yield Suspicion(
            f"the torques are {share:.2g} times those of the declared masses: are they in another unit "
            "(mNm, N cm), at the motor's shaft, or is it the file of another arm?")


def _beside_own_terms(robot: Robot, samples: MotionSamples) -> tuple[np.ndarray, np.ndarray]:
    """(N, n) torques of the declared masses and those measured, over their size, without what rotors,
    friction and constants of each axis may explain."""
    size, motion = torque_sizes(samples.torque), samples.motion
    rigid = _core.inverse_dynamics(robot.core, *motion.arrays) / size
    goal, own = samples.torque / size, np.stack([
        motion.acceleration, dry_friction_of(motion.rate), motion.rate, np.ones_like(motion.rate)], axis=2)
    without = np.stack([np.linalg.qr(own[:, i])[0] for i in range(robot.axes)])
    rest = lambda values: values - np.stack([q @ (q.T @ one) for q, one in zip(without, values.T)], axis=1)
    return rest(rigid), rest(goal)
