"""Joint compliance: the drive train of an axis gives way under the torque that it carries.

change of q = -(linear torque + cubic torque^3), in rad; the joint torque of a static pose is the gravity
torque. Linear and cubic compliance, as the thesis takes for gears 2 and 3 (1.1.2, (2.18)); E4 for the sign. A
declared spring stays in the robot's tables; this is what is missing beside it.

Where the masses are generic (robot/generic_masses.py) the load is right in kind, not in size, and its shape
is a little wrong:
    change of q = -(linear torque + cubic torque^3 + tip torque_tip + own torque_own + sum_k m_k torque_k)
torque_tip: a tenth of the arm's mass at the flange, which makes up for a wrong distribution; torque_own: the
links without the payload, estimated where known payloads differ from row to row: then `linear` is that of a
known weight, in true Nm. torque_k: the first moment of a link, as large as the generic law has it (mx_3, my_3
and mz_3 of link 3). Once `linear` is about known,
    tip ~ N(0, (AT_TIP linear)^2),   own ~ N(0, linear^2),   m_k ~ N(0, (DISTRIBUTION linear)^2)
for poses that move few axes do not tell them from it; linear itself ~ N(0, spread^2), and the others by
spread in its place, once a search has found how soft the axis is.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from exactarm.data.kinds import MOTION, POSES, TRACKED_MOTION, WITH_TARGET
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.robot.generic_masses import DISTRIBUTION

_PLAUSIBLE = 5e-6
# Tenths of the arm's mass that hang at the flange, standard deviation: arms carry up to a third of their own
# (UR10 10 kg of 29, KR300 300 of 1,120, Panda 3 of 18).
AT_TIP = 3.0
# Of what a spring gives in all, what the bend of its curve does: at its rated torque a strain-wave gear is
# nearly twice as stiff as at small ones (makers' tables, size 17, ratio 100: 1.0 and 1.6e4 Nm/rad), and
# linear + 3 cubic T^2 = linear / 1.6 at T makes cubic T^3 an eighth of linear T.
BEND = 0.125


@dataclass(frozen=True)
class JointCompliance(Effect):
    """Compliance of one axis beyond its declared spring; `cubic_free` adds the cubic term to the estimate.

    beside_spring: only there may the linear term be negative, where the declared spring is too soft.
    """

    cubic_free: bool = False
    beside_spring: bool = True

    name = "joint_compliance"
    plain = "a joint that gives way under load"
    told_by = "linear_rad_per_Nm"
    in_axis_units = True
    station = Station.SPRING
    kinds = (POSES.name, MOTION.name, TRACKED_MOTION.name)
    compensable = True
    by_load = True
    per_load = True
    gives_way = True
    load = "that it carries"
    source = "thesis 1.1.2, (2.18), E4; Caenen and Angue 1990"

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("linear_rad_per_Nm", _PLAUSIBLE, -np.inf if self.beside_spring else 0.0),
                Parameter("cubic_rad_per_Nm3", 1e-12, fixed=not self.cubic_free, of_first=BEND))

    def describe(self) -> str:
        if self.values[0] < 0.0:
            return (f"axis {self.joint} gives way by {-self.values[0]:.3g} rad less for every Nm {self.load} "
                    f"than its declared spring has it{self._as_guessed}")
        return (f"axis {self.joint} gives way by {self.values[0]:.3g} rad for every Nm {self.load}"
                f"{self._as_guessed}")

    def describe_on(self, robot) -> str:
        """Beside a declared spring, what is missing is a change of it."""
        stiffness = robot.joints[self.index].spring_linear
        if not stiffness:
            return super().describe_on(robot)
        change = self.values[0]
        return self.in_units_of(robot, (
            f"axis {self.joint} gives way by {1.0 / stiffness + change:.3g} rad for every Nm {self.load}, "
            f"{abs(change):.3g} rad {'less' if change < 0.0 else 'more'} than its declared spring has it"
            f"{self._as_guessed}"))

    @property
    def _as_guessed(self) -> str:
        return ""

    def per_guessed_load(self, view) -> np.ndarray:
        """A third power: the cubic term's."""
        power = [3 if p.name == "cubic_rad_per_Nm3" else 1 for p in self.parameters()]
        return super().per_guessed_load(view) * np.array(power)

    def possible(self, robot, deviation) -> bool:
        """No spring gives way against a small load: where the linear term is zero, the cubic one decides."""
        stiffness = robot.joints[self.index].spring_linear
        linear = self.values[0] + (1.0 / stiffness if stiffness else 0.0)
        cubic = {p.name: value for p, value in zip(self.parameters(), self.values)}["cubic_rad_per_Nm3"]
        return linear > 0.0 or linear == 0.0 <= cubic

    def change(self, view) -> Change:
        linear, cubic = self.values
        torque = view.torque[:, self.index]
        derivative = np.stack([-torque, -(torque**3)], axis=1)[:, None, :]
        by_torque = self.by_own_entry(view, -(linear + 3.0 * cubic * torque**2))
        value = -(linear * torque + cubic * torque**3)
        return Change((self.index,), value[:, None], derivative, {"torque": by_torque})

    @classmethod
    def none_of(cls, robot, index: int, cubic_free: bool = False) -> JointCompliance:
        """That of axis `index` (from 0) at zero size."""
        return cls(index + 1, (0.0, 0.0), cubic_free, bool(robot.joints[index].spring_linear))

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        for i in range(robot.axes):
            if not (view.has_masses or view.measured_loads[i]):
                continue
            if view.guessed_load(i):
                at_rest = view.rest_load is not None
                varies = at_rest and view.rest_load.payload_varies
                forms = [(tip, False) for tip in sorted({True, varies})] + [(True, True)] * at_rest
                yield from (RelativeCompliance.none_of(robot, i, tip, varies, moments)
                            for tip, moments in forms)
                yield RelativeCompliance.none_of(robot, i, False, varies, cubic_free=True)
            else:
                yield from (cls.none_of(robot, i, cubic) for cubic in (False, True))

    @classmethod
    def from_table(cls, table) -> Effect:
        return RelativeCompliance.of_table(table) if "tip_rad_per_Nm" in table else super().from_table(table)


