"""What effects of the drive share: they add to the drive torque (output side) and follow the motor's rate.

rate = theta_dot / ratio in rad/s, output side, by the controller's (nominal) ratio: drive friction acts on
the motor side of the spring. sign(rate) is smoothed to tanh(rate / width) (Andersson et al. 2007), a motor at
rest being in no defined state of friction.
"""

from abc import ABC
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from exactarm.data.kinds import MOTION
from exactarm.effects.base import Change, Effect, Station
from exactarm.view import SIGN_WIDTH_RAD_S

Law = Callable[[np.ndarray, np.ndarray], np.ndarray]

_OUTPUT_SIDE = {"rate": "theta_dot", "angle": "theta"}
_LEAST_SWING = 1e-3  # of the width
_FLAT = 19.0  # widths from which tanh is one to the last digit


def smooth_sign(rate: np.ndarray, width=SIGN_WIDTH_RAD_S, swing=0.0) -> np.ndarray:
    """Mean of tanh(rate / width) over rate - swing ... rate + swing.

    swing: how far the rate moves in half a sample. Without it a sharp reversal would jump at a sample,
    wherever between two of them it is.
    """
    width, swing = _spread(rate, width, swing)
    found = np.sign(rate)
    near = np.abs(rate) < swing + _FLAT * width
    rate, width, swing = rate[near], width[near], swing[near]
    high, low = _log_cosh((rate + swing) / width), _log_cosh((rate - swing) / width)
    found[near] = width / (2.0 * swing) * (high - low)
    return found


def smooth_sign_slope(rate: np.ndarray, width=SIGN_WIDTH_RAD_S, swing=0.0) -> np.ndarray:
    """Its slope by the rate."""
    high, low, swing = _ends(rate, width, swing)
    return (np.tanh(high) - np.tanh(low)) / (2.0 * swing)


def _ends(rate: np.ndarray, width, swing) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Both ends of rate - swing ... rate + swing over the width, and the swing, never nothing."""
    width, swing = _spread(rate, width, swing)
    return (rate + swing) / width, (rate - swing) / width, swing


def _spread(rate: np.ndarray, width, swing) -> tuple[np.ndarray, np.ndarray]:
    """Width and swing of every rate, the swing never nothing."""
    width = np.broadcast_to(width, rate.shape)
    return width, np.maximum(np.broadcast_to(swing, rate.shape), _LEAST_SWING * width)


def over_samples(view, index: int, law: Law | None = None) -> np.ndarray:
    """(N,) of a law of friction of one axis (from 0), a function of its sign and its rate on the output side,
    or of the sign: mean over the samples of the log that a row stands for."""
    found = view.dry_friction(index, law)
    if found is not None:
        return found
    rate = view.signals["theta_dot"][:, index] / view.robot.controller_ratios[index]
    sign = smooth_sign(rate, view.sign_width[index], view.swing[:, index])
    return sign if law is None else law(sign, rate)


def sign_slopes(view, index: int) -> tuple[np.ndarray, np.ndarray]:
    """(N,) each: slope of the sign of one axis (from 0) by its rate and by its angle, on the output side."""
    by_angle, by_rate = view.sign_by_angle(index), view.sign_by_rate(index)
    if by_angle is not None:
        return np.zeros_like(by_angle), by_angle
    if by_rate is None:
        rate = view.signals["theta_dot"][:, index] / view.robot.controller_ratios[index]
        by_rate = smooth_sign_slope(rate, view.sign_width[index], view.swing[:, index])
    return by_rate, np.zeros_like(by_rate)


def smooth_square(rate: np.ndarray, width=SIGN_WIDTH_RAD_S, swing=0.0) -> tuple[np.ndarray, np.ndarray]:
    """Mean of tanh(rate / width)^2 over the same, and its slope by the rate."""
    high, low, swing = _ends(rate, width, swing)
    high, low = np.tanh(high), np.tanh(low)
    return 1.0 - width * (high - low) / (2.0 * swing), (high**2 - low**2) / (2.0 * swing)


def _log_cosh(x: np.ndarray) -> np.ndarray:
    """log(2 cosh x), for any x."""
    return np.abs(x) + np.log1p(np.exp(-2.0 * np.abs(x)))


@dataclass(frozen=True)
class DriveEffect(Effect, ABC):
    """Adds to the drive torque of one axis, Nm on the output side."""

    station = Station.DRIVE
    in_axis_units = True
    kinds = (MOTION.name,)
    compensable = False  # changes the torque that is needed, not where the arm goes
    unless_declared: ClassVar[str] = ""  # field of a joint: no candidate where the tables have it

    def rate(self, view) -> np.ndarray:
        """(N,) motor rate on the output side, rad/s."""
        return view.signals["theta_dot"][:, self.index] / view.robot.controller_ratios[self.index]

    def sign(self, view) -> np.ndarray:
        """(N,) of dry friction."""
        return self.over_samples(view)

    def slopes(self, view, by_sign: np.ndarray, by_rate: np.ndarray | float = 0.0) -> dict[str, np.ndarray]:
        """Slopes (N,) of a torque by the motor's rate and angle from those by sign and rate."""
        rate, angle = sign_slopes(view, self.index)
        return {"rate": by_sign * rate + by_rate, "angle": by_sign * angle}

    def over_samples(self, view, *law) -> np.ndarray:
        return over_samples(view, self.index, *law)

    def torque_change(self, view, columns: list[np.ndarray], **slopes: np.ndarray) -> Change:
        """Change of a torque that is linear in its parameters: columns (N,) each, and slopes (N,) by this
        axis' own entry of upstream signals; `rate`, `angle`: of the motor, on the output side."""
        stacked = np.stack(columns, axis=1)
        value = stacked @ np.asarray(self.values)
        return Change((self.index,), value[:, None], stacked[:, None, :], self.by_signal(view, **slopes))

    def by_signal(self, view, **slopes: np.ndarray) -> dict[str, np.ndarray]:
        result = {}
        for name, slope in slopes.items():
            if name in _OUTPUT_SIDE:
                name, slope = _OUTPUT_SIDE[name], slope / view.robot.controller_ratios[self.index]
            result[name] = self.by_own_entry(view, slope)
        return result

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        return (cls(i + 1, (0.0,) * len(cls(i + 1, ()).parameters())) for i in moving_axes(view)
                if not cls.unless_declared or getattr(robot.joints[i], cls.unless_declared) is None)


def moving_axes(view) -> list[int]:
    """Axes (from 0) that move in the data of a time series."""
    rate = view.signals["theta_dot"] / view.robot.controller_ratios
    return [i for i in range(view.axes) if np.max(np.abs(rate[:, i]), initial=0.0) > SIGN_WIDTH_RAD_S]
