"""Tracker step: the measuring device was pushed once, and measures from its new place ever since.

measured += shift + turn x measured   on the rows of one session after `at` (time or row), turn in rad about
R -> exp(turn) R                      the device's origin; R: orientations that it measures.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.slow_driver import clock_of
from exactarm.effects.step_in_order import StepInOrder
from exactarm.effects.tracker_drift import moved_device


@dataclass(frozen=True)
class StepOfBody(StepInOrder):
    """A body that moved: values are the place, a shift and, with `turn`, a rotation."""

    turn: bool = False

    per_joint = False

    @classmethod
    def from_table(cls, table) -> Effect:
        found = super().from_table(table)
        return replace(found, turn=any(found.values[4:]))


@dataclass(frozen=True)
class TrackerStep(StepOfBody):
    """Shift of the device in its own axes, with `turn` its rotation too; of one `session`, after `at` on
    `driver`. drawn: the rotation is drawn to zero."""

    drawn: bool = False

    name = "tracker_step"
    plain = "a tracker that was pushed"
    station = Station.DEVICE
    kinds = WITH_TARGET
    source = "ISO 10360-10 (stability of laser trackers)"

    def sizes(self) -> tuple[Parameter, ...]:
        return shift_and_turn(3e-4, 1e-4, self.turn, self.drawn)

    def with_all_terms(self) -> Effect:
        """A tripod that is pushed turns, too: the shift, told at the device's origin, hangs on it."""
        return self if self.turn else replace(self, turn=True, drawn=True)

    def describe(self) -> str:
        return f"the measuring device jumps by {size_in_words(self.values[1:], self.turn)} after {self.where}"

    def shape(self, view):
        return moved_device(view.measured[:, :3], np.ones((view.rows, 1, 1)), self.values[1:])[1]

    def change(self, view) -> Change:
        later = self.acts(view.data)[:, None, None]
        value, by_place, by_signal = moved_device(view.measured[:, :3], later, self.values[1:])
        derivative = np.concatenate([np.zeros((view.rows, 6, 1)), by_place], axis=2)
        return Change(tuple(range(6)), value, derivative, by_signal)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        if view.data.position is None or "measured" not in view.signals:
            return
        for session, _ in view.sessions:
            step = cls(None, (0.0,) * 7, session, clock_of(view))
            tried = step.tried(view)
            if tried:
                for turn in (False, True):
                    yield replace(step, values=(tried[0],) + (0.0,) * 6, turn=turn, search=tried)


def shift_and_turn(shift: float, turn: float, turns: bool, drawn: bool = False) -> tuple[Parameter, ...]:
    """Parameters of a body that moved: `shift` m and `turn` rad are plausible; no turn unless it `turns`;
    drawn: to zero, as far as is plausible."""
    prior = turn if drawn else np.inf
    return (*(Parameter(f"{axis}_m", shift) for axis in "xyz"),
            *(Parameter(f"turn_{axis}_rad", turn, fixed=not turns, prior=prior) for axis in "xyz"))


def size_in_words(values, turns: bool) -> str:
    """Of a body that moved by values (6,): m and rad."""
    size, turn = 1e6 * np.linalg.norm(values[:3]), 1e6 * np.linalg.norm(values[3:])
    more = f" and turns by {turn:.3g} microradians" if turns else ""
    return f"{size:.3g} micrometres{more}"
