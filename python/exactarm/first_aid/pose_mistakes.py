"""Usual mistakes in pose data, each tried: would the error be gone without it?

A mistake is undone in the data (signs, columns, units, zeros, the device's axes, the quaternion's convention,
rows, the tool, the robot file), and the frames are fitted anew, by the two linear least squares of
`linear_frames`: the second RMS is an upper bound of the best one, so that no mistake is named that the frames
could not confirm. Orientations are compared with the same rotation and the best rotation of the tool.
A candidate is named where it lowers the error of positions or orientations `FALL` times and the other not by
less. It only tells: nothing is corrected.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import TRACKED_MOTION
from exactarm.first_aid.linear_frames import free_frames, least_left, linear_frames, solved
from exactarm.first_aid.pose_candidates import ANOTHER_SIZE, FARTHEST_SIZE, candidates, scaled, with_angles
from exactarm.first_aid.suspicion import FALL, Suspicion, in_order
from exactarm.identify.frames import find_frames
from exactarm.identify.reach import reach
from exactarm.numerics.rotation import log as rotation_log
from exactarm.numerics.rotation import nearest
from exactarm.robot.robot import Placement, Robot

MOST_ROWS = 120  # of a session, evenly spread: a mistake shows in every row
LEAST_ROWS = 10  # of a session: 30 numbers for the 15 unknowns of the linear fit
_NOT_WORSE = 1.2  # positions and orientations are both to fit
_LEAST_ORIENTATION_RAD = 0.01  # arms are turned by less than they should be; a wrong convention by more
_SCALES = (
    0.5,
    0.8,
    0.9,
    0.95,
    1.05,
    1.1,
    1.25,
    2.0,
)  # wrong ratios of gears, from which the best one is looked for
_SUSPICIOUS_SHARE = 0.005  # of the reach: a whole axis that turns wrongly leaves more
_LEAST_SHARE = 5e-4  # of the reach: what a wrong clock leaves, less is an arm's own
_CLOCK_GAP_S = 0.2  # at the end of a run: less may be a delay throughout, of which the library knows 0.1 s
_CLOCK_STEP = 1.02
_CLOCKS = tuple(_CLOCK_STEP**k for k in range(-20, 21) if k)
_SPLITS = 15  # of a session's rows, at even distances
_MOST_GROSS = 0.05  # share of rows that may be wrong by themselves
_GROSS = 10.0  # times the median error of a row
_ON_ITS_PLACE_M = 1e-6  # a turntable's flange: its points show neither unit nor base
_ROUNDED = 1.0 + 1e-9
_MOST_TOGETHER = 20000  # rows: a few megabytes
_MOST_CHECKED = 20000  # rows, evenly spread, that are looked through for gross errors


@dataclass(frozen=True)
class Misfit:
    """RMS of what the frames leave: position in m, orientation in rad (NaN where none is measured)."""

    position: float
    orientation: float = np.nan

    def shares(self, other: Misfit) -> tuple[float, float]:
        """How many times smaller the other is, in position and in orientation (1 where there is nothing to
        compare)."""
        position = self.position / max(other.position, 1e-12)
        told = self.orientation > _LEAST_ORIENTATION_RAD and np.isfinite(other.orientation)
        return position, self.orientation / max(other.orientation, 1e-9) if told else 1.0

    def fall_to(self, other: Misfit) -> float:
        """How many times smaller the other is where it is smaller, 0 where it is no better explanation."""
        shares = self.shares(other)
        return max(shares) if min(shares) >= 1.0 / _NOT_WORSE else 0.0


def pose_mistakes(robot: Robot, data: Dataset, carried: Layout, seed: int = 0) -> list[Suspicion]:
    """The mistakes that explain these poses better, best first."""
    rows = _spread_rows(data)
    if rows is None:
        return []
    whole, data = data, data.select(rows)
    bare = replace(robot, base=Placement(), tool=Placement())
    flange = predict_poses(bare, carried, data, tangents=False)
    now, size = _misfit_of(flange.position, flange.rotation, data, data.session, np.inf)
    if np.ptp(flange.position, axis=0).max() < _ON_ITS_PLACE_M:
        return in_order(list(_gross_rows(bare, carried, whole)))
    now = replace(now, position=min(now.position, _searched(bare, carried, data, seed)))
    # What was found on this arm says nothing of another one, which may not even have the masses it needs.
    tried = [(words, other, carried if other.name == bare.name else Layout.of(()), changed)
             for words, other, changed in candidates(bare, data, whole, rows, size)]
    turns = now.orientation > _LEAST_ORIENTATION_RAD
    falls = _falls(now, data, [each[1:] for each in tried], 1.0 / _NOT_WORSE if turns else FALL)
    found = [Suspicion(each[0], fall) for each, fall in zip(tried, falls) if fall >= FALL]
    found += _another_size(bare, carried, data, size, now, seed)
    found += _scaled_columns(bare, carried, data, now)
    found = found or list(_another_clock(bare, carried, data, now, seed))
    for further in (_scales_of_axes, _changes_midway):
        found = found or list(further(bare, carried, data, now))
    found = found or list(_gross_rows(bare, carried, whole))
    # positions that an arm may miss by, or that a tenth of the turns would make at a lever of 0.3 m
    least = max(_LEAST_ORIENTATION_RAD, 0.1 * np.nan_to_num(now.orientation))
    told = now.orientation > _LEAST_ORIENTATION_RAD and now.position < 0.3 * least
    if not found and told and _turns_otherwise(bare, carried, data) > least:
        found.append(
            Suspicion(
                f"the measured orientations do not follow the arm ({now.orientation:.2g} rad RMS beside "
                f"{1e3 * now.position:.2g} mm): "
                "are they angles of another convention, a quaternion in another order, or rows shuffled?",
                np.inf,
                sentence=True,
            )
        )
    return in_order(found)


def _spread_rows(data: Dataset) -> np.ndarray | None:
    """Rows of the sessions that can tell, in the order of the data."""
    parts = []
    for session in np.unique(data.session):
        rows = np.flatnonzero(data.session == session)
        if rows.size >= LEAST_ROWS:
            parts.append(rows[spread(rows.size, MOST_ROWS)])
    return np.sort(np.concatenate(parts)) if parts else None


def spread(count: int, most: int) -> np.ndarray:
    """At most `most` of `count` rows, at even distances."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def _searched(bare: Robot, carried: Layout, data: Dataset, seed: int) -> float:
    """RMS with the frames as a calibration would find them."""
    square = 0.0
    for session in np.unique(data.session):
        part = data.select(data.session == session)
        square += len(part) * find_frames(bare, part, carried, seed).rms ** 2
    return float(np.sqrt(square / len(data)))


