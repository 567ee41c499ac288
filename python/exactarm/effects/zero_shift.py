"""Zero shift: the zero of an axis moved once (collision, slipped belt or coupling, mastering done anew).

q_j += shift   on the rows up to `after` (time or row) of one session, and on all sessions before it: the
               joint offset beside the effect is that of the arm as it is now.
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


@dataclass(frozen=True)
class ZeroShift(Effect):
    """values: after, shift. The shift happened in `session`, after `after` on `driver`, or between it and the
    next."""

    session: int = 1
    driver: str = ROW
    search: tuple[float, ...] = ()

    name: ClassVar[str] = "zero_shift"
    plain: ClassVar[str] = "a zero that moved once (slip, collision, new mastering)"
    in_axis_units: ClassVar[bool] = True
    station: ClassVar[Station] = Station.SPRING
    of_record: ClassVar[bool] = True
    kinds: ClassVar[tuple[str, ...]] = WITH_TARGET
    source: ClassVar[str] = "ISO 9283 (drift); makers' manuals on mastering after a collision"

    def parameters(self) -> tuple[Parameter, ...]:
        after = Parameter(f"after_{unit(self.driver)}", 1.0, fixed=True, search=self.search)
        return (after, Parameter("shift_rad", 3e-4))

    def describe(self) -> str:
        return (f"the zero of axis {self.joint} stood {1e6 * self.values[1]:.3g} µrad off up to "
                f"{unit(self.driver)} {self.values[0]:.4g} of session {self.session}")

    def to_table(self):
        return super().to_table() | {"session": self.session, "driver": self.driver}

    @classmethod
    def from_table(cls, table) -> Effect:
        raw = cls(table["joint"], (), int(table["session"]), table["driver"])
        return raw.with_values(float(table[parameter.name]) for parameter in raw.parameters())

    def change(self, view) -> Change:
        earlier = self._earlier(view.data)[:, None]
        by_parameters = np.stack([np.zeros_like(earlier), earlier], axis=2)
        return Change((self.index,), self.values[1] * earlier, by_parameters)

    def _earlier(self, data) -> np.ndarray:
        """(N,) 1 before the zero moved, else 0."""
        mine = (data.session == self.session) & (slow_signal(data, self.driver) <= self.values[0])
        return (mine | (data.session < self.session)).astype(float)

    def moved(self, view) -> Effect:
        """The shift where the residual jumps most likely, near its present place."""
        if view.data.position is None:
            return self
        rows, x = in_order(view.data, self.session, self.driver)
        if not rows.size or self.values[0] >= x[-1]:
            return self
        back = rows[::-1]  # seen backwards the earlier rows come after the step
        step = self.values[1] * _turned(view, self.index)[back]
        left = (view.data.position - view.measured[:, :3])[back] + self._earlier(view.data)[back, None] * step
        place = -likelier_place(-x[::-1], left, step, -self.values[0])
        return self.with_values((place, self.values[1]))

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        data = view.data
        if data.position is None or "measured" not in view.signals or Station.SPRING not in view.transfers:
            return
        driver, sessions = clock_of(view), [session for session, _ in view.sessions]
        residual = data.position - view.measured[:, :3]
        for axis in range(robot.axes):
            turned = _turned(view, axis)
            for session in sessions:
                rows, x = in_order(data, session, driver)
                tried = places(x, residual[rows], turned[rows, :, None]) if turned[rows].any() else ()
                if session != sessions[-1]:
                    tried = (*tried, float(x[-1]))
                if tried:
                    yield cls(axis + 1, (tried[0], 0.0), session, driver, tried)


def _turned(view, axis: int) -> np.ndarray:
    """(N, 3) m per rad: what a turn of an axis does to the target."""
    return view.transfers[Station.SPRING]((axis,), np.ones((view.rows, 1, 1)))[:, :3, 0]
