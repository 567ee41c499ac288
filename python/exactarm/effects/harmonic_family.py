"""What the effects made of gear harmonics have in common: one rotating element of the gear and its multiples.

    x + f e(x) = phi,    e(x) = sum_k (a_k sin(k w x) + b_k (cos(k w x) - 1)) / (k w)             (2.13), E5

x is the delivered angle, phi the one without the effect, f (N,) what the error follows: 1, the direction of
motion, the rate or the torque. Hence dx/dphi = 1 / (1 + f e'), dx/df = -e / (1 + f e'), and so for a_k, b_k,
w.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from exactarm.data.kinds import Device
from exactarm.effects.axis_units import slides
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.effects.known_curve import KnownCurve
from exactarm.numerics.harmonics import delivered_angle, waves
from exactarm.numerics.signals import strongest_orders

_POSE_MULTIPLES = 2  # of the ratio: the highest order that poses are searched for
_HALVES_UNTIL = 40.0  # orders of an element that turns neither with the output nor with the motor
_RATIO_UNKNOWN = 100.0
_MOST_TEETH = 130  # of a ring or an encoder disc at the output, whatever the ratio is
# a fit that drifts far below the orders that were tried follows another cause
_LEAST_ORDER, _BELOW_SEARCH = 0.2, 0.8
_MOST_MULTIPLES = 2  # of an element whose order was searched
_MOTOR_MULTIPLES = (1.0, 2.0)  # that motions are searched for
_REFINED, _BESIDE = 3, (-0.5, -0.25, 0.25, 0.5)  # peaks, and steps in cells of resolution
_LEAST_WHOLE, _SLOW_PASSES = 3.0, 3.0  # 1 and 2 are a run-out; waves in the range
_LEAST_RANGE_RAD = 1e-3  # a gear that has turned by less shows no wave of an order below thousands
_CURVE_KNEE = 25.0  # order above which the amplitudes of a gear or encoder curve fall (cycles per revolution)
# lower orders are run-outs, no larger than what falls from here on: on part of a turn, wider ones would
# imitate geometry and springs
_FALLS_FROM = 10.0


@dataclass(frozen=True)
class HarmonicFamily(Effect):
    """values: order of the element (cycles per output revolution), then a_k, b_k for its multiples k = 1, 2,
    ...

    `search`: orders to be tried; empty once the order is known. `curve_rad` > 0: all orders together as one
    smooth curve of the angle, each term regularised by a Gaussian prior of that amplitude: with `fall` = 0 it
    falls above the order `_CURVE_KNEE`, else above `_FALLS_FROM`, as (order / `_FALLS_FROM`)^-fall.
    `seen`: output angles (rad) between which a curve was measured; beyond, it keeps the value of the nearer
    end.
    `known`: how well it is known, angle by angle; None in files of earlier versions and in a fit under way.
    """

    search: tuple[float, ...] = ()
    curve_rad: float = 0.0
    seen: tuple[float, float] | None = None
    known: KnownCurve | None = None
    fall: float = 0.0

    station = Station.GEAR
    repeatable = True
    unit = ""  # what a and b carry beside a plain number, as the end of a name
    plausible = 1e-3

    def factor(self, view) -> tuple[np.ndarray, Mapping[str, np.ndarray]]:
        """f (N,) and its derivatives by signals, name -> (N, n)."""
        return np.ones(view.rows), {}

    @classmethod
    def zero(cls, joint: int, search, multiples: int = 1) -> HarmonicFamily:
        """The effect without any size, to be searched over orders."""
        search = tuple(float(order) for order in search)
        return cls(joint, (search[0],) + (0.0, 0.0) * multiples, search)

    @classmethod
    def curve(cls, joint: int, multiples: int, amplitude_rad: float,
              seen: tuple[float, float], fall: float = 0.0) -> HarmonicFamily:
        """Orders 1 to `multiples` together, without any size yet."""
        return cls(joint, (1.0,) + (0.0, 0.0) * multiples, (), amplitude_rad, seen, fall=fall)

    def measured(self, phi: np.ndarray) -> np.ndarray | None:
        if self.known is not None:
            return self.known.measured(phi[:, self.index])
        return None if self.seen is None else self._looked_up(phi[:, self.index])[1]

    @property
    def of_waves(self) -> bool:
        return bool(self.search)

    def with_values(self, values: Iterable[float]) -> HarmonicFamily:
        """What is known belongs to one estimate: other values begin without it."""
        return replace(self, values=tuple(float(value) for value in values), known=None)

    def after_fit(self, phi: np.ndarray, covariance: np.ndarray) -> Effect:
        if self.curve_rad == 0.0:
            return self
        orders = self.values[0] * np.arange(1, self.multiples + 1)

        def basis(angle: np.ndarray) -> np.ndarray:
            sine, cosine = waves(angle, orders)
            columns = np.zeros((len(angle), len(self.values)))
            columns[:, 1::2], columns[:, 2::2] = -sine / orders, -(cosine - 1.0) / orders
            return columns

        prior = float(np.linalg.norm(self._priors() / orders))
        known = KnownCurve.of(basis, covariance, prior, phi[:, self.index])
        return replace(self, known=known)

    def deviation(self, phi: np.ndarray) -> np.ndarray | None:
        return None if self.known is None else self.known.deviation(phi[:, self.index])

    @property
    def angles_measured(self) -> tuple[float, float] | None:
        return self.seen

    def _looked_up(self, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The angle (N,) at which the error is looked up, and which rows (N,) lie where it was measured."""
        if self.seen is None:
            return phi, np.ones(phi.shape, bool)
        low, high = self.seen
        turned = low + np.mod(phi - low, 2.0 * np.pi)
        inside = turned <= high
        end = np.where(turned - high < low + 2.0 * np.pi - turned, high, low)
        return np.where(inside, phi, end), inside

    @property
    def multiples(self) -> int:
        return (len(self.values) - 1) // 2

    @property
    def any_curve(self) -> bool:
        return self.curve_rad > 0.0

    def orders(self) -> tuple[tuple[float, float], ...]:
        if self.unit:  # an error that follows load, speed or direction has no amplitude of its own
            return ()
        orders = self.values[0] * np.arange(1, self.multiples + 1)
        return tuple((float(order), float(np.hypot(a, b) / order))
                     for order, a, b in zip(orders, self.values[1::2], self.values[2::2]))

    def describe_on(self, robot) -> str:
        """Orders of an axis that slides count the waves in 2 pi m of its way."""
        if not slides(robot, self.joint):
            return self.describe()
        length = f"{2e3 * np.pi / self.values[0]:.4g} mm"
        return f"the position of axis {self.joint} errs by waves {length} long: {self.in_plain_words}"

    def in_units_of(self, robot, words: str) -> str:
        return words.replace("per_rev", "rad_per_m") if slides(robot, self.joint) else words

    def parameters(self) -> tuple[Parameter, ...]:
        lowest = _LEAST_ORDER if not self.search else _BELOW_SEARCH * min(self.search)
        order = Parameter("order_per_rev", 1.0, lowest, 2000.0, fixed=self.curve_rad > 0.0,
                          search=self.search)
        return order, *_amplitudes(self.unit, self.plausible, tuple(self._priors().tolist()))

    def richer(self) -> Iterable[Effect]:
        """The next multiple of the element: a wheel that is not round has overtones."""
        if self.curve_rad == 0.0 and self.multiples < _MOST_MULTIPLES:
            order = self.values[0]
            yield replace(self, values=(order,) + (0.0, 0.0) * (self.multiples + 1), search=(order,))

    def companions(self) -> Iterable[Effect]:
        """The overtone of one wave, wherever it lies: a wave generator's at four times the motor's turn."""
        if self.curve_rad == 0.0 and self.multiples == 1:
            yield self.zero(self.joint, (2.0 * self.values[0],))

    def _priors(self) -> np.ndarray:
        """(K,) standard deviations of a_k and b_k: an angle amplitude times the order."""
        if self.curve_rad == 0.0:
            return np.full(self.multiples, np.inf)
        orders = self.values[0] * np.arange(1, self.multiples + 1)
        if self.fall > 0.0:
            return self.curve_rad * orders * np.maximum(1.0, orders / _FALLS_FROM) ** -self.fall
        return self.curve_rad * orders / np.maximum(1.0, orders / _CURVE_KNEE) ** 1.5

    def parameter_label(self, parameter: Parameter) -> str:
        order = f"_order_{self.values[0]:.0f}" if self.repeatable else ""
        return f"{self.label}{order}.{parameter.name}"

    def change(self, view) -> Change:
        order, multiple = self.values[0], np.arange(1, self.multiples + 1)
        a, b = np.array(self.values[1::2]), np.array(self.values[2::2])
        orders = order * multiple
        factor, by_factor = self.factor(view)
        phi, inside = self._looked_up(view.phi[:, self.index])
        x = delivered_angle(phi, orders, a, b, factor) if np.any(a) or np.any(b) else phi
        sine, cosine = waves(x, orders)
        slope = cosine @ a - sine @ b
        derivative = np.empty((view.rows, 1, len(self.values)))
        derivative[:, 0, 1::2], derivative[:, 0, 2::2] = sine / orders, (cosine - 1.0) / orders
        error = derivative[:, 0, 1::2] @ a + derivative[:, 0, 2::2] @ b
        # d(k w)/dw = k cancels against the k of the divisor, once in each term.
        derivative[:, 0, 0] = (x * slope - error) / order
        inverse = 1.0 / (1.0 + factor * slope)
        by_phi = self.by_own_entry(view, np.where(inside, inverse - 1.0, 0.0))
        by_signal = {name: -(error * inverse)[:, None, None] * row[:, None, :]
                     for name, row in by_factor.items()}
        rate = None
        if view.is_fast(self.index, orders[-1]):
            turns, grows = np.where(inside, view.signals["phi_dot"][:, self.index], 0.0), view.rate(factor)
            moves = inverse * (turns - grows * error)
            bends = -(sine @ (a * orders) + cosine @ (b * orders)) * moves
            frees = -(inverse**2) * (grows * slope + factor * bends)
            swings = np.empty_like(derivative)
            swings[:, 0, 1::2], swings[:, 0, 2::2] = cosine * moves[:, None], -sine * moves[:, None]
            swings[:, 0, 0] = x * bends / order
            columns = -(factor * inverse)[:, None, None] * swings
            columns -= (grows * inverse + factor * frees)[:, None, None] * derivative
            lifts = -(slope * moves * inverse + error * frees)[:, None, None]
            rate = Change((self.index,), (moves - turns)[:, None], columns,
                          {"phi": self.by_own_entry(view, np.where(inside, frees, 0.0))}
                          | {name: lifts * row[:, None, :] for name, row in by_factor.items()})
        derivative *= -(factor * inverse)[:, None, None]
        return Change((self.index,), (x - phi)[:, None], derivative, {"phi": by_phi} | by_signal, rate=rate)

    def to_table(self):
        table = super().to_table()
        if self.seen is not None:
            table |= {"seen_from_rad": self.seen[0], "seen_to_rad": self.seen[1],
                      "each_order_rad": self.curve_rad}
        if self.fall > 0.0:
            table |= {"order_fall": self.fall}
        return table if self.known is None else table | self.known.to_table()

    @classmethod
    def from_table(cls, table: Mapping[str, float | int | str]) -> Effect:
        multiples = sum(1 for name in table if name.startswith("a_"))
        seen = (
            (float(table["seen_from_rad"]), float(table["seen_to_rad"])) if "seen_from_rad" in table else None
        )
        raw = cls(table.get("joint"), (1.0,) + (0.0, 0.0) * multiples, seen=seen,
                  curve_rad=float(table.get("each_order_rad", 0.0)), fall=float(table.get("order_fall", 0.0)))
        found = raw.with_values(table[parameter.name] for parameter in raw.parameters())
        return replace(found, known=KnownCurve.from_table(table))


