"""Usual mistakes in pose data, each tried: would the error be gone without it?

A mistake is undone in the data (signs, columns, units, zeros, the device's axes, the quaternion's convention,
rows, the tool, the robot file), and the frames are fitted anew, by the two linear least squares of
`linear_frames`: the second RMS is an upper bound of the best one, so that no mistake is named that the frames
could not confirm. Orientations are compared with the same rotation and the best rotation of the tool.
A candidate is named where it lowers the error of positions or orientations `FALL` times and the other not by
less; of an error that arms have, where it leaves less than the calibrated arm (arm_itself.py). It only
tells: nothing is corrected.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy  # scipy.optimize is imported at its first use

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import TRACKED_MOTION
from exactarm.first_aid.arm_itself import left_by_geometry, left_standing
from exactarm.first_aid.axis_mistakes import SUSPICIOUS_SHARE, scales_and_zeros
from exactarm.first_aid.linear_frames import free_frames, least_left, linear_frames, solved
from exactarm.first_aid.lost_readings import lost_targets
from exactarm.first_aid.misfit import (
    LEAST_ORIENTATION_RAD,
    NOT_WORSE,
    ROUNDED,
    Misfit,
    falls_of,
    flanges,
    least_rms,
    misfit_of,
    rms_searched,
    times_as_wide,
)
from exactarm.first_aid.orientation_mistakes import orientation_mistakes
from exactarm.first_aid.pose_candidates import (
    ANOTHER_SIZE,
    FARTHEST_SIZE,
    MIRRORED,
    candidates,
)
from exactarm.first_aid.suspicion import AS_GOOD, FALL, Suspicion, in_order
from exactarm.robot.robot import Placement, Robot

MOST_ROWS = 120  # of a session, evenly spread: a mistake shows in every row
LEAST_ROWS = 10  # of a session: 30 numbers for the 15 unknowns of the linear fit
_LEAST_SHARE = 5e-4  # of the reach: what a wrong clock leaves, less is an arm's own
_CLOCK_GAP_S = 0.2  # at the end of a run: less may be a delay throughout, of which the library knows 0.1 s
_CLOCK_STEP = 1.02
_CLOCKS = tuple(_CLOCK_STEP**k for k in range(-20, 21) if k)
_SPLITS = 15  # of a session's rows, at even distances
_MOST_GROSS = 0.05  # share of rows that may be wrong by themselves
_GROSS = 10.0  # times the median error of a row
_ON_ITS_PLACE_M = 1e-6  # a turntable's flange: its points show neither unit nor base
_MOST_NAMED = 5  # rows, beside the worst
_MOST_CHECKED = 20000  # rows, evenly spread, that are looked through for gross errors


def pose_mistakes(robot: Robot, data: Dataset, carried: Layout, seed: int = 0) -> list[Suspicion]:
    """The mistakes that explain these poses better, best first."""
    if lost := list(lost_targets(data)):
        return lost
    rows = _spread_rows(data)
    if rows is None:
        return []
    whole, data = data, data.select(rows)
    bare = replace(robot, base=Placement(), tool=Placement())
    flange = predict_poses(bare, carried, data, tangents=False)
    now, size = misfit_of(flange.position, flange.rotation, data, data.session, np.inf)
    if np.ptp(flange.position, axis=0).max() < _ON_ITS_PLACE_M:
        return in_order(list(_gross_rows(bare, carried, whole)))
    now = replace(now, position=min(now.position, rms_searched(bare, carried, data, seed)))
    # What was found on this arm says nothing of another one, which may not even have the masses it needs.
    tried = [(words, other, carried if other.name == bare.name else Layout.of(()), changed)
             for words, other, changed in candidates(bare, data, whole, rows, size)]
    turns = now.orientation > LEAST_ORIENTATION_RAD
    falls = falls_of(now, data, [each[1:] for each in tried], 1.0 / NOT_WORSE if turns else FALL)
    found = [Suspicion(each[0], fall) for each, fall in zip(tried, falls) if fall >= FALL]
    found = _mirrored_too(found)
    found += _another_size(bare, carried, data, size, now, seed)
    found += _scaled_columns(bare, carried, data, now)
    found = found or list(_another_clock(bare, carried, data, now, seed))
    if turns or now.position > SUSPICIOUS_SHARE * bare.reach:
        found += scales_and_zeros(bare, data, found, lambda changed: falls_of(
            now, data, [(bare, carried, each) for each in changed]))
    found = found or list(_changes_midway(bare, carried, data, now))
    if found and not turns and now.position < SUSPICIOUS_SHARE * bare.reach:
        geometry = left_by_geometry(bare, carried, data, seed)
        found = [each for each in found if now.position / each.fall < geometry]
    found = found or list(_gross_rows(bare, carried, whole))
    found = found or list(orientation_mistakes(bare, carried, data, now))
    return in_order(found)


def _mirrored_too(found: list[Suspicion]) -> list[Suspicion]:
    """An arm that its mirror image matches moves, with some signs changed, as a mirrored device sees it: both
    are named."""
    ordered = in_order(found)
    falls = [each.fall for each in found if each.words == MIRRORED]
    if not falls or ordered[0].words == MIRRORED or max(falls) < AS_GOOD * ordered[0].fall:
        return found
    both = replace(ordered[0], words=f"{ordered[0].words}, or {MIRRORED}")
    return [both if each is ordered[0] else each for each in found]


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


# -- mistakes that have a size, or a place in the record ---------------------------------------------
def _another_size(bare: Robot, carried: Layout, data: Dataset, size: float, now: Misfit,
                  seed: int) -> Iterator[Suspicion]:
    """All lengths by one factor, with the frames as a calibration finds them: on a line or a circle the
    linear ones are not known."""
    if not ANOTHER_SIZE < abs(size - 1.0) or not 1.0 / FARTHEST_SIZE < size < FARTHEST_SIZE:
        return
    changed = replace(data, position=data.position / size)
    left = max(rms_searched(bare, carried, changed, seed), 1e-12)
    fall = now.position / left * min(times_as_wide(changed, data), 1.0)  # as in `falls_of`
    if fall >= FALL and FALL * left < left_standing(changed):
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
    fall, = falls_of(now, data, [(bare, carried, changed)])
    if fall >= FALL:
        yield Suspicion(f"column {'xyz'[k]} alone {factors[k]:.3g} times as large (inches or feet?)", fall)


def _another_clock(bare: Robot, carried: Layout, data: Dataset, now: Misfit,
                   seed: int) -> Iterator[Suspicion]:
    """A device whose time runs faster or slower than the controller's, from one start of each run on."""
    known = TRACKED_MOTION.name in data.kinds and data.time is not None
    if not known or now.position < _LEAST_SHARE * bare.reach:
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
        return rms_searched(bare, carried, changed.select(within), seed)

    tried = [meant(factor) for factor in _CLOCKS]
    points, rotations = flanges([(bare, carried, changed) for changed, _ in tried])
    least = [float(least_rms(points[[k]][:, within], rotations[[k]][:, within],
                              data.position[None, within], data.session[within])[0])
             for k, (_, within) in enumerate(tried)]
    lowest, factor = np.inf, 1.0
    for k in np.argsort(least):  # no clock leaves less than what any frames do
        if least[k] < ROUNDED * lowest and (found := left(_CLOCKS[k])) < lowest:
            lowest, factor = found, _CLOCKS[k]
    around = (factor / _CLOCK_STEP, factor * _CLOCK_STEP)
    best = scipy.optimize.minimize_scalar(left, bounds=around, method="bounded",
                                          options={"maxiter": 40, "xatol": 1e-5})
    fall = now.position / max(float(best.fun), 1e-12)
    longest = max(float(np.ptp(data.time[data.run == run])) for run in np.unique(data.run))
    if fall >= FALL and abs(float(best.x) - 1.0) * longest > _CLOCK_GAP_S:
        yield Suspicion(f"a device whose time runs {best.x:.4g} times as fast as the controller's", fall)


