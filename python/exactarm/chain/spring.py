"""The declared joint springs: deflection under a torque, tau = linear e + cubic e^3 (thesis (2.18))."""

import numpy as np

from exactarm.robot.robot import Robot


def declared_deflection(robot: Robot, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Change of q under the torque (N, n) of the springs, -kappa^{-1}(torque), and its slope by that."""
    linear = np.array([joint.spring_linear or np.inf for joint in robot.joints])
    value, slope = -torque / linear, np.repeat([-1.0 / linear], len(torque), axis=0)
    cubic = np.array([joint.spring_cubic if joint.spring_linear else 0.0 for joint in robot.joints])
    if (curved := cubic != 0.0).any():
        stretch, by_torque = _curved_inverse(linear[curved], cubic[curved], torque[:, curved])
        value[:, curved], slope[:, curved] = -stretch, -by_torque
    return value, slope


def spring_inverse(linear: float, cubic: float, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """e with linear e + cubic e^3 = torque of a monotone spring, and de/dtorque."""
    if cubic == 0.0:
        return torque / linear, np.full_like(torque, 1.0 / linear)
    return _curved_inverse(linear, cubic, torque)


def _curved_inverse(linear, cubic, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same of one or more springs with a cubic term, by Cardano in its hyperbolic form."""
    scale = np.sqrt(4.0 * linear / (3.0 * cubic))
    stretch = scale * np.sinh(np.arcsinh(torque / (0.25 * cubic * scale**3)) / 3.0)
    return stretch, 1.0 / (linear + 3.0 * cubic * stretch**2)