@lru_cache(maxsize=256)  # a search asks for those of thousands of orders
def _amplitudes(unit: str, plausible: float, priors: tuple[float, ...]) -> tuple[Parameter, ...]:
    """a_k and b_k of multiples whose amplitudes have these priors."""
    return tuple(Parameter(f"{c}_{k + 1}{unit}", plausible, prior=prior)
                 for k, prior in enumerate(priors) for c in "ab")


def searched_orders(robot, view, index: int, lowest: float = 3.0) -> tuple[float, ...]:
    """Orders worth trying on axis `index`.

    A gear run shows its own: the peaks of its residual over the angle. Motions: few. Elsewhere `lowest` (1
    and 2 are a run-out, gear_eccentricity.py) up to twice the motor's own order, first in halves, without
    those that the declared tables have already.
    """
    declared = declared_orders(robot, index)
    if view.device is Device.GEAR:
        return tuple(o for o in _residual_orders(view, index) if np.all(np.abs(declared - o) > 0.5))
    ratio = abs(robot.ratios[index]) if robot.joints[index].has_gear else _RATIO_UNKNOWN
    if view.device is Device.DRIVES:
        # A drive torque is low-passed: it shows what turns with the motor, not every tooth.
        motion = ratio * np.array(_MOTOR_MULTIPLES)
        return tuple(o for o in motion if np.all(np.abs(declared - o) > 0.5))
    highest = max(_POSE_MULTIPLES * int(np.ceil(ratio)), _MOST_TEETH) + 2
    orders = np.concatenate([np.arange(lowest, _HALVES_UNTIL, 0.5), np.arange(_HALVES_UNTIL, highest)])
    orders = orders[orders < highest]
    if slides(robot, index + 1):  # only the screw or pinion is known; what is slower is a guide_error
        orders = orders[np.isin(orders, motor_orders(robot, orders, index))]
    return tuple(o for o in orders if np.all(np.abs(declared - o) > 0.5))


