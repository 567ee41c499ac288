"""Tracker step: the measuring device was pushed once, and measures from its new place ever since.

measured += shift + turn x measured   on the rows of one session after `at` (time or row), turn in rad about
                                      the device's origin.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.slow_driver import ROW, TIME, slow_signal, unit
from exactarm.effects.tracker_drift import moved_device
from exactarm.kinds import WITH_TARGET

_LEAST_ROWS = 5  # on either side
_EVENLY, _PEAKS = 20, 8  # places to try: evenly spread, and where the residual seems to jump
_BESIDE = 2  # rows to either side of such a place
_WINDOW = 0.03  # of the rows of the session: so far the place may move when it is taken anew


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
    kinds: ClassVar[tuple[str, ...]] = WITH_TARGET
    per_joint: ClassVar[bool] = False
    source: ClassVar[str] = "ISO 10360-10 (stability of laser trackers)"

    @property
    def of_record(self) -> bool:
        return True

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

    def renewed(self, view) -> Effect:
        """The push where the residual jumps most likely, near its present place."""
        rows, x = _in_order(view.data, self.session, self.driver)
        if view.data.position is None or rows.size < 2 * _LEAST_ROWS:
            return self
        step = np.asarray(self.values[1:4]) + np.cross(np.asarray(self.values[4:]), view.measured[rows, :3])
        left, shown = (view.data.position
                       - view.measured[:, :3])[rows], self._later(view.data)[rows, None] * step
        # The model that was fitted last has the step already, or not yet.
        left = left + shown if np.sum(left * shown) < 0.5 * np.sum(shown**2) else left
        likely = np.cumsum(np.sum((2.0 * left - step) * step, axis=1)[::-1])[::-1]
        now = int(np.searchsorted(x, self.values[0], side="right"))
        reach = max(1, int(_WINDOW * rows.size))
        low, high = max(now - reach, _LEAST_ROWS), min(now + reach + 1, rows.size - _LEAST_ROWS)
        places = [k for k in range(low, high) if x[k] > x[k - 1]]
        if not places:
            return self
        best = max(places, key=lambda k: likely[k])
        return self.with_values((0.5 * (x[best - 1] + x[best]), *self.values[1:]))

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        data = view.data
        if data.position is None or "measured" not in view.signals:
            return
        # a run may start its clock anew
        clock = data.time is not None and np.ptp(data.time) > 0.0 and not view.is_series
        driver = TIME if clock else ROW
        for session, _ in view.sessions:
            places = _places(view, session, driver)
            if places:
                for turn in (False, True):
                    yield cls(None, (places[0],) + (0.0,) * 6, session, driver, turn, places)


def _in_order(data, session: int, driver: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a session by the driver, and its values there."""
    rows = np.flatnonzero(data.session == session)
    x = slow_signal(data, driver)[rows]
    order = np.argsort(x, kind="stable")
    return rows[order], x[order]


def _places(view, session: int, driver: str) -> tuple[float, ...]:
    """Values of the driver between two rows after which the device may have been pushed."""
    rows, x = _in_order(view.data, session, driver)
    count = rows.size
    if count < 4 * _LEAST_ROWS:
        return ()
    residual = (view.data.position - view.measured[:, :3])[rows]
    sums = np.cumsum(residual - residual.mean(axis=0), axis=0)[:-1]
    k = np.arange(1, count)
    jump = np.sum(sums**2, axis=1) * count / (k * (count - k))  # square sum that two means take away
    inside = slice(_LEAST_ROWS - 1, count - _LEAST_ROWS)
    peaks = k[inside][np.argsort(-jump[inside])[:_PEAKS]]
    beside = (peaks[:, None] + np.arange(-_BESIDE, _BESIDE + 1)).ravel()
    evenly = np.linspace(_LEAST_ROWS, count - _LEAST_ROWS, _EVENLY + 2).astype(int)[1:-1]
    chosen = np.unique(np.clip(np.concatenate([beside, evenly]), _LEAST_ROWS, count - _LEAST_ROWS))
    return tuple(0.5 * (x[i - 1] + x[i]) for i in chosen if x[i] > x[i - 1])
