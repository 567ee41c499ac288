"""Guide error: the way of a sliding axis is neither straight nor free of turns.

What the carriage does beside its way, at the place s from the axis's position x (m), by the frame before the
joint (z along the way):

    shift_a(x) = sum_k A_ak cos(k pi s),   turn_a(x) = sum_k B_ak cos(k pi s),   a = x, y, z;  k = 1 ... 16
    s = (x - seen_from) / R,   R = seen_to - seen_from: the way that was measured; beyond, s = 0 or 1

    displacement of the target = shift + turn x (target - carriage), and the turn

shift_z is the positioning error, shift_x and shift_y the straightness, turn_z the roll, turn_x and turn_y
pitch and yaw (the six error motions of a linear axis, ISO 230-1:2012). Terms are drawn to zero as those
of a rail whose curvature is white noise: sd(A_k) = size (2 / k)^2, and turns as the slopes of such shifts,
sd(B_k) = share sd(A_k) k pi / R: share = 1 of a short carriage, less of one whose blocks stand far apart.
Constant shifts and turns, and shifts in proportion to x, are the geometry's.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, OwnCurve, Parameter, Station
from exactarm.effects.moving_frames import MovingFrames
from exactarm.numerics.factors import lstsq
from exactarm.numerics.quadratic import variances
from exactarm.numerics.rotation import skew

_WAVES = 16  # the shortest is an eighth of the way long; they fall, and more cost the fit alone
_MOTIONS = tuple(f"{motion}_{axis}" for motion in ("shift", "turn") for axis in "xyz")
_TITLES = ("straightness along x", "straightness along y", "error along the way", "turn about x",
           "turn about y", "roll")
_TERM = re.compile(r"(?:shift_[xyz]_([1-9]\d?)_m|turn_[xyz]_([1-9]\d?)_rad)")
# size beside the way: from a ground machine guide (10 um/m) to a welded floor track (0.3 mm/m)
_SIZES_PER_WAY = (1e-5, 3e-5, 1e-4, 3e-4)
_TURN_SHARES = (1.0, 0.1)
_SETTLED = 0.1  # change of the log of a width: a prior's width is known no better from 96 terms
_PLACES = 101  # along the way, at which deviations are taken
_STRAIGHT, _TURNS = slice(0, 2), slice(3, 6)  # of the motions: across the way, and turns


@dataclass(frozen=True)
class GuideError(Effect):
    """values: A_x1 ... A_x16, A_y1 ..., A_z1 ..., B_x1 ... B_z16; `seen`: the way in m, of the axis's
    position less its offset; `size_m`, `turn_share`: see the module."""

    seen: tuple[float, float] = (0.0, 1.0)
    size_m: float = 1e-4
    turn_share: float = 1.0

    name = "guide_error"
    plain = "a guide that is not straight"
    station = Station.GEOMETRY
    kinds = WITH_TARGET
    compensable = True
    source = "ISO 230-1:2012, error motions of a linear axis"
    open_parameters = "of each motion as many terms as were fitted, each with its prior"

    @property
    def waves(self) -> int:
        return len(self.values) // len(_MOTIONS)

    @property
    def coefficients(self) -> np.ndarray:
        """(6, K) m and rad."""
        return np.reshape(self.values, (len(_MOTIONS), self.waves))

    def parameters(self) -> tuple[Parameter, ...]:
        wave = np.arange(1, self.waves + 1)
        shift = self.size_m * (2.0 / wave) ** 2
        turn = self.turn_share * shift * wave * np.pi / (self.seen[1] - self.seen[0])
        spread = [float(sd) for sd in (*np.tile(shift, 3), *np.tile(turn, 3))]
        names = [f"{motion}_{k}_{'m' if motion.startswith('shift') else 'rad'}"
                 for motion in _MOTIONS for k in wave]
        return tuple(Parameter(name, sd, prior=sd) for name, sd in zip(names, spread))

    def _waves_at(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Waves (N, K) at positions x (N,) m less the offset, and their slopes by x."""
        low, high = self.seen
        angle = np.pi * np.arange(1, self.waves + 1) / (high - low)
        phase = (np.clip(x, low, high) - low)[:, None] * angle
        inside = ((low < x) & (x < high))[:, None]
        return np.cos(phase), -angle * np.sin(phase) * inside

    def change(self, view) -> Change:
        frames, index = MovingFrames.of(view), self.index
        waves, slopes = self._waves_at(view.phi[:, index])
        along = frames.rotations[:, index]
        carriage = frames.origins[:, index + 1]
        carriage_by_q, arm = frames.point_by_q(carriage, index), view.signals["target"] - carriage
        motion, motion_by_x = waves @ self.coefficients.T, slopes @ self.coefficients.T
        by_motion = np.zeros((view.rows, 6, 6))
        by_motion[:, :3, :3] = along
        by_q, by_x = np.zeros((view.rows, 6, view.axes)), np.zeros((view.rows, 6, view.axes))
        for a in range(6):
            direction = along[:, :, a % 3]
            by_q[:, 3 * (a // 3) : 3 * (a // 3) + 3] += motion[:, a, None, None] * frames.direction_by_q(
                direction, index - 1)
            if a >= 3:
                by_motion[:, :3, a], by_motion[:, 3:, a] = np.cross(direction, arm), direction
        value = (by_motion @ motion[:, :, None])[:, :, 0]
        by_x[:, :, index] = (by_motion @ motion_by_x[:, :, None])[:, :, 0]
        turn = skew(value[:, 3:])
        # The target moves with all parameters before it, the carriage with the joints up to its own.
        by_q[:, :3] -= skew(arm) @ by_q[:, 3:] + turn @ carriage_by_q
        by_displacement, carried = np.zeros((view.rows, 6, 6)), np.zeros((view.rows, 6, 6))
        by_displacement[:, :3, :3] = turn
        carried[:, :3, :3], carried[:, :3, 3:], carried[:, 3:, 3:] = -turn, -skew(value[:, :3]), -turn
        by_parameters = (by_motion[:, :, :, None] * waves[:, None, None, :]).reshape(view.rows, 6, -1)
        by_signal = {"q": by_q, "phi": by_x, "displacement": by_displacement}
        return Change(tuple(range(6)), value, by_parameters, by_signal, (self.joint, carried))

    def drawn_wider(self, scale: float) -> Effect:
        return replace(self, size_m=scale * self.size_m)

    def redrawn(self, covariance: np.ndarray) -> Effect:
        """By expectation and maximisation (MacKay 1992): scale^2 = mean((value^2 + variance) / prior^2)."""
        prior = np.array([parameter.prior for parameter in self.parameters()])
        scale = np.sqrt(np.mean((np.square(self.values) + np.diag(covariance)) / prior**2))
        return self if abs(np.log(scale)) < _SETTLED else self.drawn_wider(float(scale))

    def measured(self, phi: np.ndarray) -> np.ndarray:
        low, high = self.seen
        return (low <= phi[:, self.index]) & (phi[:, self.index] <= high)

    @property
    def angles_measured(self) -> tuple[float, float]:
        return self.seen

    def _makes(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, K) each, at positions x: what makes a shift less its straight line, and a turn less its mean,
        of their coefficients."""
        places = np.linspace(*self.seen, _PLACES)
        waves, along = self._waves_at(x)[0], self._waves_at(places)[0]
        line = lambda at: np.stack([np.ones(len(at)), at], axis=1)
        return (waves - line(x) @ lstsq(line(places), along, rcond=None)[0],
                waves - along.mean(axis=0))

    def _part(self, motion: int, covariance: np.ndarray) -> np.ndarray:
        """(K, K) of one motion's coefficients."""
        return covariance.reshape(len(_MOTIONS), self.waves, len(_MOTIONS), self.waves)[motion, :, motion]

    def curves(self, position: np.ndarray, covariance: np.ndarray) -> tuple[OwnCurve, ...]:
        found = []
        for motion, title in enumerate(_TITLES):
            make, own = self._makes(position)[motion // 3], self._part(motion, covariance)
            variance = variances(make, own)
            found.append(OwnCurve(f"Guide of axis {self.joint}: {title}", "m" if motion < 3 else "rad",
                                  make @ self.coefficients[motion], np.sqrt(np.maximum(variance, 0.0))))
        return tuple(found)

    def _heights(self) -> np.ndarray:
        """(6,) peak to peak of the motions over the way."""
        nothing = np.zeros((len(self.values),) * 2)
        return np.array([np.ptp(curve.value)
                         for curve in self.curves(np.linspace(*self.seen, _PLACES), nothing)])

    def describe(self) -> str:
        height = 1e6 * self._heights()
        across, along, turn = height[_STRAIGHT].max(), height[2], height[_TURNS].max()
        return (f"the guide of axis {self.joint} deviates by {across:.0f} µm from a straight line, by "
                f"{along:.0f} µm along it, and turns by {turn:.0f} µrad, peak to peak over the way measured")

    def derived(self, covariance: np.ndarray) -> tuple[tuple[str, float, float], ...]:
        height, places, found = self._heights(), np.linspace(*self.seen, _PLACES), []
        for name, motions in (("straightness_m", _STRAIGHT), ("turn_rad", _TURNS)):
            motion = motions.start + int(np.argmax(height[motions]))
            make = self._makes(places)[motion // 3]
            curve = make @ self.coefficients[motion]
            difference = make[np.argmax(curve)] - make[np.argmin(curve)]
            variance = float(difference @ self._part(motion, covariance) @ difference)
            found.append((name, float(height[motion]), float(np.sqrt(max(variance, 0.0)))))
        return tuple(found)

    def to_table(self):
        return super().to_table() | {"seen_from_m": self.seen[0], "seen_to_m": self.seen[1],
                                     "size_m": self.size_m, "turn_share": self.turn_share}

    @classmethod
    def from_table(cls, table: Mapping[str, float | int | str]) -> Effect:
        """Terms that are not named are zero."""
        waves = max((int(term[1] or term[2]) for term in map(_TERM.fullmatch, table) if term), default=0)
        if waves == 0:
            raise KeyError("shift_x_1_m")
        seen, size = (float(table["seen_from_m"]), float(table["seen_to_m"])), float(table["size_m"])
        share = float(table.get("turn_share", 1.0))
        if not (seen[0] < seen[1] and size > 0.0 and share > 0.0):
            raise ValueError("expected seen_from_m < seen_to_m, size_m > 0 and turn_share > 0")
        raw = cls(table.get("joint"), (0.0,) * (len(_MOTIONS) * waves), seen=seen, size_m=size,
                  turn_share=share)
        return raw.with_values(table.get(parameter.name, 0.0) for parameter in raw.parameters())

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        """Of every axis that slides, in several sizes; the evidence chooses."""
        for index, joint in enumerate(robot.joints):
            x = view.phi[:, index]
            if joint.type == "prismatic" and view.moving[index] and np.ptp(x) > 0.0:
                seen = (float(x.min()), float(x.max()))
                empty = cls(index + 1, (0.0,) * (len(_MOTIONS) * _WAVES), seen=seen)
                for size, share in product(_SIZES_PER_WAY, _TURN_SHARES):
                    yield replace(empty, size_m=size * (seen[1] - seen[0]), turn_share=share)
