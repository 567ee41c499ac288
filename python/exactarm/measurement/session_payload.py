"""Session payload: a mass at the flange that nobody has weighed, one for each session.

    at rest:      flange_load += (m, s),   m kg, s = m c the first moment in DH frame n
    in a motion:  torque += Y_n(q) pi,     pi (10,) of m and s, as in exactarm.effects.payload

Y_n (n, 10): columns of the last link in the regressor of the joint torque, DH frame n; in a motion the body
is part of the last link (`carries`). c (m): given, then m (kg) is the only parameter, else m and s (kg m).
At rest it shows only through what gives way under load, so springs have to be known or estimated with it
from loads that are known; in a motion the drives feel it. It belongs to the set-up, like a frame: a nuisance
of the declared model, never part of the robot.
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

    station: ClassVar[Station] = Station.FLANGE
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
        acts = (view.data.session == self.session).astype(float)[:, None]
        pi, slope = (part[:4] for part in self._inertial())
        return Change(tuple(range(4)), acts * pi, acts[:, :, None] * slope)


class SessionPayloadInMotion(SessionPayload):
    """The same while the arm moves, which carries it itself."""

    station: ClassVar[Station] = Station.LOAD
    kinds: ClassVar[tuple[str, ...]] = (MOTION.name,)

    def change(self, view) -> Change:
        at = np.flatnonzero(view.data.session == self.session)
        motion = (view.signals[name][at] for name in ("q", "q_dot", "q_ddot"))
        regressor = _core.dynamics_regressor(view.robot.core, *motion, view.threads)[:, :, -10:]
        derivative = np.zeros((view.rows, view.axes, len(self.values)))
        derivative[at] = regressor @ self._inertial()[1]
        return Change(tuple(range(view.axes)), np.zeros((view.rows, view.axes)), derivative)