@dataclass(frozen=True)
class RelativeCompliance(JointCompliance):
    """Compliance under a generic load; tip_free, own_free: what is estimated beside the linear term; links:
    those whose first moments are, too, the last ones of the arm, as (first, last) from 1; spread: standard
    deviation of the linear term, 0 = not known yet. Where poses move few axes, a spring ten times as soft
    under a load that the flange takes nearly away does the same."""

    tip_free: bool = False
    own_free: bool = False
    links: tuple[int, int] | None = None
    spread: float = 0.0

    kinds = WITH_TARGET
    load = "of its load"

    def parameters(self) -> tuple[Parameter, ...]:
        linear = abs(self.values[0]) if self.values else 0.0
        about = self.spread or (max(linear, _PLAUSIBLE) if any(self.values) else np.inf)
        spread = DISTRIBUTION * (self.spread or linear or _PLAUSIBLE)
        return (
            Parameter("linear_rad_per_Nm", _PLAUSIBLE, -np.inf if self.beside_spring else 0.0,
                      prior=self.spread or np.inf),
            Parameter("tip_rad_per_Nm", _PLAUSIBLE, fixed=not self.tip_free, prior=AT_TIP * about),
            Parameter("own_rad_per_Nm", _PLAUSIBLE, fixed=not self.own_free, prior=about),
            JointCompliance.parameters(self)[1],
            *(Parameter(name, DISTRIBUTION * _PLAUSIBLE, prior=spread) for name in _moment_names(self.links)))

    def per_guessed_load(self, view) -> np.ndarray:
        """Beside payloads that are known, sizes are those of a known weight."""
        return super().per_guessed_load(view) * (not self.own_free)

    def possible(self, robot, deviation) -> bool:
        """Where the arm's own weight bends nothing, no share of it does: at its bound, unless the data leave
        it inside."""
        gives_way = self.beside_spring or self.values[0] + deviation[0] > 0.0 or not any(self.values)
        return gives_way and super().possible(robot, deviation)

    def drawn_wider(self, scale: float) -> Effect:
        return replace(self, spread=scale * _PLAUSIBLE)

    @property
    def _as_guessed(self) -> str:
        return "" if self.own_free else ", as a generic distribution of masses has it"

    def change(self, view) -> Change:
        linear, tip, own, cubic, *shares = self.values
        i, (rows, n) = self.index, view.q.shape
        torque, parts = view.torque[:, i], {} if view.rest_load is None else view.rest_load.parts(view.q)
        nothing = np.zeros((rows, n)), np.zeros((rows, n, n))
        (by_tip, tip_slope), (by_own, own_slope) = parts.get("tip", nothing), parts.get("own", nothing)
        columns = np.stack([torque, by_tip[:, i], by_own[:, i], torque**3], axis=1)
        slope = tip * tip_slope[:, i] + own * own_slope[:, i]
        if shares:
            at_rest = view.rest_load is not None
            moments = view.rest_load.moments(view.q, i) if at_rest else np.zeros((rows, len(shares)))
            columns = np.concatenate([columns, moments], axis=1)
            slope = slope + (view.rest_load.moments_slope(view.q, i, shares) if at_rest else 0.0)
        by_torque = self.by_own_entry(view, -(linear + 3.0 * cubic * torque**2))
        signals = {"torque": by_torque, "q": -slope[:, None, :]}
        return Change((i,), -columns @ np.array(self.values)[:, None], -columns[:, None, :], signals)

    @classmethod
    def none_of(cls, robot, index: int, tip_free: bool = True, own_free: bool = False,
                moments: bool = False, cubic_free: bool = False) -> RelativeCompliance:
        links = (index + 1, robot.axes) if moments else None
        return cls(index + 1, (0.0,) * (4 + len(_moment_names(links))), cubic_free,
                   bool(robot.joints[index].spring_linear), tip_free, own_free, links)

    @classmethod
    def of_table(cls, table) -> Effect:
        tip, own = (float(table[f"{name}_rad_per_Nm"]) for name in ("tip", "own"))
        last = table["joint"]
        while f"mx_{last}_rad_per_Nm" in table:
            last += 1
        links = (table["joint"], last - 1) if last > table["joint"] else None
        cubic = float(table.get("cubic_rad_per_Nm3", 0.0))
        raw = cls(table["joint"], (), cubic != 0.0, tip_free=tip != 0.0, own_free=own != 0.0, links=links)
        moments = (float(table[name]) for name in _moment_names(links))
        return raw.with_values((float(table["linear_rad_per_Nm"]), tip, own, cubic, *moments))


def _moment_names(links: tuple[int, int] | None) -> list[str]:
    """Of the first moments of links (first, last)."""
    if links is None:
        return []
    return [f"m{axis}_{link}_rad_per_Nm" for link in range(links[0], links[1] + 1) for axis in "xyz"]
