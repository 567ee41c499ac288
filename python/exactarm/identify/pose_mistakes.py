"""Usual mistakes in pose data, each tried: would the error be gone without it?

A mistake is undone in the data (signs, columns, units, zeros, the device's axes, the quaternion's convention,
rows, the tool, the robot file), and the frames are fitted anew. For a candidate this takes two linear least
squares: from
    R_base' (p_measured - p_base) = p_flange + R_flange p_tool
with R_base' replaced by any matrix M (15 unknowns), then with the rotation nearest to M (6 unknowns). The
second RMS is an upper bound of the best one, so that no mistake is named that the frames could not confirm.
Orientations are compared with the same rotation and the best rotation of the tool.
A candidate is named where it lowers the error of positions or orientations `FALL` times and the other not by
less. It only tells: nothing is corrected.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from exactarm.chain import Layout, predict_poses
from exactarm.chain.poses import PosePrediction
from exactarm.dataset import Dataset
from exactarm.identify.frames import find_frames
from exactarm.identify.pose_candidates import ANOTHER_SIZE, FARTHEST_SIZE, candidates
from exactarm.identify.reach import reach
from exactarm.identify.suspicion import FALL, Suspicion, in_order
from exactarm.kinds import TRACKED_MOTION
from exactarm.robot import Placement, Robot
from exactarm.rotation import log as rotation_log
from exactarm.rotation import nearest

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
    found = []
    for words, other, changed in candidates(bare, data, whole, rows, size):
        # What was found on this arm says nothing of another one, which may not even have the masses that it
        # needs.
        own = carried if other.name == bare.name else Layout.of(())
        same = flange if other is bare and changed.joints is data.joints else None
        fall = _fall(now, other, own, changed, same)
        if fall >= FALL:
            found.append(Suspicion(words, fall))
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
            parts.append(
                rows[np.unique(np.linspace(0, rows.size - 1, min(rows.size, MOST_ROWS)).round().astype(int))]
            )
    return np.sort(np.concatenate(parts)) if parts else None


def _searched(bare: Robot, carried: Layout, data: Dataset, seed: int) -> float:
    """RMS with the frames as a calibration would find them."""
    square = 0.0
    for session in np.unique(data.session):
        part = data.select(data.session == session)
        square += len(part) * find_frames(bare, part, carried, seed).rms ** 2
    return float(np.sqrt(square / len(data)))


# -- the misfit of one candidate ---------------------------------------------------------------------
def _fall(now: Misfit, bare: Robot, carried: Layout, changed: Dataset,
          flange: PosePrediction | None = None) -> float:
    """flange: as the arm carries it, where that is known."""
    flange = flange or predict_poses(bare, carried, changed, tangents=False)
    most = _NOT_WORSE * now.position
    return now.fall_to(_misfit_of(flange.position, flange.rotation, changed, changed.session, most)[0])


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


def linear_frames(
    points: np.ndarray, rotations: np.ndarray, measured: np.ndarray, most: float = np.inf
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Rotation of the base frame, offset of the points and tool (6,), what is left of every row (N, 3), and
    the size of the device's points beside the arm's. Where no matrix in place of the rotation leaves less
    than `most` (RMS, m), what that one leaves, and no frames."""
    columns, scale, found = _free(points, rotations, measured)
    bound = points - columns @ found
    if np.sum(bound**2) > most**2 * len(points):
        return np.eye(3), np.zeros(6), bound, 1.0
    centred = measured - measured.mean(axis=0)
    base = nearest(found[:9].reshape(3, 3) / scale).T
    turned, goal = columns[:, :, 9:], points - centred @ base
    target = points + rotations @ found[12:]  # a spread, not a determinant: points may lie on a line
    arm = float(np.sqrt(np.mean((target - target.mean(axis=0)) ** 2)))
    offset = solved(turned, goal)
    return base, offset, goal - turned @ offset, float(np.clip(scale / max(arm, 1e-300), 1e-9, 1e9))


