"""Session payload: a mass at the flange that nobody has weighed, one for each session.

    torque += Y_n(q) pi,   pi (10,) of mass m and first moment s = m c, as in exactarm.effects.payload

Y_n (n, 10): columns of the last link in the regressor of the joint torque, DH frame n; at rest its gravity
alone counts, and in a motion the body is part of the last link (`carries`). c (m): given, then m (kg) is the
only parameter, else m and s (kg m). At rest it shows only through what gives way under load, so springs have
to be known or estimated with it from loads that are known; in a motion the drives feel it. It belongs to the
set-up, like a frame: a nuisance of the declared model, never part of the robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from exactarm import _core
from exactarm.data.kinds import CLOSURES, MOTION, POSES
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.payload import inertial


@dataclass(frozen=True)
class SessionPayload(Effect):
    """What the flange carries in one session beside links and known payload; `centre` None: not known."""

    session: int = 1
    centre: tuple[float, float, float] | None = None

    station: ClassVar[Station] = Station.LOAD
    kinds: ClassVar[tuple[str, ...]] = (POSES.name, CLOSURES.name, MOTION.name)
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
        """(3,) m in DH frame n; zero where there is no mass."""
        if self.centre:
            return np.asarray(self.centre)
        return np.array(self.values[1:]) / self.values[0] if self.values[0] > 0.0 else np.zeros(3)

    def from_tables(self, robot) -> SessionPayload:
        return self

    def carries(self, data) -> tuple[np.ndarray, np.ndarray]:
        return data.session == self.session, self._inertial()[0]

    def _inertial(self) -> tuple[np.ndarray, np.ndarray]:
        """pi (10,), and its derivative by the parameters."""
        if not self.centre:
            return inertial(self.values)
        slope = inertial((1.0, *(float(x) for x in self.centre)))[0][:, None]
        return slope @ np.asarray(self.values), slope

    def change(self, view) -> Change:
        at = np.flatnonzero(view.data.session == self.session)
        pi, slope = self._inertial()
        q = view.q[at]
        names = ("q_dot", "q_ddot")
        rates = [view.signals[name][at] if view.is_series else np.zeros_like(q) for name in names]
        regressor = _core.dynamics_regressor(view.robot.core, q, *rates, view.threads)[:, :, -10:]
        value = np.zeros((view.rows, view.axes))
        derivative = np.zeros((view.rows, view.axes, len(self.values)))
        derivative[at] = regressor @ slope
        if not view.is_series:  # there the arm itself carries it
            value[at] = regressor @ pi
        return Change(tuple(range(view.axes)), value, derivative)
