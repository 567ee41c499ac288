"""What the noise of measured angles does to the torque that is computed from them, and the bandwidth at which
it stays below the noise of the measured torque.

White noise sigma_j of the angle of axis j (counts of an encoder, rounded digits), sampled every dt s, moves
the torque of axis i behind a low-pass at f, x = 2 pi f, by sqrt(2 f dt) times

    x^2 / sqrt(5) s_i,      s_i^2 = sum_j M_ij^2 sigma_j^2      of the inertia M, differentiated twice
    x / sqrt(3) d_i,        d_i = D_i sigma_i                   of dry friction that turns over at slow rows

and noise of a measured rate by x / sqrt(3) s_i and d_i. D_i: the RMS slope of F tanh(rate / width) over all
rows. White noise of the torque itself leaves sqrt(2 f dt) of its size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.chain.log_samples import low_pass
from exactarm.data.dataset import Dataset
from exactarm.data.kinds.base import runs_in_time
from exactarm.numerics.factors import lstsq
from exactarm.numerics.signals import step_of_quantisation
from exactarm.numerics.stamps import typical_step
from exactarm.numerics.white_noise import white_noise, white_noise_of_smooth
from exactarm.robot.generic_masses import generic_links
from exactarm.robot.robot import Robot
from exactarm.view import SIGN_WIDTH_RAD_S, motor_angles

_SHARE = 1.0 / 3.0  # of the torque's own noise: raises what is left by a twentieth
_LEAST_TORQUE_NOISE = 1e-3  # of the torque's RMS: no drive says it better
_SAMPLED_ROWS = 16
# of accelerations: a residual that holds the same noise follows them by a ten-thousandth of its square sum
_ACCELERATION_SHARE = 0.01
_SLOW_HZ, _LEAST_PERIODS, _NYQUIST = 5.0, 2.0, 0.4  # arms are moved below it
_SLOPE_S = 0.02  # over which rates are taken for the friction: a reversal lasts longer


@dataclass(frozen=True)
class AngleNoise:
    """inertia, friction (n,): s and d of the angles, or of measured rates; own (n,): white noise of the
    torque, NaN where none was measured; slope (n,): of the dry friction where its axis is slowest, step (n,):
    of a rounded angle; all in Nm, rad and s."""

    inertia: np.ndarray
    friction: np.ndarray
    own: np.ndarray
    of_rates: bool
    slope: np.ndarray
    step: np.ndarray

    def torque(self, frequency: float) -> np.ndarray:
        """(n,) Nm: the white noise of a torque that would leave as much behind a low-pass at so many Hz."""
        x = 2.0 * np.pi * frequency
        if self.of_rates:
            return np.hypot(self.inertia * x / np.sqrt(3.0), self.friction)
        return np.hypot(self.inertia * x**2 / np.sqrt(5.0), self.friction * x / np.sqrt(3.0))

    @property
    def quiet_below(self) -> float:
        """Hz: the highest low-pass at which it is a third of the torque's own noise. What no low-pass takes
        more from it than from the torque does not count."""
        allowed = _SHARE * self.own
        if self.of_rates:
            x = allowed * np.sqrt(3.0) / np.maximum(self.inertia, 1e-300)
        else:
            a, b = self.inertia**2 / 5.0, self.friction**2 / 3.0
            x = np.sqrt(2.0 / np.maximum(b + np.sqrt(b**2 + 4.0 * a * allowed**2), 1e-300)) * allowed
        return float(np.min(x[self.own > 0.0], initial=np.inf)) / (2.0 * np.pi)

    def creeps(self, frequency: float, period: float) -> np.ndarray:
        """(n,) bool: axes at which one count within a period of the low-pass, for which the rate jumps by
        count times frequency, moves the friction by more than a third of the torque's noise; period: of the
        samples."""
        left = self.own * np.sqrt(2.0 * frequency * period)
        return self.slope * self.step * frequency > _SHARE * np.nan_to_num(left, nan=np.inf)


def angle_noise(robot: Robot, data: Dataset, theta: np.ndarray, torque: np.ndarray,
                rates: np.ndarray | None) -> AngleNoise:
    """Of a motion with motor angles theta (N, n); torque (N, n) on the output side, rates (N, n) of the
    motors where they were measured."""
    runs, scale = runs_in_time(data), np.abs(robot.ratios)
    angle = theta / scale
    noise, step = np.array([_noise(column, runs)
                            for column in (angle if rates is None else rates / scale).T]).T
    white = np.median([[white_noise(column) for column in torque[rows].T] for rows in runs], axis=0)
    own = np.maximum(white, _LEAST_TORQUE_NOISE * np.sqrt(np.mean(torque**2, axis=0)))
    slope, slow = _friction(data, angle, torque, runs) if np.any(noise) else np.zeros((2, robot.axes))
    return AngleNoise(np.sqrt(_mean_square_inertia(robot, data) @ noise**2), slope * slow * noise, own,
                      rates is not None, slope, step if rates is None else np.zeros(robot.axes))


def quiet_acceleration(angle: np.ndarray, runs: list[np.ndarray], step: float, highest: float) -> float:
    """Hz: the highest low-pass, up to `highest`, of angles (N, n), sampled every `step` s, behind which noise
    is at most a hundredth of the acceleration of any axis that moves."""
    found = highest
    for column in angle.T:
        noise, _ = _noise(column, runs)
        slow = [np.diff(low_pass(column[rows], _SLOW_HZ, step), 2) / step**2 for rows in runs
                if rows.size * step * _SLOW_HZ > _LEAST_PERIODS and _SLOW_HZ * step < _NYQUIST]
        moved = float(np.sqrt(np.mean(np.concatenate(slow) ** 2))) if slow else 0.0
        if noise > 0.0 and moved > 0.0:
            gain = 4.0 * np.pi**2 * np.sqrt(2.0 * step / 5.0) * noise  # times f^(5/2)
            found = min(found, float((_ACCELERATION_SHARE * moved / gain) ** 0.4))
    return max(found, min(highest, _SLOW_HZ))


def _noise(values: np.ndarray, runs: list[np.ndarray]) -> tuple[float, float]:
    """Of an angle, or a rate, and the step to which it is rounded."""
    step = float(np.median([step_of_quantisation(values[rows]) for rows in runs]))
    white = float(np.median([white_noise_of_smooth(values[rows]) for rows in runs]))
    return max(white, step / np.sqrt(12.0)), step


def _friction(data: Dataset, angle: np.ndarray, torque: np.ndarray, runs: list[np.ndarray]) -> np.ndarray:
    """(2, n): the steepest slope F / width of the dry friction, and the RMS of the slope over all rows beside
    it. F from how torques change over 20 ms, beside what rates, accelerations and angles explain."""
    signs, changes, beside, slopes = [], [], [], []
    for rows in runs:
        stride = max(1, int(round(_SLOPE_S / typical_step(data.time[rows])))) if rows.size > 1 else 1
        q, tau = angle[rows][::stride], torque[rows][::stride]
        if len(q) < 4:
            continue
        rate = np.gradient(q, data.time[rows][::stride], axis=0)
        signs.append(np.diff(np.tanh(rate / SIGN_WIDTH_RAD_S), axis=0))
        changes.append(np.diff(tau, axis=0))
        beside.append(np.hstack([np.diff(q, axis=0), np.diff(rate, axis=0),
                                 np.diff(np.gradient(rate, axis=0), axis=0)]))
        slopes.append(np.cosh(np.minimum(np.abs(rate) / SIGN_WIDTH_RAD_S, 50.0)) ** -4.0)
    found = np.zeros((2, angle.shape[1]))
    if not signs:
        return found
    signs, changes, beside, slopes = (np.concatenate(each) for each in (signs, changes, beside, slopes))
    for axis in np.flatnonzero(~np.isnan(changes).any(axis=0) & (np.ptp(signs, axis=0) > 0.0)):
        columns = np.column_stack([signs[:, axis], beside])
        columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        size = lstsq(columns, changes[:, axis], rcond=1e-9)[0][0]
        friction = max(float(size / np.linalg.norm(signs[:, axis])), 0.0)
        found[:, axis] = friction / SIGN_WIDTH_RAD_S, np.sqrt(np.mean(slopes[:, axis]))
    return found


def sampled_angles(robot: Robot, data: Dataset) -> np.ndarray:
    """(16 at most, n) joint angles, evenly spread over the rows."""
    rows = np.linspace(0, len(data) - 1, min(_SAMPLED_ROWS, len(data))).astype(int)
    return motor_angles(robot, data.select(rows)) / robot.ratios + robot.offsets


def _mean_square_inertia(robot: Robot, data: Dataset) -> np.ndarray:
    """(n, n) of the mass matrix with the declared rotors over the motion; of masses by the arm's size where
    those are larger: tables may hold none that mean anything before they are identified."""
    q = sampled_angles(robot, data)
    rotors = np.diag([joint.rotor_inertia or 0.0 for joint in robot.joints] * robot.ratios**2)
    links = [links for links in (robot.links, generic_links(robot)) if links is not None]
    matrices = [_core.mass_matrix(replace(robot, links=each).core, q) for each in links]
    return np.max([np.mean(np.square(matrix + rotors), axis=0)
                   for matrix in (np.zeros((1, *rotors.shape)), *matrices)], axis=0)