def _free(points: np.ndarray, rotations: np.ndarray,
          measured: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Columns of the linear fit, the size that it takes for one, and its unknowns (15,)."""
    centred = measured - measured.mean(axis=0)
    scale = max(float(np.sqrt(np.mean(centred**2))), 1e-300)
    columns = np.zeros((len(points), 3, 15))
    for k in range(3):
        columns[:, k, 3 * k : 3 * k + 3] = centred / scale
        columns[:, k, 9 + k] = 1.0
    columns[:, :, 12:] = -rotations
    return columns, scale, solved(columns, points)


def free_frames(points: np.ndarray, rotations: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(3, 3) the matrix in place of the base's rotation that fits best; its columns belong to x, y, z."""
    _, scale, found = _free(points, rotations, measured)
    return found[:9].reshape(3, 3) / scale


def linear_tool(points: np.ndarray, rotations: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(3,) the tool point that the linear fit of all frames finds, m."""
    return _free(points, rotations, measured)[2][12:]


def solved(columns: np.ndarray, goal: np.ndarray) -> np.ndarray:
    rows = columns.reshape(-1, columns.shape[2])
    return np.linalg.lstsq(rows, goal.ravel(), rcond=1e-9)[0]


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
    fall = _fall(now, bare, carried, changed)
    if fall >= FALL:
        yield Suspicion(f"column {'xyz'[k]} alone {factors[k]:.3g} times as large (inches or feet?)", fall)


def _another_clock(
    bare: Robot, carried: Layout, data: Dataset, now: Misfit, seed: int
) -> Iterator[Suspicion]:
    """A device whose time runs faster or slower than the controller's, from one start of each run on."""
    known = TRACKED_MOTION.name in data.kinds and data.time is not None
    if not known or now.position < _LEAST_SHARE * reach(bare):
        return

    def fall(factor: float) -> float:
        joints = {name: values.copy() for name, values in data.joints.items() if name in ("theta", "q")}
        within = np.zeros(len(data), bool)
        for run in np.unique(data.run):
            rows = np.flatnonzero(data.run == run)
            start = data.time[rows[0]]
            meant = start + factor * (data.time[rows] - start)
            within[rows] = meant <= data.time[rows[-1]]
            for values in joints.values():
                values[rows] = np.stack([np.interp(meant, data.time[rows], one) for one in values[rows].T], 1)
        changed = replace(data, joints=data.joints | joints).select(within)
        return now.position / max(_searched(bare, carried, changed, seed), 1e-12)

    factor = max(_CLOCKS, key=fall)
    best = minimize_scalar(lambda value: -fall(value), bounds=(factor / _CLOCK_STEP, factor * _CLOCK_STEP),
                           method="bounded", options={"maxiter": 40, "xatol": 1e-5})
    longest = max(float(np.ptp(data.time[data.run == run])) for run in np.unique(data.run))
    if -best.fun >= FALL and abs(float(best.x) - 1.0) * longest > _CLOCK_GAP_S:
        yield Suspicion(f"a device whose time runs {best.x:.4g} times as fast as the controller's",
                        -float(best.fun))


def _scales_of_axes(bare: Robot, carried: Layout, data: Dataset, now: Misfit) -> Iterator[Suspicion]:
    """One axis turns by another factor than its angles say: a wrong gear ratio."""
    if now.position < _SUSPICIOUS_SHARE * reach(bare) and not now.orientation > _LEAST_ORIENTATION_RAD:
        return

    def fall(axis: int, factor: float) -> float:
        joints = {name: data.joints[name].copy() for name in ("theta", "q") if name in data.joints}
        for values in joints.values():
            values[:, axis] *= factor
        return _fall(now, bare, carried, replace(data, joints=data.joints | joints))

    axis, factor = max(
        ((i, factor) for i in range(bare.axes) for factor in _SCALES), key=lambda pair: fall(*pair)
    )
    around = np.sort([1.0, *_SCALES])
    place = int(np.searchsorted(around, factor))
    ends = around[max(place - 1, 0)], around[min(place + 1, len(around) - 1)]
    best = minimize_scalar(
        lambda value: -fall(axis, value),
        bounds=ends,
        method="bounded",
        options={"maxiter": 40, "xatol": 1e-5},
    )
    if -best.fun >= FALL:
        words = f"axis {axis + 1} turning {best.x:.4g} times as far as the data say (its gear ratio?)"
        yield Suspicion(words, -float(best.fun))


def _changes_midway(bare: Robot, carried: Layout, data: Dataset, now: Misfit) -> Iterator[Suspicion]:
    """From some row on, another tool or another place of the device."""
    flange = predict_poses(bare, carried, data, tangents=False)
    for session in np.unique(data.session):
        rows = np.flatnonzero(data.session == session)
        if rows.size < 2 * LEAST_ROWS:
            continue

        def fall(place: int, rows: np.ndarray = rows) -> float:
            group = data.session * 2
            group[rows[place:]] += 1
            return now.fall_to(_misfit_of(flange.position, flange.rotation, data, group,
                                          _NOT_WORSE * now.position)[0])

        last = rows.size - LEAST_ROWS
        places = np.unique(np.linspace(LEAST_ROWS, last, _SPLITS).astype(int))
        rough = max(places, key=fall)
        near = (last - LEAST_ROWS) // _SPLITS + 1
        best = max(
            (fall(place), int(rows[place]))
            for place in range(max(rough - near, LEAST_ROWS), min(rough + near, last) + 1)
        )
        if best[0] >= FALL:
            at = best[1]
            yield Suspicion(
                f"another tool, target or device frame from about {data.place_of(at)} on (two sessions)",
                best[0],
            )


def _gross_rows(bare: Robot, carried: Layout, data: Dataset) -> Iterator[Suspicion]:
    """A few rows that are far off by themselves, with the frames that fit the others."""
    data = data.select(
        np.unique(np.linspace(0, len(data) - 1, min(len(data), _MOST_CHECKED)).round().astype(int))
    )
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