# -- the misfit of one candidate ---------------------------------------------------------------------
def _falls(now: Misfit, data: Dataset, tried: Sequence[tuple[Robot, Layout, Dataset]],
           least: float = 1.0 / _NOT_WORSE) -> list[float]:
    """Of every arm, its effects, and rows in place of those of `data`: 0 where positions gain less than
    `least` times, or nothing else gains. What no frames can explain is not looked at any closer."""
    points, rotations = flanges(tried)
    measured = np.stack([changed.position for *_, changed in tried])
    left = _least_rms(points, rotations, measured, data.session)
    most, falls = _NOT_WORSE * now.position, [0.0] * len(tried)
    for k in np.flatnonzero(~(left > _ROUNDED * now.position / least)):
        changed = tried[k][2]
        falls[k] = now.fall_to(_misfit_of(points[k], rotations[k], changed, changed.session, most)[0])
    return falls


def _least_rms(points: np.ndarray, rotations: np.ndarray, measured: np.ndarray,
               session: np.ndarray) -> np.ndarray:
    """(K,) m: what no frames can lower, of K sets (K, N, ...) of rows."""
    parts = [session == number for number in np.unique(session)]
    square = sum(least_left(points[:, rows], rotations[:, rows], measured[:, rows]) for rows in parts)
    return np.sqrt(square / len(session))


