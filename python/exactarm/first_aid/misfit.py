"""How far poses are off under the frames that suit them best, as the data stand and with a mistake undone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.first_aid.arm_itself import left_standing
from exactarm.first_aid.linear_frames import least_left, linear_frames
from exactarm.first_aid.suspicion import FALL
from exactarm.identify.frames import find_frames
from exactarm.numerics.rotation import nearest, turn
from exactarm.robot.robot import Robot

NOT_WORSE = 1.2  # positions and orientations are both to fit
LEAST_ORIENTATION_RAD = 0.01  # arms are turned by less than they should be; a wrong convention by more
ROUNDED = 1.0 + 1e-9
_MOST_TOGETHER = 20000  # rows: a few megabytes


@dataclass(frozen=True)
class Misfit:
    """RMS of what the frames leave: position in m, orientation in rad (NaN where none is measured)."""

    position: float
    orientation: float = np.nan

    def shares(self, other: Misfit) -> tuple[float, float]:
        """How many times smaller the other is, in position and in orientation (1: nothing to compare)."""
        position = self.position / max(other.position, 1e-12)
        if not (np.isfinite(self.orientation) and np.isfinite(other.orientation)):
            return position, 1.0
        if self.orientation > LEAST_ORIENTATION_RAD:
            return position, self.orientation / max(other.orientation, 1e-9)
        # orientations that fit already: a mistake undone may not spoil them
        return position, LEAST_ORIENTATION_RAD / max(other.orientation, LEAST_ORIENTATION_RAD)

    def fall_to(self, other: Misfit) -> float:
        """How many times smaller the other is where it is smaller, 0 where it is no better explanation."""
        shares = self.shares(other)
        return max(shares) if min(shares) >= 1.0 / NOT_WORSE else 0.0


def rms_searched(bare: Robot, carried: Layout, data: Dataset, seed: int) -> float:
    """RMS with the frames as a calibration would find them."""
    square = 0.0
    for session in np.unique(data.session):
        part = data.select(data.session == session)
        square += len(part) * find_frames(bare, part, carried, seed).rms ** 2
    return float(np.sqrt(square / len(data)))


def falls_of(now: Misfit, data: Dataset, tried: Sequence[tuple[Robot, Layout, Dataset]],
           least: float = 1.0 / NOT_WORSE) -> list[float]:
    """Of every arm, its effects, and rows in place of those of `data`: 0 where positions gain less than
    `least` times, or nothing else gains, or an arm at rest leaves as much. What no frames can explain is not
    looked at any closer. Of shrunk points an error counts as at their own size: where few axes move, the tool
    takes up any size, and the error shrinks with it."""
    points, rotations = flanges(tried)
    measured = np.stack([changed.position for *_, changed in tried])
    left = least_rms(points, rotations, measured, data.session)
    most, falls = NOT_WORSE * now.position, [0.0] * len(tried)
    for k in np.flatnonzero(~(left > ROUNDED * now.position / least)):
        changed = tried[k][2]
        misfit, _ = misfit_of(points[k], rotations[k], changed, changed.session, most)
        shown = replace(misfit, position=misfit.position / min(times_as_wide(changed, data), 1.0))
        falls[k] = now.fall_to(shown) if FALL * misfit.position < left_standing(changed) else 0.0
    return falls


def times_as_wide(changed: Dataset, data: Dataset) -> float:
    """How many times as far apart as in `data` the points lie."""
    if changed.position is data.position:
        return 1.0
    wide = [sum(np.sum((part - part.mean(axis=0)) ** 2) for part in
                (each.position[each.session == number] for number in np.unique(each.session)))
            for each in (changed, data)]
    return float(np.sqrt(wide[0] / max(wide[1], 1e-300)))


def least_rms(points: np.ndarray, rotations: np.ndarray, measured: np.ndarray,
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


def misfit_of(points: np.ndarray, rotations: np.ndarray, data: Dataset, group: np.ndarray,
              most: float) -> tuple[Misfit, float]:
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
            orientation += float(np.sum(turn(nearest(seen.mean(axis=0)).T @ seen) ** 2))
        orientation = float(np.sqrt(orientation / len(points)))
    return Misfit(position, orientation), float(np.mean(sizes))
