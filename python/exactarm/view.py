"""View: what the effects see of one evaluation: the robot, the rows of data and the signals so far.

Signals appear as the chain passes its stations ("theta", "phi", "torque", "q", "displacement",
"measured" and, in time series, their rates "theta_dot", "phi_dot", "q_dot", "q_ddot"); `tangents[name]`
is the derivative (N, m, P) of a signal with respect to the P free parameters of the layout.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from exactarm import _core
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import Device, Kind, kind_of
from exactarm.data.kinds.base import moving_axes, rows_of_runs
from exactarm.numerics.stamps import order_of_sampling
from exactarm.rest_load import RestLoad
from exactarm.robot.robot import Placement, Robot
from exactarm.station import Station

_FAST_RAD = 0.4  # differences of eighth order show 1 - 1.1e-6 of a wave that turns so far in a step
SIGN_WIDTH_RAD_S = 0.02  # output side; a robot that moves at all moves ten times as fast
SLIDES_RAD = 1e-3  # (m) a gear slides after some tenths (Al-Bender, Lampaert and Swevers 2005)
# (columns of the station's signal, derivative (N, c, k)) -> what it does to the measurement, (N, m, k).
Transfer = Callable[[tuple[int, ...], np.ndarray], np.ndarray]


@dataclass
class View:
    """Workspace of one evaluation. `robot` has the effects' table values baked in; `threads` bounds the
    cores."""

    robot: Robot
    data: Dataset
    kind: str
    threads: int = 1
    signals: dict[str, np.ndarray] = field(default_factory=dict)
    tangents: dict[str, np.ndarray] = field(default_factory=dict)
    transfers: dict[Station, Transfer] = field(default_factory=dict)
    rest_load: RestLoad | None = None  # of poses at rest
    # of poses at rest, by the identity of an effect: the effect, its change, the signals that it follows
    changes: dict[int, tuple[Any, Any, dict[str, np.ndarray]]] = field(default_factory=dict, init=False)
    # of time series: what a residual (N, m) says of each moving axis, (N, n)
    by_axis: Callable[[np.ndarray], np.ndarray] | None = None
    # of gear runs under a gyroscope (chain/wave_rates.py): d/dt of a signal (N, ...) by differences between
    # samples, rad (n,) that a gear turns at most from one to the next, what rates behind gears do
    rate: Callable[[np.ndarray], np.ndarray] | None = None
    turned_in_a_step: np.ndarray | None = None
    from_rate: Transfer | None = None
    # of touches: what displacements of the target (N, 6, k) do to the numbers that are read, (N, m, k)
    through: Callable[[np.ndarray], np.ndarray] | None = None

    @property
    def rows(self) -> int:
        return len(self.data.session)

    @property
    def axes(self) -> int:
        return self.robot.axes

    @property
    def theta(self) -> np.ndarray:
        """(N, n) motor angles, rad."""
        return self.signals["theta"]

    @property
    def phi(self) -> np.ndarray:
        """(N, n) output-side angles of the gears, rad."""
        return self.signals["phi"]

    @property
    def torque(self) -> np.ndarray:
        """(N, n) torque that the spring of each joint carries, Nm; zero where no masses are declared."""
        return self.signals["torque"]

    @property
    def q(self) -> np.ndarray:
        """(N, n) joint angles, rad."""
        return self.signals["q"]

    @property
    def measured(self) -> np.ndarray:
        """(N, m) predicted measurement so far."""
        return self.signals["measured"]

    def target_by(self, name: str) -> np.ndarray | None:
        """(N, 6, k) derivative of the target's position and orientation by the joint angles ("q", k = n), by
        one parameter of every frame ("d", "a", "alpha", "beta", k = n), or by "base" or "tool" (k = 6:
        translation, then rotation); None where the chain was evaluated without tangents."""
        if "identification" not in self.signals:
            return None
        columns = self.signals["identification"].reshape(self.rows, 6, -1)
        return columns[:, :, _core.identification_layout(self.axes)[name]]

    @property
    def direction(self) -> np.ndarray:
        """(N, n) direction of the motor's motion from -1 to 1: in a time series as in chain/direction.py, the
        approach of a static pose; 0 where unknown. The motor's own sense: with a negative ratio the output
        turns the other way."""
        if "direction" in self.signals:
            return self.signals["direction"]
        if "theta_dot" in self.signals:
            return np.sign(self.signals["theta_dot"])
        approach = self.data.joints.get("approach")
        if approach is None:
            return np.zeros((self.rows, self.axes))
        return np.clip(np.nan_to_num(approach), -1.0, 1.0)

    @property
    def way(self) -> np.ndarray:
        """(N, n) the direction where it is known, else what the order of the rows would make it."""
        if self.is_series or "approach" in self.data.joints or self.data.way is None:
            return self.direction
        turned = 1.0 if "q" in self.data.joints else np.sign(self.robot.controller_ratios)
        return self.data.way * turned

    @property
    def move(self) -> np.ndarray:
        """(N, n) rad, m: how far each axis has come since the row before, output side; 0 where it is not
        known, or poses were approached otherwise."""
        if self.is_series or "approach" in self.data.joints or self.data.step is None:
            return np.zeros((self.rows, self.axes))
        return self.data.step / (1.0 if "q" in self.data.joints else self.robot.controller_ratios)

    @property
    def sign_width(self) -> np.ndarray:
        """(n,) rad/s, output side: within it dry friction turns over."""
        return np.full(self.axes, SIGN_WIDTH_RAD_S)

    def dry_friction(self, index: int, law: Callable | None = None) -> np.ndarray | None:
        """(N,) of a law of the sign of an axis' (from 0) dry friction and of its rate on the output side, or
        of the sign itself: mean over the samples of the log that a row stands for. None where rows are all
        there is."""
        return None

    def sign_by_angle(self, index: int) -> np.ndarray | None:
        """(N,) slope of that sign by the angle on the output side, where the angle tells it."""
        return None

    def sign_by_rate(self, index: int) -> np.ndarray | None:
        """(N,) slope of the sign of an axis' (from 0) dry friction by its rate on the output side, mean over
        the samples of the log; None where there are none beside the rows, or it goes by the way."""
        return None

    @property
    def swing(self) -> np.ndarray:
        """(N, n) rad/s, output side: how far the motors' rates move to either side among the samples that a
        row stands for."""
        return np.zeros((self.rows, self.axes))

    @cached_property
    def _kind(self) -> Kind:
        return kind_of(self.kind)

    @property
    def device(self) -> Device:
        """What ends the chain."""
        return self._kind.device

    @property
    def is_series(self) -> bool:
        """Whether the rows of a run follow each other in time."""
        return not self._kind.at_rest

    @property
    def keep(self) -> np.ndarray:
        """(N,) rows on which the model is defined: not at a reversal of a gear run."""
        return self.signals["keep"] > 0 if "keep" in self.signals else np.ones(self.rows, bool)

    @cached_property
    def runs(self) -> tuple[np.ndarray, ...]:
        """Row indices of every run, in the order of sampling."""
        parts = rows_of_runs(self.data)
        if self.data.time is None:
            return tuple(parts)
        return tuple(rows[order_of_sampling(self.data.time[rows])] for rows in parts)

    @cached_property
    def moving(self) -> np.ndarray:
        """(n,) axes that move in these data; all that do not rest, for poses. In a series an axis moves
        within a run: one that rests elsewhere in the next run has not."""
        parts = self.runs if self.is_series else (slice(None),) * bool(self.rows)
        span = np.max([np.ptp(self.theta[rows], axis=0) for rows in parts], axis=0, initial=0.0)
        span = span / np.abs(self.robot.ratios)
        return moving_axes(self.robot, span) if self.is_series else span > 0.0

    @property
    def folded(self) -> np.ndarray:
        """(n,) axes whose declared gear waves pass faster than a log's samples show."""
        return np.zeros(self.axes, bool)

    @cached_property
    def moving_runs(self) -> tuple[tuple[np.ndarray, int], ...]:
        """(row indices, axis from 0 that moves furthest) of every run."""
        output = np.abs(1.0 / self.robot.ratios)
        if np.count_nonzero(self.moving) == 1:
            return tuple((rows, int(np.argmax(self.moving))) for rows in self.runs)
        return tuple((rows, int(np.argmax(np.ptp(self.theta[rows], axis=0) * output))) for rows in self.runs)

    @cached_property
    def sensor_axis(self) -> np.ndarray:
        """(N,) axis from 0 on whose link a gyroscope sits: the one that moves in the row's run."""
        axis = np.zeros(self.rows, int)
        for rows, index in self.moving_runs:
            axis[rows] = index
        return axis

    @cached_property
    def sessions(self) -> tuple[tuple[int, np.ndarray], ...]:
        """(session, row indices) of every set-up, in rising order."""
        return tuple((int(s), np.flatnonzero(self.data.session == s)) for s in np.unique(self.data.session))

    def frames(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions (N, n + 1, 3) m and rotations (N, n + 1, 3, 3) of base and frames, in the robot base
        frame."""
        return _core.frame_poses(self.robot_at_origin, self.q)

    @cached_property
    def robot_at_origin(self) -> _core.Robot:
        """The core robot with base and tool frames at identity."""
        return replace(self.robot, base=Placement(), tool=Placement()).core

    def response(self, effect: Any) -> np.ndarray:
        """(N, m, k) what the effect's parameters do to the measurement, from its station downstream, to first
        order.

        The chain must have been evaluated with tangents; the feedback of the deflection on the load is left
        out.
        """
        change = effect.change(self)
        if change.rate is not None and self.from_rate is not None:
            return self.from_rate(change.columns, change.rate.by_parameters)
        return self.transfers[effect.station_in(self)](change.columns, change.by_parameters)

    def is_fast(self, index: int, order: float) -> bool:
        """Whether rates are read, and a wave of so many cycles per turn of an axis (from 0) passes faster
        than differences between samples follow."""
        return self.turned_in_a_step is not None and order * self.turned_in_a_step[index] > _FAST_RAD

    def shown_of_wave(self, index: int, order: float) -> tuple[np.ndarray, np.ndarray] | None:
        """(N,) share of a wave over the motor angle of an axis (from 0) that shows in a row, which stands for
        several samples, and its slope by the order; None where all of it does."""
        return None

    def shown(self, displacement: np.ndarray) -> np.ndarray:
        """(N, m, k) what displacements of the target (N, 6, k) do to the numbers that are read."""
        return displacement if self.through is None else self.through(displacement)

    def leaving(self, residual: np.ndarray) -> View:
        """The same evaluation, of which a residual (N, m) is left: searches for orders look at it."""
        if self.by_axis is None:
            return self
        other = copy(self)
        other.signals = self.signals | {"axis_residual": self.by_axis(residual)}
        return other

    @property
    def arms(self) -> tuple[tuple[np.ndarray | slice, Robot], ...]:
        """Rows, and the arm that moves in them."""
        return ((slice(None), self.robot),)

    @property
    def has_masses(self) -> bool:
        """Whether masses load the joints."""
        if self.robot.generic_masses and not self._kind.shows_generic_loads:
            return False
        return self.robot.links is not None

    @cached_property
    def measured_loads(self) -> np.ndarray:
        """(n,) bool: axes whose load was measured, in static poses."""
        return np.zeros(self.axes, bool) if self.rest_load is None else self.rest_load.fixed.all(axis=0)

    def guessed_load(self, index: int) -> bool:
        """Whether the load of axis `index` (from 0) comes from a generic distribution of masses."""
        return self.robot.generic_masses and not self.measured_loads[index]


def motor_angles(robot: Robot, data: Dataset) -> np.ndarray:
    """(N, n) motor angles: measured ones, else from the controller's q by its own constants."""
    theta = np.full((len(data.session), robot.axes), np.nan)
    if "theta" in data.joints:
        theta[:] = data.joints["theta"]
    if "q" in data.joints:
        reported = (data.joints["q"] - robot.controller_offsets) * robot.controller_ratios
        theta = np.where(np.isnan(theta), reported, theta)
    return np.where(np.isnan(theta), 0.0, theta)


def axes_not_logged(data: Dataset) -> np.ndarray:
    """Axes (from 0) of whose angle no row says anything: `motor_angles` has their motors at 0."""
    known = [~np.isnan(data.joints[name]).all(axis=0) for name in ("theta", "q") if name in data.joints]
    return np.flatnonzero(~np.any(known, axis=0))


def on_axes(measured: Sequence[int], axes: int, values: np.ndarray) -> np.ndarray:
    """(N, n) of values (N, m) of the axes that are measured, from 0; zero on the others."""
    out = np.zeros((len(values), axes))
    out[:, measured] = values
    return out
