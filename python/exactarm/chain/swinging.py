"""Where inertia swings a drive train, so that a gear run's quasi-static chain does not hold.

The chain bends the springs by gravity alone (thesis 3.1.1). Inertia, torque less what it is at rest, bends
the declared spring of the moving axis as well; b(t) is the rate of that. Samples where b exceeds the
gyroscope's noise are left out, as the thesis keeps to the stretch of constant velocity, unless the data
themselves say that nothing swings there:

    reading along the axis - predicted rate = c0 + c1 rate + c2 acceleration + s b + noise,   all d s before

A scale error, a delay d (for which c2 is zero) or a bias may show, a share s near 1 of the bending may not,
and what is left must be no more than elsewhere. A delay shows only where an axis accelerates, so these
samples are worth keeping.
"""

import numpy as np
import scipy  # scipy.ndimage is imported at its first use

from exactarm import _core
from exactarm.numerics.factors import pinv
from exactarm.numerics.signals import derivative, gaussian_filter
from exactarm.numerics.stamps import typical_step
from exactarm.robot.robot import Robot

_STEP_S, _REACH_S = 0.005, 0.03
LEAST_RATE_RAD_S = 2e-4
_SMOOTH_HZ = 40.0  # of the acceleration that a delay follows
_SHARE, _SCATTER = 0.35, 1.25  # of the bending that may show; of what is left beside what is left elsewhere
_LEAST_ROWS = 50
# of a delay: what time_delay allows, a hundredth of a millisecond moves no reading beyond noise; passes
_MOST_S, _SAME_S, _PASSES = 0.1, 1e-5, 8


def bending_rate(robot: Robot, theta: np.ndarray, acceleration: np.ndarray, time: np.ndarray,
                 axis: int) -> np.ndarray:
    """(R,) rad/s, from motor angles (R, n) and the acceleration (R,) of one; 0 without masses or a spring."""
    spring = robot.joints[axis].spring_linear
    if robot.links is None or not spring or time.size < 16:
        return np.zeros(time.size)
    few = np.unique(np.append(np.arange(0, time.size, max(1, int(_STEP_S / typical_step(time)))),
                              time.size - 1))
    q = theta[few] / robot.ratios + robot.offsets
    q_ddot = np.zeros_like(q)
    q_ddot[:, axis] = acceleration[few] / robot.ratios[axis]
    torque = _core.inverse_dynamics(robot.core, q, np.zeros_like(q),
                                    q_ddot) - _core.gravity_torque(robot.core, q)
    return -np.interp(time, time[few], np.gradient(torque[:, axis] / spring, time[few]))


def swings(bending: np.ndarray, time: np.ndarray, noise: float) -> np.ndarray:
    """(R,) bool: where b exceeds the noise, and around."""
    return widened(np.abs(bending) > max(noise, LEAST_RATE_RAD_S), time, _REACH_S)


def widened(mask: np.ndarray, time: np.ndarray, reach_s: float) -> np.ndarray:
    """(R,) all samples within `reach_s` of one in the mask."""
    if not mask.any():
        return mask
    reach = max(1, int(np.ceil(reach_s / typical_step(time))))
    return scipy.ndimage.maximum_filter1d(mask.astype(np.uint8), 2 * reach + 1, mode="constant") > 0


def follows_quietly(gyro, predicted, bending, time, runs, swinging, usable) -> bool:
    """Whether one axis does not swing after all.

    gyro (N, 3); predicted (N,) rate of the link, bending (N,); runs: row indices of the runs of this axis;
    swinging, usable (N,) bool: rows in question, and rows on which everything else is well.
    """
    along = []
    for rows in runs:
        toward = gyro[rows].T @ predicted[rows]
        along.append(gyro[rows] @ (toward / max(np.linalg.norm(toward), 1e-300)))
    rows, answer, delay = np.concatenate(runs), np.concatenate(along), 0.0
    kept = swinging[rows][usable[rows]]
    if kept.sum() < _LEAST_ROWS or (~kept).sum() < _LEAST_ROWS:
        return False
    for _ in range(_PASSES):
        late = np.concatenate([_late(predicted[run], bending[run], time[run], delay) for run in runs])
        design, beside = late[usable[rows]], (answer - late[:, 1])[usable[rows]]
        norm = np.linalg.norm(design, axis=0)
        if norm.min() == 0.0:
            return False
        inverse = pinv(design / norm)
        values = inverse @ beside / norm
        # (1 + c1) rate(t - delay) = (1 + c1) rate + c2 acceleration, to first order
        later = delay - values[2] / (1.0 + values[1])
        if abs(later) > _MOST_S or abs(later - delay) < _SAME_S:
            break
        delay = later
    left = beside - design @ values
    scatter = np.sqrt(np.mean(left[kept] ** 2))
    uncertain = scatter * np.sqrt(inverse[3] @ inverse[3]) / norm[3]
    elsewhere = np.sqrt(np.mean(left[~kept] ** 2))
    return bool(abs(values[3]) + 2.0 * uncertain < _SHARE and scatter < _SCATTER * elsewhere)


def _late(predicted: np.ndarray, bending: np.ndarray, time: np.ndarray, delay: float) -> np.ndarray:
    """(R, 4) what a reading `delay` s late follows in one run: a bias, rate, acceleration, bending."""
    rate, bent = (np.interp(time - delay, time, values) for values in (predicted, bending))
    acceleration = gaussian_filter(derivative(rate, time), time, _SMOOTH_HZ)
    return np.column_stack([np.ones(time.size), rate, acceleration, bent])
