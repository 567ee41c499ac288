"""Tracker drift: the measuring device moves off while it measures, linear in time (or row order).

measured += drift x, x the time in hours (or the row) less its mean over each session.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Iterable

import numpy as np

from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.slow_driver import ROW, TIME, slow_signal, unit


@dataclass(frozen=True)
class TrackerDrift(Effect):
    """Drift of the device in its own axes; `driver`: time or row."""

    driver: str = TIME

    name: ClassVar[str] = "tracker_drift"
    plain: ClassVar[str] = "a tracker that drifts"
    station: ClassVar[Station] = Station.DEVICE
    kinds: ClassVar[tuple[str, ...]] = ("poses", "tracked_motion")
    per_joint: ClassVar[bool] = False
    source: ClassVar[str] = "ISO 10360-10 (stability of laser trackers)"

    @property
    def of_record(self) -> bool:
        return True

    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"{axis}_m_per_{unit(self.driver)}", 1e-4) for axis in "xyz")

    def describe(self) -> str:
        size = 1e6 * float(np.linalg.norm(self.values))
        return f"the measuring device drifts by {size:.3g} micrometres per {unit(self.driver)}"

    def to_table(self):
        return super().to_table() | {"driver": self.driver}

    @classmethod
    def from_table(cls, table) -> Effect:
        raw = cls(None, (), table["driver"])
        return raw.with_values(table[parameter.name] for parameter in raw.parameters())

    def change(self, view) -> Change:
        x = slow_signal(view.data, self.driver)
        return Change((0, 1, 2), x[:, None] * np.asarray(self.values), x[:, None, None] * np.eye(3))

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        driver = TIME if view.data.time is not None and np.ptp(view.data.time) > 0.0 else ROW
        return (cls(None, (0.0,) * 3, driver),)
