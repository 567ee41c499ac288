"""Tracker drift: the measuring device moves off while it measures, in time (or row order).

measured += x (shift + turn x measured),   x the time in hours (or the row), or what settles in it
R -> exp(x turn) R                         where the device measures orientations R, too

shift (3,) m and turn (3,) rad, about the device's origin, a unit of x (slow_driver.py). Where the device
stood at x = 0 is part of the frames of its set-up. Either the shift alone is estimated, or both: a tripod
that settles tilts.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.slow_driver import ROW, TIME, Follows, pair_of, settles_in

_TURN = 3e-5  # rad an hour or a row, plausible


@dataclass(frozen=True)
class TrackerDrift(Follows):
    """Drift of the device in its own axes, with `turn` its rotation too; `driver`: time or row."""

    turn: bool = False
    drawn: bool = False  # the rotation, to zero

    name = "tracker_drift"
    plain = "a tracker that drifts"
    station = Station.DEVICE
    of_record = may_settle = in_record = True
    kinds = WITH_TARGET
    per_joint = False
    source = "ISO 10360-10 (stability of laser trackers)"

    def rates(self) -> tuple[Parameter, ...]:
        shift = tuple(Parameter(f"{axis}_m_per_{self.unit}", 1e-4) for axis in "xyz")
        turn = tuple(Parameter(f"turn_{axis}_rad_per_{self.unit}", _TURN, fixed=not self.turn,
                               prior=_TURN if self.drawn else np.inf) for axis in "xyz")
        return (*shift, *turn)

    def with_all_terms(self) -> Effect:
        """A tripod that settles tilts: the shift, told at the device's origin, hangs on it."""
        return self if self.turn else replace(self, turn=True, drawn=True)

    def describe(self) -> str:
        size, turn = (1e6 * float(np.linalg.norm(part)) for part in (self.values[:3], self.values[3:6]))
        more = f" and turns by {turn:.3g} microradians" if any(self.values[3:6]) else ""
        return f"the measuring device drifts by {size:.3g} micrometres{more} per {self.unit}{self.in_time}"

    @classmethod
    def from_table(cls, table) -> Effect:
        """Files without a turn are those of a shift alone."""
        raw = cls(None, (), table["driver"], pair_of(table), settles_in(table))
        values = [table.get(p.name, 0.0) if p.name.startswith("turn") else table[p.name]
                  for p in raw.parameters()]
        return replace(raw.with_values(values), turn=any(values[3:6]))

    def at(self, view, x) -> Change:
        return Change(tuple(range(6)), *moved_device(view.measured[:, :3], x[:, :, None], self.values[:6]))

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        driver = TIME if view.data.time is not None and np.ptp(view.data.time) > 0.0 else ROW
        for turn in (False, True):
            yield from cls(None, (0.0,) * 6, driver, turn=turn).forms_on(view.data)


def moved_device(measured: np.ndarray, x: np.ndarray,
                 values) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """What a device that shifts and turns by x (N, 1, 1) times `values` (6,) does to poses measured, of
    positions (N, 3): change (N, 6), its derivatives by `values` (N, 6, 6), and by the poses."""
    derivative = np.tile(np.eye(6), (len(x), 1, 1))
    derivative[:, :3, 3:] = np.cross(np.eye(3), measured[:, None, :]).swapaxes(1, 2)
    by_measured = np.zeros((len(x), 6, 6))
    by_measured[:, :3, :3] = x * np.cross(np.asarray(values[3:]), np.eye(3)).T
    return (derivative @ np.asarray(values)) * x[:, 0], derivative * x, {"measured": by_measured}
