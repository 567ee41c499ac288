"""Usual mistakes in a part of the rows: from some row on, in between, or in rows here and there.

The frames that most rows agree on are found by least trimmed squares (Rousseeuw and Leroy 1987): from many
few rows, neighbours or not, the half that fits best is kept and fitted again, until it stays the same. Rows
that are then far off are odd. Every mistake is undone in the odd rows alone, and the frames stay those of the
others: it is named where all rows together then fit `FALL` times better, which no part of them could do by
its own frames. Only where none does, odd rows get frames of their own: another tool or device. It only tells.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.first_aid.linear_frames import frames_of_stack, linear_frames
from exactarm.first_aid.misfit import flanges
from exactarm.first_aid.pose_candidates import Candidate, candidates, turned, with_angles
from exactarm.first_aid.pose_mistakes import LEAST_ROWS, gross_in_words, spread
from exactarm.first_aid.suspicion import FALL, Suspicion, in_order
from exactarm.identify.frames import find_frames
from exactarm.robot.robot import Placement, Robot

MOST_ROWS = 240  # of a session, evenly spread
_PARTS = 8  # neighbours that may be right together
_TRIES, _FEW = 80, 8  # rows picked at random: 24 numbers for the 15 unknowns of the linear frames
# two steps of all starts, then the best of them to the end (Rousseeuw and Van Driessen 1999); the half
# settles after three or four
_FIRST, _BEST, _STEPS = 2, 10, 6
_ODD = 5.0  # times the median error of the better half: of errors normal in three directions none in 1e15
_LEAST_ODD = 3  # rows: fewer are gross errors, which are told by themselves
_MOST_ODD = 0.55  # share: of an even split one half is odd
_MOST_OF_A_RUN = 0.8  # share of its rows
_APART = 0.005  # of the reach: what rows of other poses leave at least, under frames of their own
_GROSS_SHARE = 0.05  # fewer rows than this are told as gross errors
_ZEROS = np.deg2rad(np.concatenate([np.arange(1.0, 10.0), np.arange(10.0, 181.0, 5.0)]))


@dataclass(frozen=True)
class _Frames:
    """What most rows agree on: rotation of the base, centre of the measured points, offset and tool (6,)."""

    base: np.ndarray
    centre: np.ndarray
    offset: np.ndarray

    @staticmethod
    def of(points: np.ndarray, rotations: np.ndarray, measured: np.ndarray) -> _Frames:
        base, offset, *_ = linear_frames(points, rotations, measured)
        return _Frames(base, measured.mean(axis=0), offset)

    def left(self, points: np.ndarray, rotations: np.ndarray, measured: np.ndarray) -> np.ndarray:
        """(..., N) m."""
        goal = points - (measured - self.centre) @ self.base
        return np.linalg.norm(goal - self.offset[:3] + rotations @ self.offset[3:], axis=-1)


def odd_rows(robot: Robot, data: Dataset, carried: Layout, seed: int = 0) -> list[Suspicion]:
    """The mistake in a part of the rows of a session that explains them best, best first."""
    bare = replace(robot, base=Placement(), tool=Placement())
    found: list[Suspicion] = []
    for session in np.unique(data.session):
        rows = np.flatnonzero(data.session == session)
        if len(rows) >= 2 * LEAST_ROWS:
            found += _of_session(bare, carried, data, rows, seed)
    return in_order(found)


def _of_session(bare: Robot, carried: Layout, whole: Dataset, every: np.ndarray,
                seed: int) -> list[Suspicion]:
    """every: all rows of the session, of which `MOST_ROWS` are looked at."""
    rows = every[spread(len(every), MOST_ROWS)]
    data = whole.select(rows)
    flange = predict_poses(bare, carried, data, tangents=False)
    given = flange.position, flange.rotation, data.position
    frames = _agreed(given, np.random.default_rng(seed))
    error = frames.left(*given)
    near = np.sort(error)[: len(error) // 2 + 1]
    odd = _whole_runs(error > _ODD * max(float(np.median(near)), 1e-9), data.run)
    if not _LEAST_ODD <= odd.sum() <= _MOST_ODD * len(error) or len(error) - odd.sum() < LEAST_ROWS:
        return []
    frames = _Frames.of(*(values[~odd] for values in given))
    good = frames.left(*(values[~odd] for values in given))
    # on a line or a circle the linear frames of all rows may be far worse than those that a calibration finds
    now = min(_rms(_Frames.of(*given).left(*given)), find_frames(bare, data, carried, seed).rms)
    if now < FALL * np.sqrt(np.mean(~odd)) * _rms(good):
        return []  # not even if the odd rows had no error at all
    place = _place(whole, rows, odd)
    fall = lambda left: now / max(_rms(np.concatenate([good, left])), 1e-12)
    tried = [(words, changed) for words, other, changed in (*candidates(bare, data, whole, rows, 1.0),
                                                            *_zeros(bare, data)) if other.name == bare.name]
    points, rotations = flanges([(bare, carried, changed.select(odd)) for _, changed in tried])
    left = frames.left(points, rotations, np.stack([changed.position[odd] for _, changed in tried]))
    gains = [(words, fall(each)) for (words, _), each in zip(tried, left)]
    found = [Suspicion(f"{words} {place}", gain) for words, gain in gains if gain >= FALL]
    alone = fall(np.zeros(0))
    if found:
        return found
    if odd.sum() < max(LEAST_ROWS, _GROSS_SHARE * len(data)):  # too few for frames of their own
        flange = predict_poses(bare, carried, whole.select(every), tangents=False)
        error = frames.left(flange.position, flange.rotation, whole.position[every])
        gross = error > _ODD * FALL * _rms(good)
        told = alone >= FALL and gross.any()
        return [Suspicion(gross_in_words(whole, every[gross], error[gross]), alone)] if told else []
    own = _Frames.of(*(values[odd] for values in given)).left(*(values[odd] for values in given))
    if fall(own) >= FALL:
        return [Suspicion(f"another tool, target or device frame {place} (two sessions)", fall(own))]
    if alone >= FALL and _rms(own) > _APART * bare.reach:
        return [Suspicion(f"other angles {place} (positions of other poses, or of another file?)", alone)]
    return []


def _whole_runs(odd: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Nearly all rows of some runs and nearly none of the others are these runs: what is left are rows whose
    mistake does not show, and right ones that are somewhat worse."""
    _, which = np.unique(run, return_inverse=True)
    share = np.bincount(which, odd) / np.bincount(which)
    certain = (share > _MOST_OF_A_RUN) | (share < 1.0 - _MOST_OF_A_RUN)
    return share[which] > _MOST_OF_A_RUN if certain.all() and (share > _MOST_OF_A_RUN).any() else odd


