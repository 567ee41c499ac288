"""Steps: what happened once in the order of measurement (a device pushed, a zero or a tool that moved).

In one session, at a place on a slow driver (time or row), the measurement changes by sum_k size_k shape_k.
The effect acts on the rows after the place, or, where the model beside it is that of now, on those before.
Common to all steps is the search for the place and its interval, on what a fit leaves of each row
(step_place.py).
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from exactarm.data.kinds.base import is_a_series
from exactarm.effects.base import Effect, Parameter
from exactarm.effects.slow_driver import ROW, in_order, slow_signal, unit
from exactarm.effects.step_place import LEAST_ROWS, likelier_place, place_between, places

AT_THE_END = 1e9  # row or hour: behind every row of a session, fitted or not
# of a run: where the friction of its drives stood before, shows as long, and looks like a step; chosen, not
# derived: such rows took 0.2 s of slow paths
_BEGINS_S = 1.0


@dataclass(frozen=True)
class StepInOrder(Effect):
    """values: after, then the sizes. The step lies in `session`, after `after` on `driver`."""

    session: int = 1
    driver: str = ROW
    search: tuple[float, ...] = field(default=(), kw_only=True)

    of_record = True
    of_one_session = True
    on_earlier_rows: ClassVar[bool] = False  # acts before the step: the model beside it is that of now

    def sizes(self) -> tuple[Parameter, ...]:
        """The parameters behind the place."""
        raise NotImplementedError

    def shape(self, view) -> np.ndarray:
        """(N, 6, k) what a unit of each size does to position and orientation of the target where it acts."""
        raise NotImplementedError

    def parameters(self) -> tuple[Parameter, ...]:
        after = Parameter(f"after_{unit(self.driver)}", 1.0, fixed=True, search=self.search)
        return (after, *self.sizes())

    @property
    def where(self) -> str:
        """In words: row 12 of session 1."""
        if self.values[0] >= AT_THE_END:
            return f"the end of session {self.session}"
        return f"{unit(self.driver)} {self.values[0]:.4g} of session {self.session}"

    def to_table(self):
        return super().to_table() | {"session": self.session, "driver": self.driver}

    @classmethod
    def from_table(cls, table) -> Effect:
        raw = cls(table.get("joint"), (), int(table["session"]), table["driver"])
        return raw.with_values(float(table[parameter.name]) for parameter in raw.parameters())

    def acts(self, data) -> np.ndarray:
        """(N,) 1 on the rows that it changes, else 0."""
        x, mine = slow_signal(data, self.driver), data.session == self.session
        if not self.on_earlier_rows:
            return (mine & (x > self.values[0])).astype(float)
        before = (data.session < self.session) & self.spans_sessions(data)
        return ((mine & (x <= self.values[0])) | before).astype(float)

    def spans_sessions(self, data) -> bool:
        """Whether all sessions before its own are as the rows before it, and all after as those behind it."""
        return False

    def _least(self, data) -> tuple[int, int]:
        """Rows of its session that must lie before and after it."""
        sides = (np.any(data.session < self.session), np.any(data.session > self.session))
        known, least = self.spans_sessions(data), LEAST_ROWS
        if is_a_series(data):
            steps = np.diff(data.time)
            least = max(least, round(_BEGINS_S / float(np.median(steps[steps > 0.0]))))
        return tuple(1 if known and side else least for side in sides)

    def undecided(self, fitted, other):
        """Rows between the last fitted one before the step and the first one after it."""
        x, t = in_order(fitted, self.session, self.driver)[1], slow_signal(other, self.driver)
        before, after = x[x <= self.values[0]], x[x > self.values[0]]
        if not (before.size and after.size):
            return None
        return (other.session == self.session) & (t > before[-1]) & (t < after[0])

    def moved(self, view) -> Effect:
        """The step at the likeliest jump of the residual near its present place."""
        rows = self._rows(view)
        if rows is None:
            return self
        return self.with_values((likelier_place(*rows, self._least(view.data)), *self.values[1:]))

    def searched_between(self, view):
        rows = self._rows(view)
        return {} if rows is None else {self.parameters()[0].name: place_between(*rows)}

    def _rows(self, view) -> tuple[np.ndarray, np.ndarray, np.ndarray, float] | None:
        """x of the session's rows in their order, their residuals as before and as after the step, and its
        place; None where it lies behind them all, or nothing was measured."""
        rows, x = in_order(view.data, self.session, self.driver)
        left = _left(view)
        if left is None or not rows.size or self.values[0] >= x[-1]:
            return None
        size = self.shown(view) @ np.asarray(self.values[1:])
        bare = (left + self.acts(view.data)[:, None] * size)[rows]
        with_it = bare - size[rows]
        before, after = (with_it, bare) if self.on_earlier_rows else (bare, with_it)
        return x, before, after, self.values[0]

    def tried(self, view) -> tuple[float, ...]:
        """Values of its driver after which it may lie."""
        left, free = _left(view), [not parameter.fixed for parameter in self.sizes()]
        rows, x = in_order(view.data, self.session, self.driver)
        if left is None:
            return ()
        return places(x, left[rows], self.shown(view)[rows][:, :, free], self._least(view.data))

    def shown(self, view) -> np.ndarray:
        """(N, m, k) what a unit of each size does to the numbers of `_left`."""
        if "scale" not in view.signals:
            return self.shape(view)[:, :3]
        scale = view.signals["scale"]
        return view.shown(self.shape(view))[:, : scale.shape[1]] * scale[:, :, None]


def _left(view) -> np.ndarray | None:
    """(N, m) what a fit leaves of the numbers that show the target, in units of their noise where it is
    known; None where nothing was measured."""
    if "scale" in view.signals:
        return view.signals["residual"] * view.signals["scale"]
    if view.data.position is None or "measured" not in view.signals:
        return None
    return view.data.position - view.measured[:, :3]