def _changes_midway(bare: Robot, carried: Layout, data: Dataset, now: Misfit) -> Iterator[Suspicion]:
    """From some row on, another tool or another place of the device."""
    flange, most = predict_poses(bare, carried, data, tangents=False), NOT_WORSE * now.position
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
                found.append(0.0 if least > ROUNDED * most else now.fall_to(
                    misfit_of(flange.position, flange.rotation, data, group, most)[0]))
            return found

        last = rows.size - LEAST_ROWS
        places = np.unique(np.linspace(LEAST_ROWS, last, _SPLITS).astype(int))
        rough = places[int(np.argmax(falls(places)))]
        near = (last - LEAST_ROWS) // _SPLITS + 1
        places = np.arange(max(rough - near, LEAST_ROWS), min(rough + near, last) + 1)
        fall, at = max(zip(falls(places), rows[places].tolist()))
        if fall < FALL:
            continue
        standing = min(left_standing(data.select(part)) for part in (rows[rows < at], rows[rows >= at]))
        if now.position / fall * FALL < standing:
            yield Suspicion(f"another tool, target or device frame from about {data.place_of(at)} on (two "
                            "sessions)", fall)


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
        yield Suspicion(gross_in_words(data, gross, error[gross]), fall)


def gross_in_words(data: Dataset, rows: np.ndarray, error: np.ndarray) -> str:
    """A few rows and what they err by, m: the largest first, the others by their rows."""
    first, *others = rows[np.argsort(-error, kind="stable")]
    told = f"of {error.max():.3g} m in {data.place_of(first)}"
    if not others:
        return f"a gross error {told}"
    named = ", ".join(data.place_of(row) for row in sorted(others)[:_MOST_NAMED])
    more = f" and {len(others) - _MOST_NAMED} more" if len(others) > _MOST_NAMED else ""
    return f"{len(rows)} gross errors, the largest {told} (others in {named}{more})"


def _left(points, rotations, measured, base: np.ndarray, good: np.ndarray) -> np.ndarray:
    """(N,) what frames that fit the good rows leave of all."""
    columns = np.concatenate([np.broadcast_to(np.eye(3), rotations.shape), -rotations], axis=2)
    goal = points - (measured - measured[good].mean(axis=0)) @ base
    return np.linalg.norm(goal - columns @ solved(columns[good], goal[good]), axis=1)
