"""Motor-link coupling: a fast rotor that is carried by moving links is a gyroscope.

The rotor of motor i, on link i - 1, spins about joint axis z_i with J_i theta_dot_i. Its change of angular
momentum loads the links that carry it, and their angular acceleration its motor (thesis (2.22): U(q), C_1,
C_2):

    joint j < i:  z_j . (J_i theta_ddot_i z_i + J_i theta_dot_i omega_{i-1} x z_i)
    motor i:      ratio_i J_i z_i . omega_dot_{i-1}     (output side)

`share` times that: 1 for rotors that turn about the joint's own axis and sense. Rotor inertias are the
tables'.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from exactarm.data.kinds import MOTION
from exactarm.effects.base import Change, Effect, Parameter, Station


@dataclass(frozen=True)
class MotorLinkCoupling(Effect):
    name = "motor_link_coupling"
    station = Station.DRIVE
    kinds = (MOTION.name,)
    per_joint = False
    sentence = "the spinning rotors load the links that carry them, {share:.3g} of the full coupling"
    source = "thesis (2.22); Tomei 1991; De Luca and Book 2016"
    parameter_table = (Parameter("share", 1.0, -2.0, 2.0),)

    def change(self, view) -> Change:
        column = coupling_torque(view)
        return Change(tuple(range(view.axes)), self.values[0] * column, column[:, :, None])

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        return (cls(None, (0.0,)),) if any(joint.rotor_inertia for joint in robot.joints) else ()


def coupling_torque(view) -> np.ndarray:
    """(N, n) full coupling in Nm, output side."""
    robot, n = view.robot, view.axes
    _, rotations = view.frames()
    axes = [robot.joints[k].sign * rotations[:, k, :, 2] for k in range(n)]
    inertia = np.array([joint.rotor_inertia or 0.0 for joint in robot.joints])
    momentum = inertia * view.signals["theta_dot"]
    change = inertia * view.signals["theta_ddot"]
    omega, omega_dot = np.zeros((view.rows, 3)), np.zeros((view.rows, 3))
    torque = np.zeros((view.rows, n))
    dot = lambda a, b: np.sum(a * b, axis=1)
    for i in range(n):
        torque[:, i] += robot.controller_ratios[i] * inertia[i] * dot(axes[i], omega_dot)
        load = change[:, [i]] * axes[i] + momentum[:, [i]] * np.cross(omega, axes[i])
        for j in range(i):
            if robot.joints[j].type == "revolute":
                torque[:, j] += dot(axes[j], load)
        if robot.joints[i].type == "revolute":
            rate = view.signals["q_dot"][:, [i]]
            omega_dot = omega_dot + view.signals["q_ddot"][:, [i]] * axes[i] + rate * np.cross(omega, axes[i])
            omega = omega + rate * axes[i]
    return torque