def slow_orders(robot, view, index: int, lowest: float = _LEAST_WHOLE) -> tuple[float, ...]:
    """Whole orders of axis `index`, from `lowest` on, of which one to three waves lie in the range of a gear
    run: no spectrum over the angle, levelled and windowed, shows them."""
    if view.device is not Device.GEAR or not view.moving[index]:
        return ()
    kept = [rows[view.keep[rows]] for rows, axis in view.moving_runs
            if axis == index or view.data.gyro is None]
    longest = max((np.ptp(view.phi[rows, index]) for rows in kept if rows.size), default=0.0)
    if longest < _LEAST_RANGE_RAD:
        return ()
    cell = 2.0 * np.pi / longest
    orders = np.arange(np.ceil(max(cell, lowest)), _SLOW_PASSES * cell)
    return tuple(o for o in orders if np.all(np.abs(declared_orders(robot, index) - o) > 0.5))


def orders_by_side(robot, view, index: int) -> tuple[float, ...]:
    """Orders worth trying of what changes sign with the direction: those of the declared tables, and all
    others."""
    return (*np.unique(declared_orders(robot, index)), *searched_orders(robot, view, index, lowest=1.0),
            *slow_orders(robot, view, index))


def motor_orders(robot, orders, index: int) -> tuple[float, ...]:
    """Those of `orders` that are the motor's own, or half of it (a wave generator): what turns there has
    overtones too."""
    if not robot.joints[index].has_gear:
        return ()
    motor = abs(robot.ratios[index])
    return tuple(o for o in orders if min(abs(o - motor), abs(o - 0.5 * motor)) <= 1.0)


