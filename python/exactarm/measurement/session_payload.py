"""Session payload: a mass at the flange that nobody has weighed, one for each session.

    torque += Y_n(q) pi,   pi (10,) of mass m and first moment s = m c, as in exactarm.effects.payload

Y_n (n, 10): columns of the last link in the regressor of the joint torque, flange frame; at rest its gravity
alone counts. c (m): given, then m (kg) is the only parameter, else m and s (kg m). It shows only through what
gives way under load, so springs have to be known or estimated with it from loads that are known. It belongs
to the set-up, like a frame: a nuisance of the declared model, never part of the robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from exactarm import _core
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.payload import inertial
from exactarm.kinds import CLOSURES, POSES


@dataclass(frozen=True)
class SessionPayload(Effect):
    """What the flange carries in one session beside links and known payload; `centre` None: not known."""

    session: int = 1
    centre: tuple[float, float, float] | None = None

    station: ClassVar[Station] = Station.LOAD
    kinds: ClassVar[tuple[str, ...]] = (POSES.name, CLOSURES.name)
    declared: ClassVar[bool] = True
    by_load: ClassVar[bool] = True
    per_joint: ClassVar[bool] = False

    @property
    def title(self) -> str:
        return f"payload of session {self.session}"

    def parameters(self) -> tuple[Parameter, ...]:
        moments = () if self.centre else tuple(Parameter(f"moment_{axis}_kg_m", 1.0) for axis in "xyz")
        return (Parameter("mass_kg", 5.0, lower=0.0), *moments)

    def parameter_label(self, parameter: Parameter) -> str:
        return f"payload_session{self.session}.{parameter.name}"

    def centre_of_mass(self) -> np.ndarray:
        """(3,) m in the flange frame; zero where there is no mass."""
        if self.centre:
            return np.asarray(self.centre)
        return np.array(self.values[1:]) / self.values[0] if self.values[0] > 0.0 else np.zeros(3)

    def change(self, view) -> Change:
        at = np.flatnonzero(view.data.session == self.session)
        if self.centre:
            slope = inertial((1.0, *self.centre))[0][:, None]
            pi = slope @ np.asarray(self.values)
        else:
            pi, slope = inertial(self.values)
        q = view.q[at]
        still = np.zeros_like(q)
        regressor = _core.dynamics_regressor(view.robot.core, q, still, still, view.threads)[:, :, -10:]
        value = np.zeros((view.rows, view.axes))
        derivative = np.zeros((view.rows, view.axes, len(self.values)))
        value[at], derivative[at] = regressor @ pi, regressor @ slope
        return Change(tuple(range(view.axes)), value, derivative)
