"""What the sensors make of the truth: noise, counting encoders, wrong rows, warming up.

Delays, misalignment, scales and drifts are effects (effects/time_delay.py, effects/gyro_misalignment.py,
...): they are put into the virtual robot like any other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm.data.dataset import Dataset
from exactarm.robot.robot import Robot

DEGREE = np.pi / 180.0
COUNTS = 2**16  # per motor revolution, of an ordinary absolute encoder
_OUTLIER_SIZE = 30.0  # of the noise
_WARM_UP_SHARE = 0.4  # of the measurement: time constant of the warming


@dataclass(frozen=True)
class Sensors:
    """Standard deviations of white noise: position m, orientation rad, gyro rad/s, torque as a share of its
    RMS per axis (or Nm where `torque_Nm` is given); counts per motor revolution (0: exact; None: COUNTS where
    a gear is declared); share of wrong rows; temperature in degC at the start and in the end (None: not
    measured)."""

    position_m: float = 5e-5
    orientation_rad: float = 5e-5
    gyro_rad_s: float = 0.05 * DEGREE
    torque_share: float = 0.01
    torque_Nm: float | None = None
    counts: int | None = None
    wrong_rows: float = 0.0
    temperature_degC: tuple[float, float] | None = None


def read(data: Dataset, sensors: Sensors, random: np.random.Generator, robot: Robot | None = None) -> Dataset:
    """The data set as the sensors report it. Without `counts`, an axis of no declared gear reports its angle
    exactly: a count of the motor's encoder would be applied to the output, a hundred times too coarse."""
    changes = {"joints": dict(data.joints)}
    theta = data.joints["theta"]
    geared = [True] * theta.shape[1] if robot is None else [joint.has_gear for joint in robot.joints]
    counts = [COUNTS * gear if sensors.counts is None else sensors.counts for gear in geared]
    step = np.array([2.0 * np.pi / count if count else 0.0 for count in counts])
    with np.errstate(divide="ignore", invalid="ignore"):
        changes["joints"]["theta"] = np.where(step > 0.0, np.round(theta / step) * step, theta)
    if "tau" in data.joints:
        changes["joints"]["tau"] = data.joints["tau"] + _torque_noise(data.joints["tau"], sensors, random)
    if data.position is not None:
        position = data.position + random.normal(0.0, sensors.position_m, data.position.shape)
        wrong = random.random(len(data)) < sensors.wrong_rows
        size = _OUTLIER_SIZE * max(sensors.position_m, 1e-6)
        changes["position"] = position + wrong[:, None] * random.normal(0.0, size, position.shape)
    if data.gyro is not None:
        changes["gyro"] = data.gyro + random.normal(0.0, sensors.gyro_rad_s, data.gyro.shape)
    return replace(data, **changes)


def _torque_noise(torque: np.ndarray, sensors: Sensors, random: np.random.Generator) -> np.ndarray:
    share = sensors.torque_share * np.sqrt(np.mean(torque**2, axis=0))
    sigma = share if sensors.torque_Nm is None else np.full(torque.shape[1], sensors.torque_Nm)
    return random.normal(0.0, 1.0, torque.shape) * sigma


def temperature(time: np.ndarray, sensors: Sensors) -> dict[str, np.ndarray]:
    """The covariate of a warm-up over the whole measurement, or none."""
    if sensors.temperature_degC is None:
        return {}
    first, last = sensors.temperature_degC
    rise = 1.0 - np.exp(-(time - time[0]) / (_WARM_UP_SHARE * max(np.ptp(time), 1e-9)))
    return {"temperature_degC": first + (last - first) * rise / rise[-1]}
