"""Gyroscope alignment: the constant tilt of the sensor against the moving axis (thesis (3.3)).

R_x(alpha) R_y(beta) omega_sensor = F omega_nominal, so that the reading is R_y(-beta) R_x(-alpha) F
omega_nominal. F turns the sensor upside down (half a turn about x) where its z axis points against the moving
axis. Part of the declared model: re-identified, one pair of angles for each set-up and moving axis.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import GEAR_RUN
from exactarm.effects.base import Change, Effect, Parameter, Station
from exactarm.robot.mdh_frames import rotation_x, rotation_y, rotation_z

_UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class GyroAlignment(Effect):
    """alpha, beta of one session while axis `joint` moves."""

    session: int = 1
    flipped: bool = False

    name = "gyro_alignment"
    station = Station.DEVICE
    kinds = (GEAR_RUN.name,)
    declared = True
    sentence = "the gyroscope is tilted by {alpha_rad:.4g} and {beta_rad:.4g} rad against axis {joint}"
    source = "thesis (3.3)"
    parameter_table = (Parameter("alpha_rad", 0.02), Parameter("beta_rad", 0.02))

    def parameter_label(self, parameter: Parameter) -> str:
        return f"session_{self.session}.{self.label}.{parameter.name}"

    @property
    def axis_in_sensor(self) -> np.ndarray:
        """(3,) the moving axis, in the sense in which its angle rises, in the sensor's axes."""
        return tilt(*self.values).T[:, 2] * (-1.0 if self.flipped else 1.0)

    def change(self, view) -> Change:
        alpha, beta = self.values
        nominal = _UPSIDE_DOWN if self.flipped else np.eye(3)
        turn = tilt(alpha, beta).T @ nominal
        by_alpha = (rotation_y(beta).T @ slope_x(alpha).T) @ nominal
        by_beta = (slope_y(beta).T @ rotation_x(alpha).T) @ nominal
        here = (view.sensor_axis == self.index) & (view.data.session == self.session)
        rate = view.measured * here[:, None]
        value = rate @ (turn - np.eye(3)).T
        derivative = np.stack([rate @ by_alpha.T, rate @ by_beta.T], axis=2)
        by_measured = here[:, None, None] * (turn - np.eye(3))
        return Change((0, 1, 2), value, derivative, {"measured": by_measured})


def slope_x(angle: float) -> np.ndarray:
    """d rotation_x / d angle."""
    return rotation_x(angle + 0.5 * np.pi) - np.diag([1.0, 0.0, 0.0])


def slope_y(angle: float) -> np.ndarray:
    """d rotation_y / d angle."""
    return rotation_y(angle + 0.5 * np.pi) - np.diag([0.0, 1.0, 0.0])


def slope_z(angle: float) -> np.ndarray:
    """d rotation_z / d angle."""
    return rotation_z(angle + 0.5 * np.pi) - np.diag([0.0, 0.0, 1.0])


def tilt(alpha: float, beta: float) -> np.ndarray:
    """R_x(alpha) R_y(beta): from the sensor's axes to the moving axis'."""
    return rotation_x(alpha) @ rotation_y(beta)


def aligning_angles(axis: np.ndarray) -> tuple[float, float]:
    """alpha, beta of (3.3) in closed form: turns that bring the sensor's direction `axis` (3,) onto z."""
    x, y, z = axis / np.linalg.norm(axis)
    beta = np.arctan2(-x, z)
    return float(np.arctan2(y, np.hypot(x, z))), float(beta)
