"""How the dry friction of every axis turns over at a reversal, which no robot file declares:

    by the rate     s = tanh(rate / width): a drive at rest has no friction, as smooth models have it
    by the way      s = mean of stop operators of the motor's angle: behind a reversal
                    s = 1 - 2 exp(-way / (2 reach)), and at rest it stays what it was (Dahl 1968). Not Dahl's
                    equation itself, which forgets by the jitter of an encoder at rest: slipping elements that
                    add up to its curve (Al-Bender, Lampaert and Swevers 2005)

s in [-1, 1] is the sign in every law of friction. What an axis by the way held before it first moved in a
run, nobody has seen: `start`, estimated on rows that are fitted (identify/friction_width.py); without it such
rows do not count.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.effects.drive import smooth_sign, smooth_sign_slope
from exactarm.view import SIGN_WIDTH_RAD_S


@dataclass(frozen=True)
class DryFriction:
    """width (n,) rad/s and reach (n,) rad (m) on the output side, reach 0: by the rate; start (runs, n): s at
    the first sample of each run, None where unknown."""

    width: np.ndarray
    reach: np.ndarray
    start: np.ndarray | None = None

    @staticmethod
    def of(axes: int) -> DryFriction:
        return DryFriction(np.full(axes, SIGN_WIDTH_RAD_S), np.zeros(axes))

    def elsewhere(self) -> DryFriction:
        """The same drives in other runs."""
        return replace(self, start=None)

    def towards(self, proposed: DryFriction, earlier: DryFriction) -> DryFriction:
        """The one proposed; half the way there, by the ratio, of a width or reach that goes back on the step
        from `earlier` to here: what it goes round lies between."""
        alike = ((self.reach > 0.0) == (proposed.reach > 0.0)) & ((self.reach > 0.0) == (earlier.reach > 0.0))
        parts = {}
        for name in ("width", "reach"):
            first, here, there = (getattr(dry, name) for dry in (earlier, self, proposed))
            back = alike & ((there - here) * (here - first) < 0.0)
            parts[name] = np.where(back, np.sqrt(here * there), there)
        return replace(proposed, **parts)

    @property
    def values(self) -> tuple:
        """What tells it from another."""
        return tuple(self.width), tuple(self.reach), None if self.start is None else self.start.tobytes()

    def law(self, index: int) -> tuple:
        """What tells one axis (from 0) from another."""
        begun = None if self.start is None else self.start[:, index].tobytes()
        return float(self.width[index]), float(self.reach[index]), begun

    def begin(self, run: int, index: int) -> float:
        return 0.0 if self.start is None else float(self.start[run, index])

    def sign(self, index: int, rate: np.ndarray, angle: np.ndarray, runs) -> np.ndarray:
        """s (S,) of samples with `rate` and `angle` on the output side; runs: their rows by time."""
        if self.reach[index] == 0.0:
            return smooth_sign(rate, self.width[index])
        found = np.empty_like(rate)
        for number, run in enumerate(runs):
            found[run] = held_sign(angle[run], self.reach[index], self.begin(number, index))
        return found

    def slope_by_rate(self, index: int, rate: np.ndarray) -> np.ndarray:
        """(S,) of s by the rate, of an axis by the rate."""
        return smooth_sign_slope(rate, self.width[index])

    def slope(self, index: int, angle: np.ndarray, runs) -> np.ndarray:
        """(S,) of s by the angle, of an axis by the way."""
        parts = [_elements(angle[run], self.reach[index], self.begin(number, index))
                 for number, run in enumerate(runs)]
        sticking = np.abs(np.concatenate(parts, axis=1)) < 1.0
        return np.mean(sticking / (self.reach[index] * _ELEMENTS[:, None]), axis=0)

    def unsettled(self, record) -> np.ndarray:
        """(N,) rows before an axis by the way has moved so far in its run that its start is forgotten."""
        rows = np.zeros(len(record.inside), bool)
        if self.start is not None:
            return rows
        for index in np.flatnonzero(self.reach):
            rows |= np.any(unsettled_rows(record, index, self.reach[index]), axis=0)
        return rows if not rows.all() else ~rows


# elements of reach a in the density a exp(-a) add up to 1 - exp(-way) from nothing: its quantiles at 1/8,
# 3/8, 5/8, 7/8
_ELEMENTS = np.array([0.609, 1.305, 2.118, 3.607])


def held_sign(angle: np.ndarray, reach: float, begin: float = 0.0) -> np.ndarray:
    """s of one run's angle (S,), `begin` at its first sample."""
    return np.mean(_elements(angle, reach, begin), axis=0)


def _elements(angle: np.ndarray, reach: float, begin: float) -> np.ndarray:
    """(elements, S) stop operators."""
    way, sampled = _through_turns(angle)
    return np.stack([_core.stop_operator(np.concatenate([[way[0] - begin * each], way]), each)[0][1:][sampled]
                     for each in reach * _ELEMENTS])


def _through_turns(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The angle (S,) with the turning points between its samples, the vertices of parabolas through three of
    them, and the places (S,) of the samples in it: an axis turns back where no sample was taken."""
    before, after = np.diff(angle)[:-1], np.diff(angle)[1:]
    turn = np.flatnonzero(before * after < 0.0)
    bend, slope = (after - before)[turn], 0.5 * (after + before)[turn]
    place = turn + np.where(slope * bend < 0.0, 2, 1)  # behind the middle sample, or before it
    vertex = angle[turn + 1] - 0.5 * slope**2 / bend
    sampled = np.arange(angle.size) + np.searchsorted(place, np.arange(angle.size), side="right")
    return np.insert(angle, place, vertex), sampled


def unsettled_rows(record, index: int, reach: float) -> np.ndarray:
    """(runs, N) bool: rows of each run before the axis has moved over twice the reach in it."""
    found = np.zeros((len(record.runs), len(record.inside)), bool)
    for number, (rows, run) in enumerate(zip(record.runs, record.samples.runs)):
        angle = record.samples.angle[run, index][:: record.samples.every]
        way = np.maximum.accumulate(angle) - np.minimum.accumulate(angle)
        found[number, rows] = way < 2.0 * _ELEMENTS[-1] * reach
    return found
