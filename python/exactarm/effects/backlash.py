"""Backlash: clearance between the teeth; the link rests on the loaded flank.

change of q = -width / 2 * s,   s = tanh((torque + bias + friction * direction) / transition)

torque is what the joint carries (the spring's torque, E4; in motions as the drives tell it,
view.signals["carried"]: the angles that the model takes it from have been bent by the gap itself), friction
the joint's Coulomb friction against the direction of motion: it decides where the load is small. transition =
friction / 5, so that friction alone presses the flanks together. Two-state model of Nordin and Gutman 2002,
at rest on either flank. bias: only where the masses are generic (robot/generic_masses.py): their load is
right in kind, and need not change its sign where the real one does.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import ALL_KINDS, Device
from exactarm.effects.base import Change, Effect, Parameter, Station

_TRANSITION_SHARE = 0.2
_FRICTION_SHARE = 0.02  # of the largest load, where no friction is declared
# to choose from, where the device shows the flank itself
_FRICTION_SHARES = (0.003, 0.005, 0.0075, 0.011, 0.016, 0.023, 0.033, 0.048, 0.07, 0.1, 0.15, 0.22, 0.33)
# of a generic load, where the real one may change its sign, every fiftieth row: with every fifteenth, rows on
# the wrong flank left an unknown function of the load the likelier one; fewer frictions are tried with each
_BIAS_QUANTILES, _FEW = tuple(np.linspace(0.02, 0.98, 49)), 3
_LEAST_FRICTION_NM = 0.1
# deviations of the measured load that the flank takes to change: less, and noise would turn it over
_CERTAIN = 3.0


@dataclass(frozen=True)
class Backlash(Effect):
    """values: width of the clearance at the output, and the friction that decides at small loads, chosen from
    `search`; with `least_Nm` above zero it is estimated from there, and not below that; a third is the bias
    of the load, chosen from `biases`."""

    search: tuple[float, ...] = ()
    least_Nm: float = 0.0
    biases: tuple[float, ...] = ()

    name = "backlash"
    plain = "play in the gear"
    in_axis_units = True
    station = Station.SPRING
    kinds = ALL_KINDS
    compensable = True
    by_load = True
    smooth = False
    sentence = "axis {joint} has {width_rad:.3g} rad of backlash and rests on the loaded flank"
    source = "Nordin and Gutman 2002"

    def parameters(self) -> tuple[Parameter, ...]:
        own = (Parameter("width_rad", 3e-4, 0.0, 1e-2),
               Parameter("friction_Nm", 10.0, self.least_Nm, fixed=self.least_Nm == 0.0, search=self.search))
        bias = Parameter("bias_Nm", 10.0, fixed=True, search=self.biases)
        return own if len(self.values) < 3 else (*own, bias)

    @classmethod
    def from_table(cls, table) -> Effect:
        names = ("width_rad", "friction_Nm", *(("bias_Nm",) if "bias_Nm" in table else ()))
        return cls(table["joint"], tuple(float(table[name]) for name in names))

    def flank(self, view) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """s (N,) in [-1, 1] and its derivatives by the torque and the friction."""
        friction = max(self.values[1], _LEAST_FRICTION_NM)
        transition = _TRANSITION_SHARE * friction
        modelled, direction = view.torque[:, self.index], view.direction[:, self.index]
        carried = (view.signals["carried"][:, self.index] if "carried" in view.signals
                   else np.full_like(modelled, np.nan))
        measured = ~np.isnan(carried)
        load = np.where(measured, carried, modelled)
        load = load + (self.values[2] if len(self.values) > 2 else 0.0)
        s = np.tanh((load + friction * direction) / transition)
        slope = (1.0 - s**2) / transition
        return s, np.where(measured, 0.0, slope), -slope * load / friction

    def change(self, view) -> Change:
        s, slope, by_friction = self.flank(view)
        half = 0.5 * self.values[0]
        derivative = np.zeros((view.rows, 1, len(self.values)))
        derivative[:, 0, :2] = np.stack([-0.5 * s, -half * by_friction], axis=1)
        return Change((self.index,), (-half * s)[:, None], derivative,
                      {"torque": self.by_own_entry(view, -half * slope)})

    def could_change(self, view) -> tuple[np.ndarray, np.ndarray] | None:
        """Either flank, under a load that is guessed: where it changes sign is not known."""
        if len(self.values) < 3:
            return None
        half = np.full(view.rows, 0.5 * abs(self.values[0]))
        return -half, half

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        for index, joint in enumerate(robot.joints):
            load = np.max(np.abs(view.torque[:, index]), initial=0.0)
            # Without a load the flank is that of the direction alone: hysteresis, in a static pose.
            sided = view.is_series and bool(np.any(view.direction[:, index]))
            if load < _LEAST_FRICTION_NM and not sided:
                continue
            least = _LEAST_FRICTION_NM
            if "carried_noise" in view.signals:
                noise = float(np.nan_to_num(view.signals["carried_noise"][index]))
                least = max(least, _CERTAIN * noise / _TRANSITION_SHARE)
            small = max(_FRICTION_SHARE * load, least)
            if not view.is_series and load <= small:
                continue  # at rest only friction would press the flanks, which is hysteresis by another name
            if view.device is Device.DRIVES:
                # A drive torque shows the flank while it changes sides, by the rates: few places to start
                # from are enough.
                shares = [small] + ([joint.coulomb] if joint.coulomb else [])
            else:
                shares = [share * load
                          for share in _FRICTION_SHARES] + ([joint.coulomb] if joint.coulomb else [])
            # In static poses the flank is seen on either side of the change, and next to never while it
            # changes.
            shares = sorted({min(max(value, least), max(load, small)) for value in shares})
            if robot.generic_masses and not view.is_series and not view.measured_loads[index]:
                inner = np.quantile(view.torque[:, index], _BIAS_QUANTILES)
                few = tuple(shares[:: max(1, len(shares) // _FEW)])
                yield cls(index + 1, (0.0, few[0], 0.0), few, 0.0, tuple(float(-value) for value in inner))
                continue
            yield cls(index + 1, (0.0, shares[0]), tuple(shares), least if sided else 0.0)
