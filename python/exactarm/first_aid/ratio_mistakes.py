"""A wrong gear ratio in the robot file, from a motion whose masses are declared.

With s the true ratio of axis i over that of the file, joint angles that come from the motor's shrink by s,
and torques that were measured at the motor grow by it:

    tau' = Y(q') (pi + d) + J ratio^2 q_ddot' + coulomb sign(q_dot') + viscous q_dot' + constant

d: what the masses may be off by, drawn to zero as the effect link_masses has it, beside noise of NOISE of
each axis' torque; the rest is free. Were the masses free, they would take a ratio 10 % wrong. s runs over
`SCALES`, and is then refined. It is named where the product over the axes of the shares of their torque that
are left falls `LEAST_FALL` times.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy  # scipy.optimize is imported at its first use

from exactarm import _core
from exactarm.data.dataset import Dataset
from exactarm.effects.link_masses import tolerance
from exactarm.first_aid.drive_model import MotionSamples, dry_friction_of, samples_of, torque_sizes
from exactarm.first_aid.suspicion import Suspicion
from exactarm.robot.robot import Robot

# without a wrong ratio seven blind motions with hidden causes fall 1.09 times at most; 10 % off, 1.0 to 5.9
LEAST_FALL = 1.25
SCALES = (0.5, 2.0 / 3.0, 0.8, 0.9, 1.1, 1.25, 1.5, 2.0)
NOISE = 0.01  # of an axis' torque: drives report theirs no better
_LEAST_OFF = 0.03  # a smaller error is found, with its size, by `diagnose`
_LITTLE_LEFT = 0.03  # of the torque: then nothing is wrong with the ratios, whatever fits still better
_NOT_WORSE = 1.05
_REFINED = 0.15  # in ln s, about the best of SCALES


def ratio_mistakes(robot: Robot, data: Dataset) -> Iterator[Suspicion]:
    """The ratio that explains these torques better, if there is one."""
    if robot.links is None or robot.generic_masses or not {"theta", "tau_motor"} & set(data.joints):
        return
    samples = samples_of(robot, data)
    dry = dry_friction_of(samples.motion.rate)  # a width fitted by way of a ratio would pass for one
    left = lambda axis, scale: _left(_with_ratio(samples, data, axis, scale), dry)
    now = left(0, 1.0)
    if now.max() < _LITTLE_LEFT:
        return
    moving = np.flatnonzero(np.ptp(samples.motion.q, axis=0) > _LEAST_OFF)
    tried = {(axis, scale): np.log(left(axis, scale)).sum() for axis in moving for scale in SCALES}
    axis, start = min(tried, key=lambda key: tried[key], default=(0, 1.0))
    found = scipy.optimize.minimize_scalar(lambda x: np.log(left(axis, np.exp(x))).sum(), method="bounded",
                                     bounds=np.log(start) + np.array([-_REFINED, _REFINED]),
                                     options={"xatol": 2e-3})
    scale = float(np.exp(found.x))
    falls = now / left(axis, scale)
    if np.prod(falls) > LEAST_FALL and falls.min() > 1.0 / _NOT_WORSE and abs(scale - 1.0) > _LEAST_OFF:
        ratio = robot.joints[axis].ratio
        yield Suspicion(f"with a gear ratio of axis {axis + 1} of about {scale * ratio:.3g} in place of "
                        f"{ratio:.4g} the torques would fit the declared masses better: check the robot file")


def _with_ratio(samples: MotionSamples, data: Dataset, axis: int, scale: float) -> MotionSamples:
    angles, torques = np.ones((2, len(samples.angle_scale)))
    angles[axis] = 1.0 / scale if "theta" in data.joints else 1.0
    torques[axis] = 1.0 if "tau" in data.joints else scale
    motion, offset = samples.motion, samples.motion.robot.offsets
    turned = replace(motion, q=(motion.q - offset) * angles + offset, rate=motion.rate * angles,
                     acceleration=motion.acceleration * angles)
    return replace(samples, motion=turned, torque=samples.torque * torques)


def _left(samples: MotionSamples, dry: np.ndarray) -> np.ndarray:
    """(n,) share of every axis' torque that the declared masses, within their tolerance, leave; dry (N, n):
    sign of dry friction."""
    robot, (rows, n) = samples.motion.robot, samples.torque.shape
    size = np.where(samples.moves, torque_sizes(samples.torque), np.inf)
    motion = samples.motion.arrays
    goal = (samples.torque - _core.inverse_dynamics(robot.core, *motion)) / size
    masses = _core.dynamics_regressor(robot.core, *motion) * (tolerance(robot) / NOISE)
    columns = np.zeros((rows, n, 4 * n))
    for k, values in enumerate((samples.motion.acceleration, dry, samples.motion.rate, np.ones((rows, n)))):
        columns[:, np.arange(n), k * n + np.arange(n)] = values
    matrix = np.concatenate([masses, columns], axis=2) / size[:, None]
    matrix = matrix.reshape(rows * n, -1)
    length = np.linalg.norm(matrix[:, masses.shape[2]:], axis=0)
    matrix[:, masses.shape[2]:] /= np.where(length > 0.0, length, 1.0)
    ridge = np.concatenate([np.ones(masses.shape[2]), np.full(4 * n, 1e-9)])
    x = np.linalg.solve(matrix.T @ matrix + np.diag(ridge), matrix.T @ goal.ravel())
    return np.maximum(np.sqrt(np.mean((goal - (matrix @ x).reshape(rows, n)) ** 2, axis=0)), 1e-9)
