"""Gear eccentricity: an output wheel off its centre or oval, errors of first and second order per output
revolution.

change of phi = c1 cos(phi) + s1 sin(phi) + c2 cos(2 phi) + s2 sin(2 phi), amplitudes in rad. Its constant
part is an offset of the axis (the declared model has it).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from exactarm.data.kinds import ALL_KINDS
from exactarm.effects.axis_units import slides
from exactarm.effects.base import Change, Effect, Parameter, Station

SPREAD_RAD = 1e-3  # of real gears; on a part of a revolution, larger terms would imitate any slow curve
_SETTLED = 0.05  # change of the spread, as its logarithm, from which it is drawn anew

_LEAST_RANGE_RAD = 1.0  # on less, once per revolution is a parabola, and has no name


@dataclass(frozen=True)
class GearEccentricity(Effect):
    """Amplitudes of both orders; `second` False: of the first alone. spread_rad: standard deviation of each
    in a fit, that of real gears unless the data ask for a wider one; drawn_rad: that of the second order
    where the data did not ask for it, else 0. On a part of a revolution either order imitates the other."""

    second: bool = True
    spread_rad: float = SPREAD_RAD
    drawn_rad: float = 0.0

    name = "gear_eccentricity"
    plain = "run-out (once and twice a turn)"
    station = Station.GEAR
    kinds = ALL_KINDS
    compensable = True
    family = "gear curve"
    sentence = "the output of gear {joint} runs out of true, once and twice per revolution"
    source = "Mark, Performance-Based Gear Metrology (2013): run-out"

    def orders(self) -> tuple[tuple[float, float], ...]:
        return tuple((1.0 + k, float(np.hypot(*self.values[2 * k : 2 * k + 2])))
                     for k in range(len(self.values) // 2))

    def parameters(self) -> tuple[Parameter, ...]:
        names = ("first_cos_rad", "first_sin_rad", "second_cos_rad", "second_sin_rad")
        spread = 2 * [self.spread_rad] + 2 * [self.drawn_rad or self.spread_rad] * self.second
        return tuple(Parameter(name, 2e-4, prior=prior) for name, prior in zip(names, spread))

    def with_all_terms(self) -> Effect:
        """Wheels that run out of true once a revolution do so twice, too, by about as much at most."""
        if self.second or not any(self.values):
            return self
        return replace(self, values=(*self.values, 0.0, 0.0), second=True,
                       drawn_rad=float(np.hypot(*self.values)))

    def change(self, view) -> Change:
        phi = view.phi[:, self.index]
        shapes = [np.cos(phi), np.sin(phi), np.cos(2.0 * phi), np.sin(2.0 * phi)][: len(self.values)]
        slopes = [-np.sin(phi), np.cos(phi), -2.0 * np.sin(2.0 * phi),
                  2.0 * np.cos(2.0 * phi)][: len(self.values)]
        shape, values = np.stack(shapes, axis=1), np.array(self.values)
        by_phi = self.by_own_entry(view, np.stack(slopes, axis=1) @ values)
        return Change((self.index,), (shape @ values)[:, None], shape[:, None, :], {"phi": by_phi})

    def redrawn(self, covariance: np.ndarray) -> Effect:
        """By expectation and maximisation (MacKay 1992): spread^2 = mean(value^2 + variance); on a part of a
        revolution the intervals of a gear far worse than real ones would be those of the real ones else."""
        asked_for = slice(2 if self.drawn_rad else None)
        spread = np.sqrt(np.mean((np.square(self.values) + np.diag(covariance))[asked_for]))
        wider = max(float(spread), SPREAD_RAD)
        return self if abs(np.log(wider / self.spread_rad)) < _SETTLED else replace(self, spread_rad=wider)

    @classmethod
    def from_table(cls, table) -> Effect:
        raw = cls(table["joint"], (), second="second_cos_rad" in table)
        return raw.with_values(table[parameter.name] for parameter in raw.parameters())

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        for index in np.flatnonzero(view.moving & (np.ptp(view.phi, axis=0) > _LEAST_RANGE_RAD)):
            if not slides(robot, index + 1):  # a way has no turn
                yield cls(int(index) + 1, (0.0, 0.0), second=False)
                yield cls(int(index) + 1, (0.0, 0.0, 0.0, 0.0))
