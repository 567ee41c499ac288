"""The links behind their springs while the motors follow a given motion: what stiff motor control leaves to
chance.

    D(q) q_ddot + C q_dot + g = kappa(phi(t) + q_offset - q),   phi(t) the outputs of the gears        (2.23),
    E4

A stiff oscillator: the wrist swings at hundreds of hertz, the base at ten. It is undamped as the source's
model is;
`damping_s` adds damping_s kappa'(0) (phi_dot - q_dot), as real gears have it (1e-3 s: 3 % of critical at 10
Hz). Integrated by Radau IIA of order 5 (Hairer and Wanner 1996) at a fixed step, in the form of inverse
dynamics: with stage accelerations a_i,

    v_i = v_0 + h sum_j A_ij a_j,  q_i = q_0 + h sum_j A_ij v_j,  ID(q_i, v_i, a_i) = kappa(output_i - q_i)

and Newton's matrix D + h A C + h^2 A^2 (K + dID/dq) from the core's slopes. Between samples the output is a
quintic spline. It starts at rest relative to the motors, in the equilibrium of gravity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # scipy.interpolate is imported at its first use
from scipy import linalg

from exactarm import _core
from exactarm.chain.spring import declared_deflection
from exactarm.errors import ComputationError, InputError
from exactarm.robot.robot import Robot

_LONGEST_STEP_S = 1e-3
_TOLERANCE = 1e-9  # of the largest torque so far
_MOST_ITERATIONS = 12
_SLOW = 4  # iterations after which the slopes are taken anew
_EQUILIBRIUM_PASSES = 40

_R = np.sqrt(6.0)
_NODES = np.array([(4.0 - _R) / 10.0, (4.0 + _R) / 10.0, 1.0])
_A = np.array([
    [(88.0 - 7.0 * _R) / 360.0, (296.0 - 169.0 * _R) / 1800.0, (-2.0 + 3.0 * _R) / 225.0],
    [(296.0 + 169.0 * _R) / 1800.0, (88.0 + 7.0 * _R) / 360.0, (-2.0 - 3.0 * _R) / 225.0],
    [(16.0 - _R) / 36.0, (16.0 + _R) / 36.0, 1.0 / 9.0],
])


@dataclass(frozen=True)
class LinkMotion:
    """q, q_dot, q_ddot, torque of the springs, each (N, n)."""

    q: np.ndarray
    q_dot: np.ndarray
    q_ddot: np.ndarray
    torque: np.ndarray


def is_elastic(robot: Robot) -> bool:
    """Whether every axis has a declared spring and every link a declared mass."""
    return robot.links is not None and all(joint.spring_linear for joint in robot.joints)


def swing(robot: Robot, time: np.ndarray, output: np.ndarray, damping_s: float = 0.0) -> LinkMotion:
    """The links' motion at `time` (N,), the gears' outputs plus offsets being `output` (N, n) rad."""
    if not is_elastic(robot):
        raise InputError(f"robot {robot.name}: expected a spring on every axis and link masses",
                         file=robot.file)
    path = scipy.interpolate.make_interp_spline(time, output, k=5)
    speed = path.derivative()
    springs = _Springs(robot, damping_s)
    start = _equilibrium(robot, output[0])
    q, v = np.empty_like(output), np.empty_like(output)
    q[0], v[0] = start, path(time[0], 1)
    stepper = _Stepper(robot, springs)
    for k in range(len(time) - 1):
        parts = max(1, int(np.ceil((time[k + 1] - time[k]) / _LONGEST_STEP_S - 1e-6)))
        edges = np.linspace(time[k], time[k + 1], parts + 1)
        q_now, v_now = q[k], v[k]
        for t, after in zip(edges[:-1], edges[1:]):
            nodes = t + (after - t) * _NODES
            q_now, v_now = stepper.step(t, after - t, q_now, v_now, path(nodes), speed(nodes))
        q[k + 1], v[k + 1] = q_now, v_now
    torque = springs.torque(output - q, speed(time) - v)[0]
    bias = _core.inverse_dynamics(robot.core, q, v, np.zeros_like(q))
    acceleration = np.linalg.solve(_core.mass_matrix(robot.core, q), (torque - bias)[:, :, None])[:, :, 0]
    return LinkMotion(q, v, acceleration, torque)


class _Springs:
    def __init__(self, robot: Robot, damping_s: float):
        self.linear = np.array([joint.spring_linear for joint in robot.joints])
        self.cubic = np.array([joint.spring_cubic for joint in robot.joints])
        self.damping = damping_s * self.linear

    def torque(self, stretch: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Torque (N, n) of springs and their damping, and the stiffness."""
        square = self.cubic * stretch**2
        return (self.linear + square) * stretch + self.damping * rate, self.linear + 3.0 * square


class _Stepper:
    """One step after another; keeps Newton's matrix as long as it converges quickly."""

    def __init__(self, robot: Robot, springs: _Springs):
        self.core, self.springs, self.n = robot.core, springs, robot.axes
        self.factor, self.factor_step = None, 0.0
        self.acceleration = np.zeros((3, robot.axes))
        self.largest = 1.0

    def step(self, t: float, h: float, q: np.ndarray, v: np.ndarray, output: np.ndarray, speed: np.ndarray):
        """q, v (n,) after a step from them; `output` and its rate `speed` (3, n) at the nodes."""
        if self.factor is None or abs(h - self.factor_step) > 1e-9 * h:
            self._factorise(q, v, output[0], h)
        a = self.acceleration.copy()
        for iteration in range(_MOST_ITERATIONS):
            v_nodes = v + h * (_A @ a)
            q_nodes = q + h * (_A @ v_nodes)
            torque, _ = self.springs.torque(output - q_nodes, speed - v_nodes)
            residual = _core.inverse_dynamics(self.core, q_nodes, v_nodes, a) - torque
            self.largest = max(self.largest, float(np.max(np.abs(torque))))
            if np.max(np.abs(residual)) < _TOLERANCE * self.largest:
                break
            if iteration and iteration % _SLOW == 0:
                self._factorise(q_nodes[2], v_nodes[2], output[2], h)
            # LAPACK itself: the checks of `linalg.lu_solve` take longer than 18 unknowns do
            a = a - linalg.lapack.dgetrs(*self.factor, residual.ravel())[0].reshape(3, self.n)
        else:
            raise ComputationError(f"the simulation of the springs does not converge at {t:.4g} s")
        self.acceleration = a
        return q_nodes[2], v_nodes[2]

    def _factorise(self, q: np.ndarray, v: np.ndarray, output: np.ndarray, h: float) -> None:
        slopes = _core.inverse_dynamics_derivatives(self.core, q[None], v[None], self.acceleration[2:3])
        stiffness = np.diag(self.springs.torque(output - q, 0.0 * v)[1])
        damping = slopes["dtau_dq_dot"][0] + np.diag(self.springs.damping)
        matrix = np.kron(np.eye(3), slopes["mass_matrix"][0]) + np.kron(h * _A, damping)
        matrix += np.kron(h * h * _A @ _A, slopes["dtau_dq"][0] + stiffness)
        self.factor, self.factor_step = linalg.lu_factor(matrix), h


def _equilibrium(robot: Robot, output: np.ndarray) -> np.ndarray:
    """q at which the springs carry gravity."""
    q = output.copy()
    for _ in range(_EQUILIBRIUM_PASSES):
        q = output + declared_deflection(robot, _core.gravity_torque(robot.core, q[None]))[0][0]
    return q
