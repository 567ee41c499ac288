"""Tracker step: the measuring device was pushed once, and measures from its new place ever since.

measured += shift + turn x measured   on the rows of one session after `at` (time or row), turn in rad about
                                      the device's origin.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.slow_driver import ROW, clock_of, in_order, slow_signal, unit
from exactarm.effects.step_place import likelier_place, places
from exactarm.effects.tracker_drift import moved_device


@dataclass(frozen=True)
class TrackerStep(Effect):
    """Shift of the device in its own axes, with `turn` its rotation too; of one `session`, after `at` on
    `driver`."""

    session: int = 1
    driver: str = ROW
    turn: bool = False
    search: tuple[float, ...] = ()

    name: ClassVar[str] = "tracker_step"
    plain: ClassVar[str] = "a tracker that was pushed"
    station: ClassVar[Station] = Station.DEVICE
    of_record: ClassVar[bool] = True
    kinds: ClassVar[tuple[str, ...]] = WITH_TARGET
    per_joint: ClassVar[bool] = False
    source: ClassVar[str] = "ISO 10360-10 (stability of laser trackers)"

    def parameters(self) -> tuple[Parameter, ...]:
        after = Parameter(f"after_{unit(self.driver)}", 1.0, fixed=True, search=self.search)
        shift = tuple(Parameter(f"{axis}_m", 3e-4) for axis in "xyz")
        turn = tuple(Parameter(f"turn_{axis}_rad", 1e-4, fixed=not self.turn) for axis in "xyz")
        return (after, *shift, *turn)

    def describe(self) -> str:
        size, turn = 1e6 * np.linalg.norm(self.values[1:4]), 1e6 * np.linalg.norm(self.values[4:7])
        more = f" and turns by {turn:.3g} microradians" if self.turn else ""
        return (f"the measuring device jumps by {size:.3g} micrometres{more} after {unit(self.driver)} "
                f"{self.values[0]:.4g} of session {self.session}")

    def to_table(self):
        return super().to_table() | {"session": self.session, "driver": self.driver}

    @classmethod
    def from_table(cls, table) -> Effect:
        raw = cls(None, (), int(table["session"]), table["driver"])
        values = [table[parameter.name] for parameter in raw.parameters()]
        return cls(None, tuple(map(float, values)), raw.session, raw.driver, turn=any(values[4:]))

    def change(self, view) -> Change:
        later = self._later(view.data)[:, None, None]
        value, by_place, by_signal = moved_device(view.measured[:, :3], later, self.values[1:])
        derivative = np.concatenate([np.zeros((view.rows, 3, 1)), by_place], axis=2)
        return Change((0, 1, 2), value, derivative, by_signal)

    def _later(self, data) -> np.ndarray:
        """(N,) 1 after the push, else 0."""
        return ((data.session == self.session) & (slow_signal(data, self.driver) > self.values[0])).astype(
            float
        )

    def moved(self, view) -> Effect:
        """The push at the likeliest jump of the residual near its present place."""
        if view.data.position is None:
            return self
        rows, x = in_order(view.data, self.session, self.driver)
        step = np.asarray(self.values[1:4]) + np.cross(np.asarray(self.values[4:]), view.measured[rows, :3])
        left = (view.data.position - view.measured[:, :3])[rows] + self._later(view.data)[rows, None] * step
        return self.with_values((likelier_place(x, left, step, self.values[0]), *self.values[1:]))

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        data = view.data
        if data.position is None or "measured" not in view.signals:
            return
        driver = clock_of(view)
        for session, _ in view.sessions:
            rows, x = in_order(data, session, driver)
            residual = (data.position - view.measured[:, :3])[rows]
            tried = places(x, residual - residual.mean(axis=0), np.tile(np.eye(3), (rows.size, 1, 1)))
            if tried:
                for turn in (False, True):
                    yield cls(None, (tried[0],) + (0.0,) * 6, session, driver, turn, tried)
