"""The declared joint springs: deflection under a torque, tau = linear e + cubic e^3 (thesis (2.18))."""

from __future__ import annotations

import numpy as np

from exactarm.robot import Robot


def declared_deflection(robot: Robot, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Change of q under the torque (N, n) that the springs carry, -kappa^{-1}(torque), and its slope by the
    torque."""
    linear = np.array([joint.spring_linear or np.inf for joint in robot.joints])
    value, slope = -torque / linear, np.repeat([-1.0 / linear], len(torque), axis=0)
    for i, joint in enumerate(robot.joints):
        if joint.spring_linear and joint.spring_cubic:
            stretch, by_torque = spring_inverse(joint.spring_linear, joint.spring_cubic, torque[:, i])
            value[:, i], slope[:, i] = -stretch, -by_torque
    return value, slope


def spring_inverse(linear: float, cubic: float, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """e with linear e + cubic e^3 = torque (Cardano in its hyperbolic form, monotone springs), and
    de/dtorque."""
    if cubic == 0.0:
        return torque / linear, np.full_like(torque, 1.0 / linear)
    scale = np.sqrt(4.0 * linear / (3.0 * cubic))
    stretch = scale * np.sinh(np.arcsinh(torque / (0.25 * cubic * scale**3)) / 3.0)
    return stretch, 1.0 / (linear + 3.0 * cubic * stretch**2)
