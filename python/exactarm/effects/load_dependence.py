"""Load dependence: the error of a gear changes with the torque that it carries (wind-up, meshing under load).

Either the delivered angle gives way, change = -linear torque; or the gear's whole error grows,
e -> (1 + relative |torque|) e; or one order has a part proportional to the torque (values: order, a, b per
Nm). A measured torque is the drive's: what its dry friction holds never reaches the gear, so that
change = -linear torque + friction sign(rate), friction = linear times the torque of that friction (torque and
sign behind the same low-pass; no friction where the load comes from declared masses).

A gear run of an arm whose masses nobody declared, nor its torques measured, bears its weight all the same:
    change = -(along torque + across dtorque/dq),
torque: of the generic masses (robot/generic_masses.py), right in kind, not in size; across: the arm's centre
of mass lies beside theirs by about DISTRIBUTION (rad). Both together are a wave once a turn, as a run-out is;
where it lies decides.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.data.kinds import GEAR_RUN, MOTION, Device
from exactarm.effects.base import Change, Effect, Parameter
from exactarm.effects.harmonic_family import HarmonicFamily, declared_orders, growing_error, searched_orders
from exactarm.robot.generic_masses import DISTRIBUTION, with_generic_masses

# rad, standard deviation of the wave: of run-outs (gear_eccentricity.py), and springs of the Racer 7-1.4, as
# its file has them, wind up by 1.4 and 0.5 mrad under its weight
_WAVE_RAD = 1e-3
_WEIGHT = 5e-6
_LEAST_SPREAD_NM = 1e-3
_LEAST_SPREAD_SIGN = 0.5


@dataclass(frozen=True)
class LoadDependence(HarmonicFamily):
    """One value: wind-up, or with `of_declared` the growth of the gear's error; two: wind-up and the friction
    of the drive; three: an order of its own.

    beside_spring: only there may the wind-up be negative, where the declared spring is too soft."""

    of_declared: bool = False
    beside_spring: bool = True

    name = "load_dependence"
    plain = "gear errors that grow with the load"
    kinds = (GEAR_RUN.name, MOTION.name)
    compensable = True
    by_load = True
    repeatable = False
    unit = "_per_Nm"
    plausible = 1e-5
    sentence = "the error of gear {joint} changes with the torque that it carries"
    source = "thesis 1.1.1, 1.1.2"

    @property
    def of_waves(self) -> bool:
        return self.of_declared or super().of_waves

    def factor(self, view):
        by_torque = np.zeros((view.rows, view.axes))
        by_torque[:, self.index] = 1.0
        return view.torque[:, self.index], {"torque": by_torque}

    def parameters(self) -> tuple[Parameter, ...]:
        if len(self.values) > 2:
            return super().parameters()
        if self.of_declared:
            return (Parameter("relative_per_Nm", 5e-3, -1.0, 1.0),)
        lower = -np.inf if self.beside_spring else 0.0
        return (Parameter("linear_rad_per_Nm", 5e-6, lower),
                Parameter("friction_rad", 1e-4))[: len(self.values)]

    def change(self, view) -> Change:
        if len(self.values) > 2:
            return super().change(view)
        size, torque = self.values[0], view.torque[:, self.index]
        if self.of_declared:
            grown, error = growing_error(self, view, np.abs(torque))
            sided = lambda values: {"torque": self.by_own_entry(view, -size * np.sign(torque) * values)}
            rate = grown.rate
            if rate is not None:
                swings = view.rate(view.theta[:, self.index]) / view.robot.ratios[self.index]
                swings = swings - view.signals["phi_dot"][:, self.index]
                rate = replace(rate, by_signal=rate.by_signal | sided(swings))
            return replace(grown, by_signal=grown.by_signal | sided(error), rate=rate)
        columns = -torque[:, None]
        if len(self.values) == 2:
            columns = np.stack([-torque, self._sign(view)], axis=1)
        value = columns @ np.array(self.values)
        by_torque = self.by_own_entry(view, -size)
        return Change((self.index,), value[:, None], columns[:, None, :], {"torque": by_torque})

    def _sign(self, view) -> np.ndarray:
        """(N,) shape of the drive's friction in the load; 0 where the load is the arm's own."""
        return (view.signals["friction_sign"][:, self.index] if "friction_sign" in view.signals
                else np.zeros(view.rows))

    @classmethod
    def from_table(cls, table) -> Effect:
        if "friction_rad" in table:
            return cls(table["joint"], (float(table["linear_rad_per_Nm"]), float(table["friction_rad"])))
        if "along_rad_per_Nm" in table:
            values = float(table["along_rad_per_Nm"]), float(table["across_rad_per_Nm"])
            return WeightDependence(table["joint"], values)
        for key, of_declared in (("relative_per_Nm", True), ("linear_rad_per_Nm", False)):
            if key in table:
                return cls(table["joint"], (float(table[key]),), of_declared=of_declared)
        return super().from_table(table)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        for index in range(robot.axes):
            if np.std(view.torque[:, index]) < _LEAST_SPREAD_NM:
                yield from WeightDependence.of_axis(view, index)
                continue
            # A measured torque always has the friction of the drive in it.
            rubs = ("friction_sign" in view.signals
                    and np.ptp(view.signals["friction_sign"][:, index]) > _LEAST_SPREAD_SIGN)
            spring = bool(robot.joints[index].spring_linear)
            yield cls(index + 1, (0.0, 0.0) if rubs else (0.0,), beside_spring=spring)
            if robot.joints[index].has_harmonics:
                yield cls(index + 1, (0.0,), of_declared=True)
            orders = (*np.unique(declared_orders(robot, index)), *searched_orders(robot, view, index))
            if len(orders) and view.moving[index]:
                yield cls.zero(index + 1, orders)


@dataclass(frozen=True)
class WeightDependence(LoadDependence):
    """Wind-up under the weight of an arm whose masses nobody declared; largest_Nm: of the generic masses over
    a turn in these data, by which the wave has the prior of a run-out's; 0 in files."""

    largest_Nm: float = 0.0

    kinds = (GEAR_RUN.name,)
    compensable = False  # elsewhere the arm weighs as its masses have it
    sentence = "gear {joint} winds up under the arm's own weight, as a generic distribution of masses has it"

    def parameters(self) -> tuple[Parameter, ...]:
        prior = _WAVE_RAD / self.largest_Nm if self.largest_Nm else np.inf
        beside = DISTRIBUTION * max(prior, abs(self.values[0]) if self.values else 0.0)
        return (Parameter("along_rad_per_Nm", _WEIGHT, 0.0, prior=prior),
                Parameter("across_rad_per_Nm", DISTRIBUTION * _WEIGHT, prior=beside))

    def per_guessed_load(self, view) -> np.ndarray:
        return np.full(2, True)

    def change(self, view) -> Change:
        torque, slope = _weight_of(view, self.index)
        columns, (along, across) = -np.stack([torque, slope], axis=1), self.values
        by_phi = self.by_own_entry(view, across * torque - along * slope)
        return Change((self.index,), columns @ np.array(self.values)[:, None], columns[:, None, :],
                      {"phi": by_phi})

    @classmethod
    def of_axis(cls, view, index: int) -> Iterable[Effect]:
        """Nothing where the robot has masses, or no lengths to guess them by."""
        if view.device is not Device.GEAR or view.has_masses or not view.moving[index]:
            return
        torque, slope = _weight_of(view, index)
        if np.std(torque) > _LEAST_SPREAD_NM:
            yield cls(index + 1, (0.0, 0.0), largest_Nm=float(np.max(np.hypot(torque, slope))))


def _weight_of(view, index: int) -> tuple[np.ndarray, np.ndarray]:
    """(N,) Nm of the generic masses about axis `index`, and its slope by the angle of that axis."""
    robot = with_generic_masses(view.robot)
    if robot.links is None:
        return np.zeros(view.rows), np.zeros(view.rows)
    q = view.theta / robot.ratios
    q[:, index] = view.phi[:, index]
    q = q + robot.offsets
    return (_core.gravity_torque(robot.core, q, view.threads)[:, index],
            _core.gravity_torque_jacobian(robot.core, q, view.threads)[:, index, index])
