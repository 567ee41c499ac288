"""Path accuracy and repeatability of an arm in the terms of ISO 9283, where a tracker has followed a path.

A path is driven n times. At m points c_i of the commanded path, with p_ij where cycle j passes the plane
through c_i across the path, and their mean p_i:

    AT = max_i |p_i - c_i|                              path accuracy
    l_ij = |p_ij - p_i|,  RT = max_i (mean l_i + 3 S_li)      path repeatability (S: n - 1)

m. The commanded path is the model's at the angles that the controller reports, mean over the cycles at equal
shares of its length, with the base and tool frame of the certificate's poses: one set-up, one session. The
model is that of an arm at rest, so what speed does counts as an error. Both ends (EDGE of the length) are
left out: there the arm starts and stops beside the planes. Positions alone. The standard asks for 10 cycles,
straight lines and circles in a plane of its cube, three speeds: the rows say which path and how fast.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import predict_poses
from exactarm.chain.direction import direction_of_motion
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.errors import InputError
from exactarm.first_aid.suspicion import FALL
from exactarm.identify.frames import procrustes
from exactarm.identify.match import WORST_SHARE
from exactarm.robot.robot import Robot
from exactarm.verify.day_mistakes import day_mistake
from exactarm.verify.held_out import Judged

POINTS = 201  # of a path; the standard leaves their number to the path
EDGE = 0.02  # of the length at either end
LEAST_CYCLES = 3  # fewer give no standard deviation worth the name
STANDARD_CYCLES = 10
SAME_PATH_M = 2e-3  # two runs whose commanded paths are closer than that are cycles of one path
LEAST_LENGTH_M = 0.01
BESIDE = 3.0  # times the largest error of the judged poses, from which an offset of a whole path is told


@dataclass(frozen=True)
class PathTest:
    """One path: session, cycles, length (m), mean speed (m/s), AT before and after, RT or None (m).

    beside: m, how far its runs lie off as one body, where that is more than the arm can be off; else 0.
    """

    session: int
    cycles: int
    length: float
    speed: float
    accuracy_before: float
    accuracy_after: float
    repeatability: float | None
    beside: float = 0.0


@dataclass(frozen=True)
class _Cycle:
    """One run: commanded paths (POINTS, 3) before and after at equal shares of their length, where the target
    went (N, 3), length and mean speed; beside as of PathTest."""

    session: int
    before: np.ndarray
    after: np.ndarray
    attained: np.ndarray
    length: float
    speed: float
    beside: float


def path_tests(
    robots: tuple[Robot, Robot], judged: tuple[Judged, Judged], files: Sequence[Dataset]
) -> tuple[PathTest, ...]:
    """Of tracked motions, file by file: robots and their fits before and after."""
    sessions = {effect.frames_of for effect in judged[1].fit.layout.effects}
    cycles = []
    for data, session, run in _runs(files):
        rows = data.select((data.session == session) & (data.run == run))
        if int(session) not in sessions:
            raise InputError(
                f"session {session} is not among those of the poses "
                f"({', '.join(map(str, sorted(sessions)))}); expected a path measured in the same set-up",
                file=rows.first_file,
            )
        cycles.append(_cycle(robots, judged, rows))
    return tuple(_test(group) for group in _grouped(cycles))


def _runs(files: Sequence[Dataset]) -> Iterator[tuple[Dataset, int, int]]:
    for data in files:
        for session, run in np.unique(np.stack([data.session, data.run], axis=1), axis=0):
            yield data, int(session), int(run)


def _cycle(robots: tuple[Robot, Robot], judged: tuple[Judged, Judged], rows: Dataset) -> _Cycle:
    assert rows.time is not None and rows.position is not None  # of a tracked motion
    resting = _at_rest(robots[1], rows)
    predicted = [predict_poses(robot, fitted.fit.layout, resting, tangents=False).position
                 for robot, fitted in zip(robots, judged)]
    beside = _beside(robots[1], rows, predicted[1], float(judged[1].error.max()))
    paths = [_at_equal_lengths(path) for path in predicted]
    steps = np.linalg.norm(np.diff(paths[1][0], axis=0), axis=1)
    length = float(steps.sum())
    if length < LEAST_LENGTH_M:
        raise InputError(f"run {rows.run[0]} is {1e3 * length:.1f} mm long; expected a path of "
                         f"{1e3 * LEAST_LENGTH_M:g} mm at least", file=rows.first_file)
    along = paths[1][1]
    inner = (along > EDGE * length) & (along < (1.0 - EDGE) * length)
    seconds = float(np.ptp(rows.time[inner])) if inner.any() else float(np.ptp(rows.time))
    speed = (1.0 - 2.0 * EDGE) * length / max(seconds, 1e-9)
    return _Cycle(int(rows.session[0]), paths[0][0], paths[1][0], rows.position, length, speed, beside)


def _beside(robot: Robot, rows: Dataset, expected: np.ndarray, largest: float) -> float:
    """m that a run lies off as one body; `largest`: error of the judged poses, m. Refuses a run that lies
    where no calibrated arm misses its path."""
    assert rows.position is not None  # of a tracked motion
    most = WORST_SHARE * robot.reach
    away = float(np.sqrt(np.mean(np.sum((rows.position - expected) ** 2, axis=1))))
    if away > most:
        run = f"run {rows.run[0]}"
        meant = day_mistake(run, expected, rows.position, most) or "is it another set-up, robot or unit?"
        raise InputError(
            f"{run} lies {away:.3g} m (RMS) from where the frames of the poses have it; expected less than "
            f"{most:.2g} m: {meant}", file=rows.first_file)
    left = float(np.sqrt(np.mean(np.sum(procrustes(expected, rows.position)[1] ** 2, axis=1))))
    return away if away > BESIDE * largest and left * FALL < away else 0.0


def _at_rest(robot: Robot, rows: Dataset) -> Dataset:
    """The samples as poses, each approached in the direction in which its axes move."""
    name = "theta" if "theta" in rows.joints else "q"
    angles = rows.joints[name]
    sense = 1.0 if name == "theta" else np.sign(robot.ratios)
    direction = np.round(direction_of_motion(rows.time, angles)) * sense
    joints = {key: rows.joints[key] for key in ("q", "theta") if key in rows.joints} | {"approach": direction}
    return replace(rows, kind=POSES.name, kinds=(POSES.name,), joints=joints)


def _at_equal_lengths(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(POINTS, 3) of a path (N, 3), and its length (N,) up to each sample."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    shares = np.linspace(0.0, along[-1], POINTS)
    return np.stack([np.interp(shares, along, path[:, i]) for i in range(3)], axis=1), along


def _grouped(cycles: list[_Cycle]) -> list[list[_Cycle]]:
    groups: list[list[_Cycle]] = []
    for cycle in cycles:
        for group in groups:
            first = group[0]
            away = np.linalg.norm(first.after - cycle.after, axis=1).max()
            if first.session == cycle.session and away < SAME_PATH_M:
                group.append(cycle)
                break
        else:
            groups.append([cycle])
    return groups


def _test(group: list[_Cycle]) -> PathTest:
    attained = [cycle.attained for cycle in group]
    before, _ = measures(np.mean([cycle.before for cycle in group], axis=0), attained)
    after, scatter = measures(np.mean([cycle.after for cycle in group], axis=0), attained)
    mean = lambda values: float(np.mean(values))
    return PathTest(group[0].session, len(group), mean([c.length for c in group]),
                    mean([c.speed for c in group]), before, after, scatter, max(c.beside for c in group))


def measures(command: np.ndarray, attained: list[np.ndarray]) -> tuple[float, float | None]:
    """AT and RT (None with fewer than LEAST_CYCLES) of a commanded path (K, 3), its points evenly spread, and
    of the paths (N_j, 3) that the target went."""
    tangent = np.gradient(command, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    edge = max(int(np.ceil(EDGE * (len(command) - 1))), 1)
    inner = range(edge, len(command) - edge)
    passed = np.array([[_crossing(path, command[i], tangent[i]) for path in attained] for i in inner])
    mean = passed.mean(axis=1)
    accuracy = float(np.linalg.norm(mean - command[edge : len(command) - edge], axis=1).max())
    if len(attained) < LEAST_CYCLES:
        return accuracy, None
    length = np.linalg.norm(passed - mean[:, None], axis=2)
    return accuracy, float((length.mean(axis=1) + 3.0 * length.std(axis=1, ddof=1)).max())


def _crossing(path: np.ndarray, point: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Where a path (N, 3) passes the plane across the command: of several passages the one nearest to it."""
    beyond = (path - point) @ tangent
    k = np.flatnonzero((beyond[:-1] < 0.0) != (beyond[1:] < 0.0))
    if not k.size:  # it turns back before the plane: its nearest sample stands for it
        return path[np.argmin(np.linalg.norm(path - point, axis=1))]
    share = beyond[k] / (beyond[k] - beyond[k + 1])
    crossings = path[k] + share[:, None] * (path[k + 1] - path[k])
    return crossings[np.argmin(np.linalg.norm(crossings - point, axis=1))]
