"""Payload step: on some rows of a session the flange carries a mass that nobody wrote down.

    flange_load += (m, s),   m kg, s kg m the first moment in DH frame n

on all rows of one session, or on those after or up to a place in their order. At rest a payload shows only
through what gives way under it, declared or found: springs of joints, bearings and the base. m and what is
declared on these rows cannot be negative together. Plausible is a tenth of the arm's mass, and a centre 0.2 m
from the flange (prior of the moments). Under generic masses m is relative to them, as the springs are.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from exactarm.data.kinds import POSES
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.slow_driver import clock_of
from exactarm.effects.step_in_order import StepInOrder
from exactarm.rest_load import TIP_SHARE

ALL, AFTER, UP_TO = "all", "after", "up to"
_REACH_M = 0.2  # of the centre of what tools and grippers weigh, from the flange


@dataclass(frozen=True)
class PayloadStep(StepInOrder):
    """values: mass (kg) and first moment (kg m, DH frame n) on `rows` of the session, after the place where
    they begin or end, if not all; declared_kg: the least that is declared on them."""

    rows: str = AFTER
    declared_kg: float = 0.0
    plausible_kg: float = 5.0

    name = "payload_step"
    plain = "a payload that nobody wrote down"
    station = Station.FLANGE
    kinds = (POSES.name,)
    by_load = True
    carried = True
    per_joint = False
    source = "Atkeson, An and Hollerbach 1986"

    @property
    def on_earlier_rows(self) -> bool:
        return self.rows == UP_TO

    @property
    def label(self) -> str:
        return f"{self.name}_session{self.session}"

    @property
    def title(self) -> str:
        return f"payload step of session {self.session}"

    def sizes(self) -> tuple[Parameter, ...]:
        moment = _REACH_M * self.plausible_kg
        return (Parameter("mass_kg", self.plausible_kg, 0.0 - self.declared_kg),
                *(Parameter(f"moment_{axis}_kg_m", moment, prior=moment) for axis in "xyz"))

    def parameters(self) -> tuple[Parameter, ...]:
        return self.sizes() if self.rows == ALL else super().parameters()

    def per_guessed_load(self, view) -> np.ndarray:
        """As large as the loads that the springs were told by, unless some of these were weighed."""
        guessed = view.robot.generic_masses and not view.rest_load.payload_varies
        return np.arange(len(self.values)) >= (len(self.values) - 4 if guessed else len(self.values))

    def describe(self) -> str:
        where = f"in session {self.session}" if self.rows == ALL else f"{self.rows} {self.where}"
        mass = self.values[-4]
        kind = "more" if mass >= 0.0 else "less"
        return f"the flange carries {abs(mass):.3g} kg {kind} than declared {where}"

    def caveat(self, covariance) -> str:
        return ("the robot file holds this payload for these rows only; for other measurements or programs "
                "with the same payload, write it in a column payload_kg")

    def to_table(self):
        return super().to_table() | {"rows": self.rows, "declared_kg": self.declared_kg}

    @classmethod
    def from_table(cls, table) -> Effect:
        raw = cls(None, (), int(table["session"]), table["driver"], rows=table["rows"],
                  declared_kg=float(table["declared_kg"]))
        return raw.with_values(float(table[parameter.name]) for parameter in raw.parameters())

    def acts(self, data) -> np.ndarray:
        return (data.session == self.session).astype(float) if self.rows == ALL else super().acts(data)

    def moved(self, view) -> Effect:
        return self if self.rows == ALL else super().moved(view)

    def searched_between(self, view):
        return {} if self.rows == ALL else super().searched_between(view)

    def shape(self, view):
        return view.transfers[Station.FLANGE](tuple(range(4)), np.tile(np.eye(4), (view.rows, 1, 1)))

    def change(self, view) -> Change:
        acts = self.acts(view.data)
        derivative = np.zeros((view.rows, 4, len(self.values)))
        derivative[:, :, -4:] = acts[:, None, None] * np.eye(4)
        return Change(tuple(range(4)), acts[:, None] * np.array(self.values[-4:]), derivative)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        if not view.has_masses or "measured" not in view.signals or Station.FLANGE not in view.transfers:
            return
        plausible = TIP_SHARE * sum(link.mass for link in robot.links)
        declared = np.zeros(view.rows) if view.data.payload is None else view.data.payload[0]
        for session, rows in view.sessions:
            whole = cls(None, (0.0,) * 4, session, clock_of(view), rows=ALL,
                        declared_kg=float(declared[rows].min()), plausible_kg=plausible)
            if len(view.sessions) > 1:
                yield whole
            tried = whole.tried(view)
            yield from (replace(whole, values=(tried[0], *whole.values), rows=side, search=tried)
                        for side in ((AFTER, UP_TO) if tried else ()))

