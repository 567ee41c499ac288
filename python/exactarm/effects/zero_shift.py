"""Zero shift: the zero of an axis moved once (collision, slipped belt or coupling, mastering done anew).

q_j += shift   on the rows up to `after` (time or row) of one session, and on all sessions before it: the
               joint offset beside the effect is that of the arm as it is now. Between two sessions `after` is
               1e9.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.slow_driver import clock_of
from exactarm.effects.step_in_order import AT_THE_END, StepInOrder


@dataclass(frozen=True)
class ZeroShift(StepInOrder):
    """values: after, shift. The shift happened in `session`, after `after` on `driver`, or between it and the
    next."""

    name = "zero_shift"
    plain = "a zero that moved once (slip, collision, new mastering)"
    in_axis_units = True
    station = Station.SPRING
    on_earlier_rows = True
    kinds = WITH_TARGET
    source = "ISO 9283 (drift); makers' manuals on mastering after a collision"

    def sizes(self) -> tuple[Parameter, ...]:
        return (Parameter("shift_rad", 3e-4),)

    def describe(self) -> str:
        return f"the zero of axis {self.joint} stood {1e6 * self.values[1]:.3g} µrad off up to {self.where}"

    def change(self, view) -> Change:
        earlier = self.acts(view.data)[:, None]
        by_parameters = np.stack([np.zeros_like(earlier), earlier], axis=2)
        return Change((self.index,), self.values[1] * earlier, by_parameters)

    def spans_sessions(self, data):
        return True

    def shape(self, view):
        return view.target_by("q")[:, :, [self.index]]

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        if "measured" not in view.signals or view.target_by("q") is None:
            return
        driver, sessions = clock_of(view), [session for session, _ in view.sessions]
        for axis in range(robot.axes):
            for session in sessions:
                step = cls(axis + 1, (0.0, 0.0), session, driver)
                tried = step.tried(view)
                if session != sessions[-1]:
                    tried = (*tried, AT_THE_END)
                if tried:
                    yield replace(step, values=(tried[0], 0.0), search=tried)
