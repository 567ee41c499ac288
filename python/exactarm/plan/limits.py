"""Limits along a motion: which axis, when, by how much; and the duration from which on a path fits.

Rates of the motors fall with the duration, accelerations with its square, so the shortest duration follows
from the flat motion theta = Xi(q_d + kappa^{-1}(torque)) of the path at a trial duration in a few passes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.robot.robot import Robot

FITS = 1.0 + 1e-6
_PASSES = 12


@dataclass(frozen=True)
class Violation:
    """One limit of one joint (from 1) that is exceeded: largest value, limit, and the time of the largest
    value."""

    joint: int
    quantity: str
    unit: str
    value: float
    limit: float
    time: float

    def __str__(self) -> str:
        degrees = self.unit.startswith("rad")
        factor = np.degrees(1.0) if degrees else 1.0
        unit = self.unit.replace("rad", "deg")
        return (f"joint {self.joint} needs {factor * abs(self.value):.4g} {unit} of {self.quantity} at "
                f"{self.time:.3f} s, "
                f"{factor * (abs(self.value) - self.limit):.3g} {unit} beyond its limit of "
                f"{factor * self.limit:.4g} {unit}")


def violations(robot: Robot, time: np.ndarray, theta_dot: np.ndarray, theta_ddot: np.ndarray,
               torque: np.ndarray | None = None) -> tuple[Violation, ...]:
    """Limits that a motor motion (N, n) exceeds, on the output side (E10); torque (N, n) of the drives where
    known."""
    checks = [("rate", "rad/s", theta_dot / robot.ratios, "q_dot_max"),
              ("acceleration", "rad/s²", theta_ddot / robot.ratios, "q_ddot_max")]
    if torque is not None:
        checks.append(("drive torque", "Nm", torque, "torque_max"))
    found = []
    for quantity, unit, values, field in checks:
        for i, joint in enumerate(robot.joints):
            limit, row = getattr(joint, field), int(np.argmax(np.abs(values[:, i])))
            if limit is not None and abs(values[row, i]) > limit * FITS:
                found.append(Violation(i + 1, quantity, unit, float(values[row, i]), limit, float(time[row])))
    return tuple(found)


def stretch_that_fits(robot: Robot, theta_dot: np.ndarray, theta_ddot: np.ndarray) -> float:
    """Factor on the duration at which rates and accelerations would meet the limits; below 1 there is
    room."""
    factor = 0.0
    for values, field, power in ((theta_dot, "q_dot_max", 1.0), (theta_ddot, "q_ddot_max", 0.5)):
        for i, joint in enumerate(robot.joints):
            limit = getattr(joint, field)
            if limit is not None:
                factor = max(factor, float(np.abs(values[:, i] / robot.ratios[i]).max() / limit) ** power)
    return factor


def shortest_duration(robot: Robot, duration: float, flat_motion) -> float:
    """Shortest duration that fits; flat_motion(duration) -> (theta_dot, theta_ddot) of the path at that
    duration."""
    fitting = None
    for _ in range(_PASSES):
        factor = stretch_that_fits(robot, *flat_motion(duration))
        if factor <= FITS:
            fitting = duration if fitting is None else min(fitting, duration)
            if factor > 0.999:
                break
        duration *= max(factor, 0.5) * (1.0 if factor > FITS else 1.0005)
    return duration if fitting is None else fitting
