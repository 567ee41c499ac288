"""Time series of joint angles: how far the real flange leaves the path that is meant between two corrected
points, and the points in between that keep it there.

The controller joins the points of a series by polynomials in time: straight lines, with velocities cubic
ones, with accelerations besides quintic ones. Corrected points change them by the correction of both ends,

    q_commanded(t) = q(t) + (1 - w) d_0 + w d_1,    w = s, 3 s^2 - 2 s^3, 6 s^5 - 15 s^4 + 10 s^3,

s the share of the time. The correction that the path needs on the way may be another one: error is the
distance of the real flange from the pose that the controller's own chain has at q(t).
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BPoly

from exactarm.compensate.law import CompensationModel
from exactarm.compensate.program import Motion, Program
from exactarm.compensate.straightness import LIMIT, MOST_POINTS, Bend

SAMPLE_RAD = 0.01  # of the axis that turns furthest: gear ripple of a hundred periods a turn has six of them
MOST_SAMPLES, LEAST_SAMPLES = 64, 3  # of a segment
_WEIGHTS = (  # of the correction at the end, by how many derivatives the points have
    lambda s: s,
    lambda s: s**2 * (3.0 - 2.0 * s),
    lambda s: s**3 * (6.0 * s**2 - 15.0 * s + 10.0),
)


def series_bends(
    program: Program, model: CompensationModel, q: np.ndarray, q_after: np.ndarray, tolerance: float
) -> list[Bend]:
    """Segments between corrected points (q, q_after (T, n)) that leave their path by more than `tolerance`
    (m)."""
    pairs = [(a, b) for a, b in zip(program.motions, program.motions[1:])
             if None not in (a.time, b.time, a.target, b.target)
             and not np.isnan(q_after[[a.target, b.target]]).any()
             and not program.targets[b.target].is_pose]
    if not pairs:
        return []
    ways = [_Way(a, b, q) for a, b in pairs]
    off = _off(model, ways, [np.array([0.0, 1.0])] * len(ways),
               [q_after[[a.target, b.target]] for a, b in pairs])
    found = []
    for (before, motion), way, first in zip(pairs, ways, off):
        if first <= tolerance:
            continue
        ends, left, count = q_after[[before.target, motion.target]], first, 0
        while left > LIMIT * tolerance and 2 * count + 1 <= MOST_POINTS:
            count = 2 * count + 1
            knots = np.linspace(0.0, 1.0, count + 2)
            commands = np.vstack([ends[:1], way.commands(model, knots[1:-1]), ends[1:]])
            left = _off(model, [way], [knots], [commands])[0]
        points = [(way.time(s), command, way.derivatives(s))
                  for s, command in zip(knots[1:-1], commands[1:-1])]
        edit = None if motion.insert is None or not left < first else motion.insert(points)
        found.append(
            Bend(motion.target, motion.line, first, first, 0, open=bool(motion.insert) and left >= first)
            if edit is None else Bend(motion.target, motion.line, first, left, count, edit))
    return found


class _Way:
    """One segment of the series as it is meant: joint angles over the share of its time."""

    def __init__(self, before: Motion, motion: Motion, q: np.ndarray):
        self.start, self.duration = before.time, motion.time - before.time
        given = list(zip(before.rates, motion.rates))
        self.order = len(given)
        ends = [np.array([q[before.target], *(rate for rate, _ in given)]),
                np.array([q[motion.target], *(rate for _, rate in given)])]
        self.curve = BPoly.from_derivatives([0.0, self.duration], ends)
        self.samples = int(np.clip(np.ceil(np.abs(q[motion.target] - q[before.target]).max() / SAMPLE_RAD),
                                   LEAST_SAMPLES, MOST_SAMPLES))

    def time(self, share: float) -> float:
        return self.start + share * self.duration

    def at(self, shares: np.ndarray) -> np.ndarray:
        return self.curve(shares * self.duration)

    def derivatives(self, share: float) -> list[np.ndarray]:
        return [self.curve.derivative(k + 1)(share * self.duration) for k in range(self.order)]

    def sides(self, model: CompensationModel, shares: np.ndarray) -> np.ndarray:
        rate = self.curve.derivative()(shares * self.duration)
        return np.sign(rate) * np.sign(model.actual.ratios)

    def commands(self, model: CompensationModel, shares: np.ndarray) -> np.ndarray:
        q = self.at(shares)
        return model.commands(model.controller.poses(q), q, self.sides(model, shares)).q


def _off(
    model: CompensationModel, ways: list[_Way], knots: list[np.ndarray], commands: list[np.ndarray]
) -> np.ndarray:
    """(W,) largest distance of the real flange from each way, whose points at `knots` are commanded."""
    meant, sent, sides, owner = [], [], [], []
    for k, (way, at, command) in enumerate(zip(ways, knots, commands)):
        each = max(way.samples // (len(at) - 1), 2)
        inner = np.arange(1, each) / each
        shares = (at[:-1, None] + inner * np.diff(at)[:, None]).ravel()
        weight = np.tile(_WEIGHTS[way.order](inner), len(at) - 1)[:, None]
        change = command - way.at(at)
        q = way.at(shares)
        meant.append(q)
        sent.append(q + np.repeat(change[:-1], len(inner), axis=0) * (1.0 - weight)
                    + np.repeat(change[1:], len(inner), axis=0) * weight)
        sides.append(way.sides(model, shares))
        owner.append(np.full(len(shares), k))
    wanted = model.controller.poses(np.vstack(meant)).position
    there = model.reached(np.vstack(sent), np.vstack(sides)).position
    off = np.zeros(len(ways))
    np.maximum.at(off, np.concatenate(owner), np.linalg.norm(there - wanted, axis=1))
    return off


