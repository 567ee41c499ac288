"""Contact: what stands for the device of the chain in some rows of a session, with what is unknown of it.

    numbers(x, R, nuisances) = reading         x (3,) m, R (3, 3): the target in the robot's base frame

It acts at the station where a tracker would measure: the numbers take the place of the position. What it
does not depend on (place or orientation of the target) has a zero derivative. Its parameters are nuisances:
effects of the declared model, one object a contact and session.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from exactarm.data.kinds import CLOSURES, POSES
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.parameter_id import Group, ParameterId


@dataclass(frozen=True)
class Contact(Effect):
    """One contact of one session. `numbers`: how many numbers a touch gives."""

    session: int = 1
    number: int = 0

    contact: ClassVar[str] = ""
    numbers: ClassVar[int] = 1
    station: ClassVar[Station] = Station.DEVICE
    kinds: ClassVar[tuple[str, ...]] = (POSES.name, CLOSURES.name)
    declared: ClassVar[bool] = True
    per_joint: ClassVar[bool] = False

    @property
    def title(self) -> str:
        return f"{self.contact} {self.number} of session {self.session}"

    def parameter_label(self, parameter: Parameter) -> str:
        return f"session_{self.session}.{self.contact}_{self.number}_{parameter.name}"

    def parameter_id(self, parameter: Parameter) -> ParameterId:
        return ParameterId(self.parameter_label(parameter), Group.FRAME, "contact", session=self.session)

    def rows(self, data) -> np.ndarray:
        """(N,) bool: the rows that touch it."""
        return (data.contacts[self.contact] == self.number) & (data.session == self.session)

    def placements(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Name -> rotation (3, 3) and place (3,) m of what stands or is carried, where that is more than a
        point; the rotation vectors among the values count from a start."""
        return {}

    def started(self, view, at: np.ndarray) -> Contact:
        """The contact that fits its rows `at` (K,) best, up to outliers, as `view` has the arm."""
        raise NotImplementedError

    def reading(self, data, at: np.ndarray) -> np.ndarray:
        """(K, 1 or c): what the numbers of its rows are to equal; zero for what only touches."""
        return np.zeros((len(at), 1))

    def numbers_at(self, view, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers (K, c) of the rows `at`, by a displacement of the target (K, c, 6): m, rad, by the
        parameters (K, c, k)."""
        raise NotImplementedError

    def change(self, view) -> Change:
        at, c = np.flatnonzero(self.rows(view.data)), self.numbers
        numbers, by_target, by_values = self.numbers_at(view, at)
        value = np.zeros((view.rows, 3))
        value[at] = -view.measured[at, :3]
        value[at, :c] += numbers
        by_parameters = np.zeros((view.rows, 3, len(self.values)))
        by_parameters[at, :c] = by_values
        by_point, by_turn = np.zeros((view.rows, 3, 3)), np.zeros((view.rows, 3, 6))
        by_point[at] = -np.eye(3)
        by_point[at, :c] += by_target[:, :, :3]
        by_turn[at, :c, 3:] = by_target[:, :, 3:]
        return Change((0, 1, 2), value, by_parameters, {"measured": by_point, "displacement": by_turn})
