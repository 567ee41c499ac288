"""What each found effect does by itself: the numbers behind its line and its picture in a report.

For every effect, with all others in the model, on the identification rows:

    value (N,) +- half (N,)     what it adds at its station, over its own signal (of the axis that drives it,
                                or of the measurement, that its value follows best), with the 95 % band
                                of its parameters
    without, with_ (N,)         the residual along the effect's own direction without and with it
    tool (N,)                   size of what it does to the measured position and no other parameter makes up
                                for, m; of an angle error in other data: the angle times the distance of the
                                flange from the axis; of torques: what the flange moves where they pass
                                through the springs that the robot file declares (of some rows)

An angle error that repeats is known up to a constant, which is the joint's zero: its value has mean zero
here.

Beside slow errors a fast wave shows in no sum: of a wave of a high order in a time series the residual is
taken less its mean over each wave (`fast`), which leaves the wave as it is.

`own signal`: value sorted by a signal differs little from neighbour to neighbour where it is a function of
that signal: 1 - mean square of the differences / (2 variance) (Rice 1984). Orders that turn many times per
output revolution are looked at over the phase of their own element.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.chain import Layout
from exactarm.chain.spring import declared_deflection
from exactarm.data.kinds import kind_of
from exactarm.diagnose.decisions import LEVELS, LOADED
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.problem import Problem
from exactarm.diagnose.signal import Direction, Quantity, Signal, place_of_axis
from exactarm.effects.axis_units import of_a_slide, slides
from exactarm.effects.base import Effect, OwnCurve, Station
from exactarm.effects.slow_driver import ROW
from exactarm.numerics.quadratic import variances
from exactarm.robot.robot import Robot

# share of a value's variance that one signal explains, from which it is drawn as a curve of that signal
FOLLOWS = 0.9
_HIGH_ORDER = 12.0  # cycles per output revolution: more waves than a plot over the whole turn can show
_ROWS_A_WAVE = 4.0  # on the average: fewer, and a mean over the rows of a wave takes some of the wave
_ENOUGH = 0.5  # of a value's variance, that a signal other than time explains, to be told over it
_POSTURES = 50  # of a run: levers change little between neighbours
_SMALL_RAD = 1e-4  # a turn whose chord is its arc to 1e-9
_MOST_POINTS = 3000  # of a picture
_TURN = 2.0 * np.pi
_PHASE = "phase"
_UNITS = {Quantity.ANGLE: "rad", Quantity.MOTOR_ANGLE: "rad", _PHASE: "rad", Quantity.LOAD: "Nm",
          Quantity.TIME: "s", Quantity.POSITION: "m", Quantity.TRAVEL: "m", Quantity.SPEED: "rad/s",
          Quantity.ACCELERATION: "rad/s²"}
_STATION_UNITS = {Station.MOTOR: "rad", Station.GEAR: "rad", Station.SPRING: "rad", Station.LOAD: "Nm",
                  Station.DRIVE: "Nm"}
_POSITION = 3  # components of a measured position


@dataclass(frozen=True)
class Contribution:
    """See the module. `curve`: the value is a function of the signal;
    unit of value and residual, SI. `tool` (N,) m or None; `rigid`: loaded axes without a declared stiffness,
    for want of which torques have none; `fast`: without what changes more slowly than the effect."""

    effect: Effect
    signal: Signal
    signal_unit: str
    curve: bool
    x: np.ndarray
    value: np.ndarray
    half: np.ndarray
    unit: str
    direction: Direction
    without: np.ndarray
    with_: np.ndarray
    tool: np.ndarray | None
    residual_unit: str
    peak_to_peak: tuple[float, float]  # of the value, and its 95 % half width
    rigid: tuple[int, ...] = ()
    fast: bool = False
    own: tuple[OwnCurve, ...] = ()  # of the effect by the position of its axis, at x; deviation: 95 %

    @property
    def at_tool(self) -> float | None:
        """Median over the rows, m."""
        return None if self.tool is None else float(np.median(self.tool))

    @property
    def rms(self) -> tuple[float, float]:
        """RMS of the residual along the direction without and with the effect."""
        return float(np.sqrt(np.mean(self.without**2))), float(np.sqrt(np.mean(self.with_**2)))


def contributions(problem: Problem, fitted: Fitted, declared: Layout) -> tuple[Contribution, ...]:
    """One for every effect of `fitted` beyond the declared model that moves the measurement, in their
    order."""
    found = []
    signals, directions = problem.signals(fitted), problem.directions(fitted)
    for index in range(len(declared.effects), len(fitted.layout.effects)):
        one = _contribution(fitted, index, signals, directions, problem.unit,
                            waves=None if kind_of(problem.kind).at_rest else _waves(fitted, index))
        if one is not None:
            found.append(one)
    return tuple(found)


def _contribution(fitted: Fitted, index: int, signals: dict, directions: dict, unit: str,
                  waves: np.ndarray | None = None) -> Contribution | None:
    effect, where = fitted.layout.effects[index], fitted.layout.slices[index]
    columns = fitted.jacobian[:, :, where]
    if not np.any(columns) or not np.any(effect.values):
        return None
    without = fitted.without(index)
    direction, before, after = _own_direction(fitted, without, effect, directions, waves)
    if direction is None:
        return None
    moved = without.residual - fitted.residual
    value, slopes, value_unit = _at_station(fitted, index, effect) or _at_measurement(
        fitted, moved, columns, directions[direction], unit, direction)
    if effect.orders():
        value, slopes = value - value.mean(), slopes - slopes.mean(axis=0)
    residual_unit = direction.unit_beside(unit)
    if value_unit == residual_unit and (value_unit == "rad" or direction.slides):
        before = after + value  # as drawn: the residual with the effect, and the effect
    covariance = fitted.fit.covariance[where, where]
    high, low = int(np.argmax(value)), int(np.argmin(value))
    difference = slopes[high] - slopes[low]
    named = _own_signals(effect, signals, fitted, direction)
    own = place_of_axis(fitted.robot, effect.joint) if effect.has_curves else None
    signal = own if own in named else _told_over(named, value)
    rows = subsampled(named[signal])
    rigid = _loaded_without_spring(fitted, moved) if unit == "Nm" else ()
    tool = (_at_tool(without, moved) if unit == "m" else _by_lever(fitted, effect, value, value_unit)
            if unit != "Nm" else None if rigid else _by_springs(fitted, moved))
    return Contribution(
        effect, signal, unit_of(signal), _follows(named[signal], value) > FOLLOWS,
        named[signal][rows], value[rows], _half(fitted, slopes[rows], covariance), value_unit, direction,
        before[rows], after[rows], tool, residual_unit,
        (float(value[high] - value[low]), float(_half(fitted, difference[None], covariance)[0])), rigid,
        waves is not None, _own_curves(fitted, index, rows) if own == signal else ())


def _own_curves(fitted: Fitted, index: int, rows: np.ndarray) -> tuple[OwnCurve, ...]:
    """At the positions of the effect's axis in these rows, with 95 % half widths."""
    effect, where = fitted.layout.effects[index], fitted.layout.slices[index]
    free = fitted.layout.free[index]
    position = fitted.view.q[rows, effect.index] - fitted.robot.offsets[effect.index]
    covariance = np.zeros((len(effect.values),) * 2)
    covariance[np.ix_(free, free)] = fitted.fit.covariance[where, where]
    return tuple(replace(curve, deviation=np.asarray(fitted.fit.half_width(curve.deviation)))
                 for curve in effect.curves(position, covariance))


