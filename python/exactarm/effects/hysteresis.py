"""Hysteresis: friction inside a drive holds back a part of its wind-up; the joint lags behind in the way it
came.

change of q = -size * m,   m in [-1, 1]: the memory of the motion.

Sign: a positive size lags, as friction makes it: an axis that came upwards (approach +1, growing angle)
stands at a smaller angle than its motor says. A negative size runs ahead, which no friction does: look for
approach columns of the other sign.

Static poses: m = the approach direction, and friction that grows with the load of the joint, as that of
gears does, adds per_load |torque| to the size where the data ask for it. With `by_rows` and no approach
column m is that of a pose which was reached straight from the one of the row before: an assumption, which the
description says.

Time series: m is the stop operator of the output motion with the given reach (a spring in series with dry
friction: Maxwell-slip element, Al-Bender et al. 2005), m = +-1 after a motion of twice the reach. The motion
is that of the motor at the nominal ratio, so m does not depend on other parameters.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm import _core
from exactarm.data.kinds import ALL_KINDS, Device
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.change import CERTAIN

_REACHES_RAD = (3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1)


@dataclass(frozen=True)
class Hysteresis(Effect):
    """values: half the width of the loop at the output, then in time series the reach of the memory, or of
    poses, `loaded`, what every Nm of load adds to it."""

    search: tuple[float, ...] = ()
    by_rows: bool = False
    loaded: bool = False

    name = "hysteresis"
    plain = "lost motion (the angle lags by the side from which it comes)"
    in_axis_units = True
    station = Station.SPRING
    kinds = ALL_KINDS
    smooth = False
    sentence = "axis {joint} stays {size_rad:.3g} rad behind, in the direction from which it comes"
    source = "Al-Bender, Lampaert and Swevers 2005"

    def parameters(self) -> tuple[Parameter, ...]:
        size = Parameter("size_rad", 2e-4, -1e-2, 1e-2)
        if self.loaded:
            return (size, Parameter("per_load_rad_per_Nm", 1e-6, 0.0, of_first=1.0))
        if len(self.values) == 1:
            return (size,)
        return (size, Parameter("reach_rad", 1e-3, 1e-6, 1.0, search=self.search))

    @property
    def runs_ahead(self) -> bool:
        return bool(self.values) and self.values[0] < 0.0 and not self.loaded

    @property
    def told_by(self) -> str:  # type: ignore[override]
        return "per_load_rad_per_Nm" if self.loaded else ""

    @property
    def by_load(self) -> bool:  # type: ignore[override]
        return self.loaded

    def possible(self, robot, deviation) -> bool:
        """Beside a part that grows with the load, what is left without any is friction, too."""
        return not self.loaded or self.values[0] + CERTAIN * deviation[0] >= 0.0

    @property
    def compensable(self) -> bool:  # type: ignore[override]
        """What runs ahead is a matter of the log: a pose that is driven to does not know it."""
        return not self.runs_ahead

    @property
    def in_plain_words(self) -> str:
        return "an angle that runs ahead of its motion (no friction does)" if self.runs_ahead else self.plain

    def caveat(self, covariance) -> str:
        if not self.runs_ahead:
            return ""
        cause = ("or rows are not in the order of measurement" if self.by_rows
                 else "or `approach` is not +1 where an axis came from smaller angles")
        return f"the joint runs ahead of its motion: angles were logged before the arm stood still, {cause}"

    def describe(self) -> str:
        assumed = ", if every pose was reached straight from that of the row before" if self.by_rows else ""
        more = f", and {self.values[1]:.3g} rad more for every Nm of its load" if self.loaded else ""
        return super().describe() + more + assumed

    def per_guessed_load(self, view):
        guessed = self.loaded and view.guessed_load(self.index)
        return np.array([0, 1]) if guessed else np.zeros(len(self.values))

    def to_table(self):
        return super().to_table() | ({"by_rows": 1} if self.by_rows else {})

    def change(self, view) -> Change:
        derivative = np.zeros((view.rows, 1, len(self.values)))
        if view.is_series and len(self.values) > 1 and not self.loaded:
            memory, by_reach = self._memory(view)
            derivative[:, 0, 1] = -self.values[0] * by_reach
        else:
            memory = (view.way if self.by_rows else view.direction)[:, self.index]
        derivative[:, 0, 0] = -memory
        if not self.loaded:
            return Change((self.index,), (-self.values[0] * memory)[:, None], derivative)
        torque = view.torque[:, self.index]
        derivative[:, 0, 1] = -np.abs(torque) * memory
        by_torque = self.by_own_entry(view, -self.values[1] * np.sign(torque) * memory)
        value = -(self.values[0] + self.values[1] * np.abs(torque)) * memory
        return Change((self.index,), value[:, None], derivative, {"torque": by_torque})

    def _memory(self, view) -> tuple[np.ndarray, np.ndarray]:
        """m (N,) of every run and its derivative by the reach."""
        memory, by_reach = np.zeros(view.rows), np.zeros(view.rows)
        motion = view.theta[:, self.index] / view.robot.ratios[self.index]
        for rows in view.runs:
            memory[rows], by_reach[rows] = _core.stop_operator(motion[rows], self.values[1])
        return memory, by_reach

    @classmethod
    def from_table(cls, table) -> Effect:
        more = [name for name in ("reach_rad", "per_load_rad_per_Nm") if name in table]
        return cls(table["joint"], tuple(float(table[name]) for name in ("size_rad", *more)),
                   by_rows=bool(table.get("by_rows", 0)), loaded="per_load_rad_per_Nm" in more)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        for index in np.flatnonzero(view.moving):
            by_rows = np.ptp(view.direction[:, index]) == 0
            if np.ptp(view.way[:, index]) > 0:
                yield cls(int(index) + 1, (0.0,), by_rows=by_rows)
                if not view.is_series and (view.has_masses or view.measured_loads[index]):
                    yield cls(int(index) + 1, (0.0, 0.0), by_rows=by_rows, loaded=True)
            if view.is_series:
                # A drive torque shows what turns the joint by its rates: the shape of the memory is nearly
                # lost.
                reaches = _REACHES_RAD[::3] if view.device is Device.DRIVES else _REACHES_RAD
                yield cls(int(index) + 1, (0.0, reaches[0]), search=reaches)