def declared_orders(robot, index: int) -> np.ndarray:
    joint = robot.joints[index]
    tables = [table.order for table in (joint.cw, joint.ccw) if table is not None]
    return np.concatenate(tables) if tables else np.zeros(0)


def growing_error(effect: Effect, view, follows: np.ndarray) -> tuple[Change, np.ndarray]:
    """The whole error of a gear grows by the effect's value times `follows` (N,): the change, and the error
    e = theta / ratio - phi (N,)."""
    size, index = effect.values[0], effect.index
    error = view.theta[:, index] / view.robot.ratios[index] - view.phi[:, index]
    change = -(follows * error)
    by_signals = lambda grown: {"phi": effect.by_own_entry(view, size * grown),
                                "theta": effect.by_own_entry(view, -size * grown / view.robot.ratios[index])}
    rate = None
    if view.is_fast(index, view.robot.joints[index].highest_order):
        turns = view.rate(view.theta[:, index]) / view.robot.ratios[index]
        grows = view.rate(follows)
        moves = -(grows * error + follows * (turns - view.signals["phi_dot"][:, index]))
        rate = Change((index,), (size * moves)[:, None], moves[:, None, None], by_signals(grows))
    change = Change((index,), (size * change)[:, None], change[:, None, None], by_signals(follows), rate=rate)
    return change, error


def _residual_orders(view, index: int) -> np.ndarray:
    """Peaks of what the present model leaves along a moving axis, over its output angle, run by run and way
    by way: what changes its sign with the direction would cancel in a run to and fro.

    A gyroscope sits behind the axis that moves furthest; link encoders see every axis that moves.
    """
    residual = view.signals.get("axis_residual")
    if residual is None or not view.moving[index]:
        return np.zeros(0)
    pieces = []
    for rows, axis in view.moving_runs:
        if axis == index or view.data.gyro is None:
            rows = rows[view.keep[rows]]
            direction = view.direction[rows, index]
            ways = [rows[direction > 0.0], rows[direction < 0.0]]
            pieces += [(view.phi[way, index], residual[way, index]) for way in ways]
    orders = strongest_orders(pieces, ratio=abs(view.robot.ratios[index]))
    # The peak of a wave that grows with speed or load lies beside its order: the neighbourhood is tried too.
    cell = 2.0 * np.pi / max((np.ptp(x) for x, _ in pieces if x.size), default=np.inf)
    beside = orders[:_REFINED, None] + cell * np.array(_BESIDE)
    return np.concatenate([orders, beside[beside > cell]])