def _at_tool(without: Fitted, moved: np.ndarray) -> np.ndarray:
    """(K,) m of the movement (N, m), in the rows that it moves, that the free parameters of the model without
    the effect cannot make up for."""
    white = without.whiten(moved[:, :, None])[:, 0]
    left = without.cleared(white)[: without.data_numbers].reshape(moved.shape)
    return np.linalg.norm((left * without.sigma)[np.any(moved, axis=1), :_POSITION], axis=1)


def _by_lever(fitted: Fitted, effect: Effect, value: np.ndarray, unit: str) -> np.ndarray | None:
    """(N,) m that an angle error moves the flange: by its median distance from the joint's axis in the
    postures of the data. None where the effect is no angle of one axis, or the arm has no geometry."""
    if unit != "rad" or effect.joint is None or not fitted.robot.has_geometry:
        return None
    q = fitted.view.q[_postures(len(fitted.view.q))]
    moved = _flange_moves(fitted.robot, q, _SMALL_RAD * np.eye(q.shape[1])[effect.index])
    return np.abs(value) * float(np.median(moved)) / _SMALL_RAD


def _loaded_without_spring(fitted: Fitted, moved: np.ndarray) -> tuple[int, ...]:
    """Axes (from 1) that the torques `moved` (N, m) of the measured axes load, and whose stiffness nobody
    knows."""
    size = np.sqrt(np.mean(moved**2, axis=0))
    loaded = fitted.measured[size > LOADED * size.max()]
    return tuple(int(i) + 1 for i in loaded if not fitted.robot.joints[i].spring_linear)