def _agreed(given: tuple[np.ndarray, ...], random: np.random.Generator) -> _Frames:
    """The frames of the half of the rows that fits best."""
    count = len(given[0])
    half = count // 2 + 1
    starts = list(np.array_split(np.arange(count), max(min(_PARTS, count // LEAST_ROWS), 1)))
    starts += [random.choice(count, min(_FEW, count), replace=False) for _ in range(_TRIES)]
    begun = sorted(_settled(given, half, starts, _FIRST), key=lambda pair: pair[0])
    settled = _settled(given, half, [kept for _, kept in begun[:_BEST]], _STEPS)
    _, kept = min(settled, key=lambda pair: pair[0])
    return _Frames.of(*(values[kept] for values in given))


def _settled(given: tuple[np.ndarray, ...], half: int, starts: list[np.ndarray],
             steps: int) -> list[tuple[float, np.ndarray]]:
    """Of each start, the rows of the half that fits best, step by step from those of the start; and their RMS
    error before the last step."""
    ends = [(np.inf, kept) for kept in starts]
    live = range(len(starts))
    for _ in range(steps):
        unlike, sizes = [], [len(ends[k][1]) for k in live]
        for size in set(sizes):
            some = [k for k, own in zip(live, sizes) if own == size]
            left = _left_of(given, np.stack([ends[k][1] for k in some]))
            for k, error in zip(some, left):
                before, kept = ends[k][1], np.sort(np.argsort(error, kind="stable")[:half])
                ends[k] = _rms(error[kept]), kept
                unlike += [] if np.array_equal(kept, before) else [k]
        live = unlike
    return ends


def _left_of(given: tuple[np.ndarray, ...], kept: np.ndarray) -> np.ndarray:
    """(S, N) m that the frames of each of the S sets of rows `kept` leave of all rows."""
    points, rotations, measured = given
    base, offset = frames_of_stack(*(values[kept] for values in given))
    goal = points - (measured - measured[kept].mean(axis=1, keepdims=True)) @ base
    turned = np.einsum("nij,sj->sni", rotations, offset[:, 3:])
    return np.linalg.norm(goal - offset[:, None, :3] + turned, axis=2)


def _zeros(bare: Robot, data: Dataset) -> Iterator[Candidate]:
    """A zero that was lost, by any angle: to a degree below ten, to five above."""
    for axis, joint in enumerate(bare.joints):
        for angle in (*_ZEROS, *-_ZEROS) if joint.type == "revolute" else ():
            words = f"another zero of axis {axis + 1} (by about {np.degrees(angle):+.0f} degrees)"
            yield words, bare, with_angles(data, turned(axis, angle, bare))


def _place(whole: Dataset, rows: np.ndarray, odd: np.ndarray) -> str:
    """Where the odd rows are, in words."""
    first, last = (int(rows[odd][k]) for k in (0, -1))
    inside = (rows >= first) & (rows <= last)
    if odd[inside].mean() > 1.0 - _GROSS_SHARE:
        if last == rows[-1]:
            return f"from about {whole.place_of(first)} on"
        return f"from about {whole.place_of(first)} to {whole.place_of(last)}"
    return f"in about {100.0 * odd.mean():.0f} % of the rows, as in {whole.place_of(first)}"


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2))) if len(error) else 0.0
