"""Usual mistakes in one of several runs of a motion: a file in another unit, of another sign, clock or arm.

All runs are explained by one set of parameters (`drive_model`), with the mistake undone in one run alone: it
is named where that lowers what is left as `motion_mistakes` asks of all rows. Every run counts by its own
torque, or by the usual one where that is more: a run in mNm neither rules the fit nor vanishes in it. Only
where no mistake explains a run, one that its own masses explain `FALL` times better, beside a friction of its
own in either case, carries something else. It only tells.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.first_aid.drive_model import (
    Equations,
    Explained,
    MotionSamples,
    explained,
    samples_of,
    torque_sizes,
)
from exactarm.first_aid.motion_mistakes import (
    UNITS,
    Candidate,
    candidates,
    clocks,
    fall,
    is_measured_whole,
    undone,
)
from exactarm.first_aid.suspicion import FALL, Suspicion, in_order, run_words
from exactarm.numerics.stamps import typical_step
from exactarm.robot.robot import Robot

MOST_RUNS = 30  # more are seldom files of different sources, and each costs a fit
MOST_ROWS, LEAST_ROWS = 1200, 60  # of all runs; of each: 360 numbers for the 84 unknowns of six axes
_AS_GOOD = 0.7  # of the best fall: of two runs either could be the wrong one
_POUND_KG = 0.45359237


@dataclass(frozen=True)
class _Runs:
    """Samples of the runs, the usual size (n,) of torques, and the equations of every run."""

    samples: tuple[MotionSamples, ...]
    usual: np.ndarray
    blocks: tuple[Equations, ...]

    @staticmethod
    def of(robot: Robot, data: Dataset, rows: list[np.ndarray]) -> _Runs:
        most = max(MOST_ROWS // len(rows), LEAST_ROWS)
        samples = tuple(samples_of(robot, data.select(each), most) for each in rows)
        sizes = np.sort([torque_sizes(each.torque) for each in samples], axis=0)
        usual = sizes[(len(rows) - 1) // 2]
        runs = _Runs(samples, usual, ())
        return replace(runs, blocks=tuple(map(runs.block, samples)))

    def block(self, samples: MotionSamples) -> Equations:
        return Equations.of(samples, np.maximum(torque_sizes(samples.torque), self.usual))

    def others(self, run: int) -> tuple[Equations, ...]:
        return self.blocks[:run] + self.blocks[run + 1 :]

    def with_run(self, run: int, samples: MotionSamples) -> Explained:
        return explained((*self.others(run), self.block(samples)))


def odd_runs(robot: Robot, data: Dataset) -> list[Suspicion]:
    """The mistake in one run that explains them all best, best first."""
    if not robot.has_geometry or not is_measured_whole(data):
        return []
    found: list[Suspicion] = []
    sessions = np.unique(data.session) if data.unweighed else [None]  # what these carry is not known
    for session in sessions:
        inside = np.ones(len(data), bool) if session is None else data.session == session
        rows = [np.flatnonzero(inside & (data.run == run)) for run in np.unique(data.run[inside])]
        if 2 <= len(rows) <= MOST_RUNS:
            found += _among(robot, data, rows)
    return in_order(found)


def _among(robot: Robot, data: Dataset, rows: list[np.ndarray]) -> list[Suspicion]:
    runs = _Runs.of(robot, data, rows)
    now = explained(runs.blocks)
    found: list[tuple[int, Suspicion]] = []
    odd = [run for run in range(len(rows)) if _could_fall(runs, run, now)]
    for run in odd:
        model = lambda samples, run=run: runs.with_run(run, samples)
        own = undone(_tried(robot, runs.samples[run]), model, now)
        if not own:
            step = typical_step(data.time[rows[run]])
            own = [min(others, key=lambda rival: rival[0])[1]
                   for others in [list(clocks(model, runs.samples[run], now, step))] if others]
        found += [(run, each) for each in own[:1]]
    found = found or [(run, each) for run in odd for each in _other_masses(runs, run)]
    if not found:
        return []
    best = max(each.fall for _, each in found)
    likely = [(run, each) for run, each in found if each.fall >= _AS_GOOD * best]
    run, told = max(likely, key=lambda pair: pair[1].fall)
    either = " (or the reverse in the other run)" if len(rows) == 2 == len(likely) else ""
    return [replace(told, words=f"{told.words} in {run_words(data, rows[run])}{either}")]


def _could_fall(runs: _Runs, run: int, now: Explained) -> bool:
    """Whether it would be a mistake's fall if this run left nothing at all."""
    rows = sum(len(block.goal) for block in runs.blocks)
    share = 1.0 - len(runs.blocks[run].goal) / rows
    without = explained(runs.others(run))
    return fall(now, replace(without, shares=without.shares * np.sqrt(share))) > 0.0


def _tried(robot: Robot, samples: MotionSamples) -> Iterator[Candidate]:
    yield from candidates(samples)
    yield "torques of the opposite sign", samples.with_torques(lambda values: -values)
    for unit, factor in UNITS.items():
        yield f"{unit} labelled as Nm", samples.with_torques(lambda values, factor=factor: factor * values)
    ratio = np.abs(robot.controller_ratios)
    for words, factor in (("torques of the motors labelled as those behind the gears", ratio),
                          ("torques behind the gears labelled as those of the motors", 1.0 / ratio)):
        yield words, samples.with_torques(lambda values, factor=factor: factor * values)
    for axis in range(len(ratio)):
        sign = np.where(np.arange(len(ratio)) == axis, -1.0, 1.0)
        turned = lambda values, sign=sign: sign * values
        yield f"the opposite sign of the torque of axis {axis + 1}", samples.with_torques(turned)
        yield f"the opposite sign of the angle of axis {axis + 1}", samples.with_angles(turned)
    if samples.carried is not None:
        for words, factor in (("a payload in lb labelled as kg", _POUND_KG), ("no payload", 0.0),
                              ("a payload in g labelled as kg", 1e-3)):
            yield words, replace(samples, carried=factor * samples.carried)


def _other_masses(runs: _Runs, run: int) -> Iterator[Suspicion]:
    """Masses of its own, where friction and zeros of its own do not explain it as well."""
    block = runs.blocks[run]
    common = explained((*runs.others(run), replace(block, own_friction=True))).shares
    own, others = explained([block]).shares, explained(runs.others(run)).shares
    share = len(block.goal) / sum(len(each.goal) for each in runs.blocks)
    apart = np.sqrt(share * own**2 + (1.0 - share) * others**2)
    if (better := float(np.max(common / np.maximum(apart, 1e-9)))) >= FALL:
        yield Suspicion("other masses (payload, tool or robot)", better)