def _by_springs(fitted: Fitted, moved: np.ndarray) -> np.ndarray:
    """(k,) m that the flange moves in k rows where the torques `moved` (N, m) of the measured axes pass
    through the declared springs."""
    rows = _postures(len(moved))
    torque = np.zeros((len(rows), fitted.view.axes))
    torque[:, fitted.measured] = moved[rows]
    slope = declared_deflection(fitted.robot, fitted.view.torque[rows])[1]
    return _flange_moves(fitted.robot, fitted.view.q[rows], slope * torque)


def _postures(rows: int) -> np.ndarray:
    return np.linspace(0, rows - 1, min(rows, _POSTURES)).astype(int)


def _flange_moves(robot: Robot, q: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """(N,) m between the places of the flange at q (N, n) and at q + turned."""
    place = lambda angles: _core.identification_jacobian(robot.core, np.ascontiguousarray(angles))[0]
    return np.linalg.norm(place(q + turned) - place(q), axis=1)


def _waves(fitted: Fitted, index: int) -> np.ndarray | None:
    """(N,) the number of the wave that each row lies in, of an effect of one high order; None of others, and
    where a wave has too few rows to have a mean."""
    effect = fitted.layout.effects[index]
    orders = _own_order(effect)
    if not orders or abs(orders[0]) <= _HIGH_ORDER:
        return None
    number = np.floor(abs(orders[0]) * fitted.view.phi[:, effect.index] / _TURN)
    waves = np.cumsum(np.r_[0, np.diff(number) != 0])
    return waves if len(number) >= _ROWS_A_WAVE * (waves[-1] + 1) else None


def _own_order(effect: Effect) -> list[float]:
    return [effect.value_of(p.name) for p in effect.parameters() if p.name == "order_per_rev"]


def _less_mean(values: np.ndarray, group: np.ndarray | None) -> np.ndarray:
    return values if group is None else values - (np.bincount(group, values) / np.bincount(group))[group]


def _own_direction(fitted: Fitted, without: Fitted, effect: Effect, directions: dict,
                   waves: np.ndarray | None = None):
    """Direction in which the effect lowers the residual most, with both residuals (N,); its own axis first,
    or of an effect of the device the device's axes."""
    of_device = effect.station is Station.DEVICE
    own = [along for along in directions if (along.axis == effect.joint if effect.joint is not None
                                             else of_device and not along.turns)]
    best, fall = (None, None, None), 0.0
    for name in own or directions:
        if not np.any(directions[name]):  # rows of one number each, as of a face, show it in none
            continue
        before, after = (_less_mean(movement_along(fitted, state.residual, directions[name]), waves)
                         for state in (without, fitted))
        lowered = float(np.mean(before**2) - np.mean(after**2)) / max(float(np.mean(after**2)), 1e-300)
        if lowered > fall:
            best, fall = (name, before, after), lowered
    return best


def unit_of(signal: Signal) -> str:
    """SI; empty where nobody knows it."""
    return _UNITS.get(signal.quantity, "")


def movement_along(fitted: Fitted, residual: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(N,) a residual (N, m) as a movement along the direction (N, m): least squares in each row."""
    pattern = direction / fitted.sigma
    square = np.sum(pattern**2, axis=1)
    return np.sum(pattern * residual / fitted.sigma, axis=1) / np.maximum(square, 1e-12 * np.max(square))


def _at_station(fitted: Fitted, index: int, effect: Effect) -> tuple[np.ndarray, np.ndarray, str] | None:
    """Value (N,), its slopes (N, k) and unit, of an effect that acts on one column of its station; None for
    others."""
    unit = _STATION_UNITS.get(effect.station)
    if unit is None or effect.only_in_tables:
        return None
    change = effect.change(fitted.view)
    if len(change.columns) != 1 or not np.any(change.value):
        return None
    scale = 1.0 / fitted.robot.ratios[change.columns[0]] if effect.station == Station.MOTOR else 1.0
    free = change.by_parameters[:, 0, fitted.layout.free[index]]
    unit = of_a_slide(unit) if slides(fitted.robot, change.columns[0] + 1) else unit
    return change.value[:, 0] * scale, free * scale, unit


def _at_measurement(fitted: Fitted, moved: np.ndarray, columns: np.ndarray, direction: np.ndarray, unit: str,
                    along: Direction) -> tuple[np.ndarray, np.ndarray, str]:
    """The same as a movement of the measurement along the direction."""
    value = movement_along(fitted, moved, direction)
    slopes = np.stack([movement_along(fitted, columns[:, :, k], direction)
                       for k in range(columns.shape[2])], axis=1)
    return value, slopes, along.unit_beside(unit)


def _half(fitted: Fitted, slopes: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """(N,) 95 % half widths from slopes (N, k) and covariance (k, k)."""
    return np.asarray(
        fitted.fit.half_width(np.sqrt(np.maximum(variances(slopes, covariance), 0.0))))


def _told_over(named: dict[Signal, np.ndarray], value: np.ndarray) -> Signal:
    """The signal that the value follows best. Everything smooth follows time, which says nothing of a cause:
    time only where no other signal explains half."""
    time = Signal(Quantity.TIME)
    others = {signal: _follows(values, value) + 1e-3 * signal.places_axis
              for signal, values in named.items() if signal != time}
    best = max(others, key=others.__getitem__, default=time)
    return best if time not in named or others.get(best, 0.0) > _ENOUGH else time


def _own_signals(effect: Effect, signals: dict[Signal, np.ndarray], fitted: Fitted,
                 direction: Direction | None = None) -> dict[Signal, np.ndarray]:
    """What drives the effect, where it says so (time, rows, a temperature); else the signals of the axis that
    it follows, of no axis, and the phase of a fast element. An effect of no single axis that is drawn along
    the error of one axis: those of that axis; else all."""
    driver = Signal(getattr(effect, "driver", ""))
    if driver.quantity == ROW:
        return {Signal(Quantity.ORDER): fitted.view.data.row.astype(float)}
    if driver in signals:
        return {driver: signals[driver]}
    axis = effect.driven_by
    if axis is None and direction is not None and not direction.turns:
        axis = direction.axis
    if axis is None:
        return signals
    own = {signal: values for signal, values in signals.items()
           if signal.axis in (axis, None)}
    if effect.joint is None:
        return own or signals
    orders = _own_order(effect)
    if orders and orders[0] > _HIGH_ORDER:
        ratio = abs(fitted.robot.ratios[effect.index])
        turns = orders[0] / ratio
        element = "the motor of " if abs(turns - round(turns)) < 0.02 and round(turns) >= 1 else ""
        phase = np.mod(orders[0] * fitted.view.phi[:, effect.index], _TURN)
        own[Signal(_PHASE, part=f"of {element}axis {effect.joint}, order {orders[0]:.4g}")] = phase
    return own or signals


def _follows(signal: np.ndarray, value: np.ndarray) -> float:
    """Share of the value's variance that is a smooth function of the signal."""
    variance = float(np.var(value))
    if variance == 0.0 or np.ptp(signal) == 0.0:
        return 0.0
    distinct, group = np.unique(signal, return_inverse=True)
    if len(distinct) <= LEVELS:
        mean = np.bincount(group, value) / np.bincount(group)
        return float(np.var(mean[group])) / variance
    # rows of one value in any order: in that of time their neighbours would agree in whatever is smooth
    drawn = np.random.default_rng(0).permutation(len(signal))
    ordered = value[drawn[np.argsort(signal[drawn], kind="stable")]]
    return 1.0 - float(np.mean(np.diff(ordered) ** 2)) / (2.0 * variance)


def subsampled(signal: np.ndarray) -> np.ndarray:
    """Row indices of at most so many rows, evenly over the sorted signal."""
    order = np.argsort(signal, kind="stable")
    return order[:: max(1, -(-len(order) // _MOST_POINTS))]