def flanges(tried: Sequence[tuple[Robot, Layout, Dataset]]) -> tuple[np.ndarray, np.ndarray]:
    """Positions (K, N, 3) and rotations (K, N, 3, 3) of the flange: data that differ in their angles
    alone are evaluated together, save by effects, which may look at the order of rows."""
    count, alike = len(tried[0][2]), {}
    position, rotation = np.empty((len(tried), count, 3)), np.empty((len(tried), count, 3, 3))
    for k, (robot, layout, _) in enumerate(tried):
        alike.setdefault((id(robot), k if layout.effects else None), []).append(k)
    for places in alike.values():
        robot, layout, data = tried[places[0]]
        for part in np.array_split(places, -(-len(places) * count // _MOST_TOGETHER)):
            rows = data.select(np.tile(np.arange(count), len(part)))
            joints = {name: np.concatenate([tried[k][2].joints[name] for k in part]) for name in data.joints}
            flange = predict_poses(robot, layout, replace(rows, joints=joints), tangents=False)
            position[part] = flange.position.reshape(-1, count, 3)
            rotation[part] = flange.rotation.reshape(-1, count, 3, 3)
    return position, rotation


def _misfit_of(
    points: np.ndarray, rotations: np.ndarray, data: Dataset, group: np.ndarray, most: float
) -> tuple[Misfit, float]:
    """The misfit of all groups of rows together, each with frames of its own, and how many times as far apart
    as the robot says the points lie. Where positions are off by more than `most`, m, they may be off by even
    more, and orientations are not looked at."""
    position, orientation, bases, sizes = 0.0, np.nan, [], []
    parts = [np.flatnonzero(group == number) for number in np.unique(group)]
    for rows in parts:
        enough = most * np.sqrt(len(points) / rows.size)
        base, _, left, size = linear_frames(points[rows], rotations[rows], data.position[rows], enough)
        bases.append(base)
        sizes.append(size)
        position += float(np.sum(left**2))
    position = float(np.sqrt(position / len(points)))
    if data.rotation is not None and not position > most:
        orientation = 0.0
        for rows, base in zip(parts, bases):
            seen = np.swapaxes(rotations[rows], -1, -2) @ base.T @ data.rotation[rows]
            orientation += float(np.sum(rotation_log(nearest(seen.mean(axis=0)).T @ seen) ** 2))
        orientation = float(np.sqrt(orientation / len(points)))
    return Misfit(position, orientation), float(np.mean(sizes))


def _turns_otherwise(bare: Robot, carried: Layout, data: Dataset) -> float:
    """RMS, rad, of the angle between two rows as measured, less that of the arm: no frame changes either."""
    flange = predict_poses(bare, carried, data, tangents=False).rotation
    one, other = np.arange(len(data)), np.roll(np.arange(len(data)), len(data) // 2)
    same = data.session[one] == data.session[other]
    turned = lambda rotation: np.linalg.norm(rotation_log(
        np.swapaxes(rotation[one[same]], -1, -2) @ rotation[other[same]]), axis=1)
    off = turned(data.rotation) - turned(flange)
    return float(np.sqrt(np.mean(off**2))) if off.size else np.inf


# -- mistakes that have a size, or a place in the record ---------------------------------------------
def _another_size(
    bare: Robot, carried: Layout, data: Dataset, size: float, now: Misfit, seed: int
) -> Iterator[Suspicion]:
    """All lengths by one factor, with the frames as a calibration finds them: on a line or a circle the
    linear ones are not known."""
    if not ANOTHER_SIZE < abs(size - 1.0) or not 1.0 / FARTHEST_SIZE < size < FARTHEST_SIZE:
        return
    changed = replace(data, position=data.position / size)
    fall = now.position / max(_searched(bare, carried, changed, seed), 1e-12)
    if fall >= FALL:
        yield Suspicion(f"the file of an arm {1.0 / size:.3g} times as large as the measured one (or lengths "
                        f"of the device {size:.3g} times too large)", fall)


def _scaled_columns(bare: Robot, carried: Layout, data: Dataset, now: Misfit) -> Iterator[Suspicion]:
    """One of x, y, z in another unit: the free matrix of the linear fit shows the size of each column."""
    flange = predict_poses(bare, carried, data, tangents=False)
    square = np.zeros(3)
    for session in np.unique(data.session):
        rows = data.session == session
        free = free_frames(flange.position[rows], flange.rotation[rows], data.position[rows])
        square += rows.sum() * np.sum(free**2, axis=0)
    sizes = np.sqrt(square / len(data))
    factors = sizes / np.median(sizes)
    k = int(np.argmax(np.abs(np.log(factors))))
    if not ANOTHER_SIZE < abs(factors[k] - 1.0) or not 1.0 / FARTHEST_SIZE < factors[k] < FARTHEST_SIZE:
        return
    changed = replace(data, position=data.position * np.where(np.arange(3) == k, factors[k], 1.0))
    fall, = _falls(now, data, [(bare, carried, changed)])
    if fall >= FALL:
        yield Suspicion(f"column {'xyz'[k]} alone {factors[k]:.3g} times as large (inches or feet?)", fall)


def _another_clock(
    bare: Robot, carried: Layout, data: Dataset, now: Misfit, seed: int
) -> Iterator[Suspicion]:
    """A device whose time runs faster or slower than the controller's, from one start of each run on."""
    known = TRACKED_MOTION.name in data.kinds and data.time is not None
    if not known or now.position < _LEAST_SHARE * reach(bare):
        return

    def meant(factor: float) -> tuple[Dataset, np.ndarray]:
        """All rows at their own times, and those that lie within their run."""
        joints = {name: values.copy() for name, values in data.joints.items() if name in ("theta", "q")}
        within = np.zeros(len(data), bool)
        for run in np.unique(data.run):
            rows = np.flatnonzero(data.run == run)
            start = data.time[rows[0]]
            at = start + factor * (data.time[rows] - start)
            within[rows] = at <= data.time[rows[-1]]
            for values in joints.values():
                values[rows] = np.stack([np.interp(at, data.time[rows], one) for one in values[rows].T], 1)
        return replace(data, joints=data.joints | joints), within

    def left(factor: float) -> float:
        changed, within = meant(factor)
        return _searched(bare, carried, changed.select(within), seed)

    tried = [meant(factor) for factor in _CLOCKS]
    points, rotations = flanges([(bare, carried, changed) for changed, _ in tried])
    least = [float(_least_rms(points[[k]][:, within], rotations[[k]][:, within],
                              data.position[None, within], data.session[within])[0])
             for k, (_, within) in enumerate(tried)]
    lowest, factor = np.inf, 1.0
    for k in np.argsort(least):  # no clock leaves less than what any frames do
        if least[k] < _ROUNDED * lowest and (found := left(_CLOCKS[k])) < lowest:
            lowest, factor = found, _CLOCKS[k]
    best = minimize_scalar(left, bounds=(factor / _CLOCK_STEP, factor * _CLOCK_STEP), method="bounded",
                           options={"maxiter": 40, "xatol": 1e-5})
    fall = now.position / max(float(best.fun), 1e-12)
    longest = max(float(np.ptp(data.time[data.run == run])) for run in np.unique(data.run))
    if fall >= FALL and abs(float(best.x) - 1.0) * longest > _CLOCK_GAP_S:
        yield Suspicion(f"a device whose time runs {best.x:.4g} times as fast as the controller's", fall)


def _scales_of_axes(bare: Robot, carried: Layout, data: Dataset, now: Misfit) -> Iterator[Suspicion]:
    """One axis turns by another factor than its angles say: a wrong gear ratio."""
    if now.position < _SUSPICIOUS_SHARE * reach(bare) and not now.orientation > _LEAST_ORIENTATION_RAD:
        return

    def falls(pairs: list[tuple[int, float]]) -> list[float]:
        return _falls(now, data, [(bare, carried, with_angles(data, scaled([axis], factor)))
                                  for axis, factor in pairs])

    pairs = [(i, factor) for i in range(bare.axes) for factor in _SCALES]
    axis, factor = pairs[int(np.argmax(falls(pairs)))]
    around = np.sort([1.0, *_SCALES])
    place = int(np.searchsorted(around, factor))
    ends = around[max(place - 1, 0)], around[min(place + 1, len(around) - 1)]
    best = minimize_scalar(
        lambda value: -falls([(axis, value)])[0],
        bounds=ends,
        method="bounded",
        options={"maxiter": 40, "xatol": 1e-5},
    )
    if -best.fun >= FALL:
        words = f"axis {axis + 1} turning {best.x:.4g} times as far as the data say (its gear ratio?)"
        yield Suspicion(words, -float(best.fun))


def _changes_midway(bare: Robot, carried: Layout, data: Dataset, now: Misfit) -> Iterator[Suspicion]:
    """From some row on, another tool or another place of the device."""
    flange, most = predict_poses(bare, carried, data, tangents=False), _NOT_WORSE * now.position
    for session in np.unique(data.session):
        rows = np.flatnonzero(data.session == session)
        if rows.size < 2 * LEAST_ROWS:
            continue

        given = flange.position[rows], flange.rotation[rows], np.insert(data.position[rows], 3, 1.0, axis=1)

        def falls(places: np.ndarray, rows: np.ndarray = rows, given: tuple = given) -> list[float]:
            later = np.arange(rows.size) >= places[:, None]
            square = sum(least_left(*(np.einsum("kn,n...->kn...", part, values) for values in given))
                         for part in (later, ~later))
            found = []
            for place, least in zip(places, np.sqrt(square / len(data))):
                group = data.session * 2
                group[rows[place:]] += 1
                found.append(0.0 if least > _ROUNDED * most else now.fall_to(
                    _misfit_of(flange.position, flange.rotation, data, group, most)[0]))
            return found

        last = rows.size - LEAST_ROWS
        places = np.unique(np.linspace(LEAST_ROWS, last, _SPLITS).astype(int))
        rough = places[int(np.argmax(falls(places)))]
        near = (last - LEAST_ROWS) // _SPLITS + 1
        places = np.arange(max(rough - near, LEAST_ROWS), min(rough + near, last) + 1)
        best = max(zip(falls(places), rows[places].tolist()))
        if best[0] >= FALL:
            at = best[1]
            yield Suspicion(
                f"another tool, target or device frame from about {data.place_of(at)} on (two sessions)",
                best[0],
            )


def _gross_rows(bare: Robot, carried: Layout, data: Dataset) -> Iterator[Suspicion]:
    """A few rows that are far off by themselves, with the frames that fit the others."""
    data = data.select(spread(len(data), _MOST_CHECKED))
    flange = predict_poses(bare, carried, data, tangents=False)
    error = np.zeros(len(data))
    for session in np.unique(data.session):
        rows = np.flatnonzero(data.session == session)
        if rows.size < LEAST_ROWS:
            continue
        good = np.ones(rows.size, bool)
        for _ in range(10):
            part = rows[good]
            base, *_ = linear_frames(flange.position[part], flange.rotation[part], data.position[part])
            left = _left(flange.position[rows], flange.rotation[rows], data.position[rows], base, good)
            before, good = good, left <= _GROSS * max(float(np.median(left)), 1e-9)
            if np.array_equal(before, good):
                break
        error[rows] = left
    gross = np.flatnonzero(error > _GROSS * max(float(np.median(error)), 1e-9))
    if not 0 < gross.size <= max(1, _MOST_GROSS * len(data)):
        return
    rms = lambda values: float(np.sqrt(np.mean(values**2)))
    fall = rms(error) / max(rms(np.delete(error, gross)), 1e-12)
    if fall >= FALL:
        at = gross[np.argmax(error[gross])]
        count = f"{gross.size} gross errors, the largest" if gross.size > 1 else "a gross error"
        yield Suspicion(f"{count} of {error[at]:.3g} m in {data.place_of(at)}", fall)


def _left(points, rotations, measured, base: np.ndarray, good: np.ndarray) -> np.ndarray:
    """(N,) what frames that fit the good rows leave of all."""
    columns = np.concatenate([np.broadcast_to(np.eye(3), rotations.shape), -rotations], axis=2)
    goal = points - (measured - measured[good].mean(axis=0)) @ base
    return np.linalg.norm(goal - columns @ solved(columns[good], goal[good]), axis=1)
