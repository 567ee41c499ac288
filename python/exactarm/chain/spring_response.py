"""How the springs of a moving arm give way, to first order about the motion that the motors ask for.

With e the stretch of the springs (q = phi + q_offset - e) and tau the torque of the unbent motion,

    kappa(e) + d e_dot = tau - (dtau/dq e + dtau/dq_dot e_dot + D e_ddot)

so that gear errors near a resonance of the arm are answered as the arm does, not as its inertia alone.
Integrated from the equilibria of the first rows of a run (a log that begins in motion has no accelerations
there yet) by Newmark's method in its three-point form (Zienkiewicz 1977), a little damped at the highest
frequencies (gamma = 1/2 + a, beta = (1 + a)^2 / 4); one recursion over a run serves values and tangents.
Damping d = 1e-3 s kappa'(0), as gears have it (3 % of critical at 10 Hz): it decides where a resonance is
crossed and nowhere else. A cubic spring enters by its secant. Axes without a declared spring do not give way.
"""

import numpy as np

from exactarm import _core
from exactarm.chain.spring import declared_deflection
from exactarm.robot.robot import Robot

DAMPING_S = 1e-3
_SECANTS = 3
_LEAST_INERTIA = 1e-6  # of the largest
_ALPHA = 0.05
_GAMMA, _BETA = 0.5 + _ALPHA, 0.25 * (1.0 + _ALPHA) ** 2
_STIFF = (0.5 + _BETA - _GAMMA, 0.5 - 2.0 * _BETA + _GAMMA, _BETA)  # weights of before, now, after
_DAMPED = (_GAMMA - 1.0, 1.0 - 2.0 * _GAMMA, _GAMMA)
_MASSIVE = (1.0, -2.0, 1.0)


class SpringResponse:
    """The system of one motion: slopes (N, n, n) of the unbent torque by q, q_dot, q_ddot; runs of row
    indices; keep (N,): rows away from the ends of their run."""

    def __init__(self, robot: Robot, by_q, by_rate, mass, runs, step: float, keep: np.ndarray):
        self.linear = np.array([joint.spring_linear or 0.0 for joint in robot.joints])
        self.cubic = np.array([joint.spring_cubic for joint in robot.joints])
        self.robot, self.by_q, self.by_rate, self.mass = robot, by_q, by_rate, _positive(mass)
        self.runs, self.step = runs, step
        # Rows of each run from the start on in which the arm does not swing: two, or those that are not kept.
        self.still = [max(2, int(np.argmax(keep[rows]))) for rows in runs]
        self.elastic = self.linear > 0.0
        self.tangent = np.broadcast_to(self.linear, by_q.shape[:2])

    def give_way(self, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """e (N, n) under the torque (N, n) of the unbent motion, and the torque left at the joints."""
        e = -declared_deflection(self.robot, torque)[0]
        for _ in range(_SECANTS if np.any(self.cubic) else 1):
            secant = self.linear + self.cubic * e**2
            e = self._solve(torque[:, :, None], secant)[:, :, 0]
        self.tangent = self.linear + 3.0 * self.cubic * e**2
        return e, self.carried(torque[:, :, None], e[:, :, None], secant)[:, :, 0]

    def give_way_tangent(self, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same for tangents (N, n, P), about the stretch found last."""
        e = self._solve(torque, self.tangent)
        return e, self.carried(torque, e, self.tangent)

    def carried(self, torque: np.ndarray, e: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        """(N, n, P) torque at the joints as the arm gives way by e (N, n, P): the springs', if any."""
        rate, acceleration = rates(e, self.runs, self.step)
        springs = stiffness[:, :, None] * e + (DAMPING_S * self.linear)[:, None] * rate
        if np.all(self.elastic):
            return springs
        rigid = torque - self.by_q @ e - self.by_rate @ rate - self.mass @ acceleration
        return np.where(self.elastic[:, None], springs, rigid)

    def _solve(self, torque: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        axes, h = np.flatnonzero(self.elastic), self.step  # the others stand still
        n = len(axes)
        by_q, by_rate, mass = (each[:, axes[:, None], axes] for each in (self.by_q, self.by_rate, self.mass))
        damping = np.diag(DAMPING_S * self.linear[axes])
        e = np.zeros_like(torque)
        for rows, first in zip(self.runs, self.still):
            still = by_q[rows] + np.eye(n) * stiffness[rows][:, axes, None]
            right = torque[rows][:, axes]
            # The equation about row t gives the unknown of row t + 1.
            blocks = [np.zeros_like(still) for _ in range(3)]
            blocks[2][:first] = still[:first]
            now, swings = slice(first - 1, -1), rows[first - 1 : -1]
            for block, s, d, m in zip(blocks, _STIFF, _DAMPED, _MASSIVE):
                block[first:] = (s * still[now] + d / h * (by_rate[swings] + damping)
                                 + m / h**2 * mass[swings])
            mean = right.copy()
            mean[first:] = (_STIFF[0] * right[first - 2 : -2] + _STIFF[1] * right[now]
                            + _STIFF[2] * right[first:])
            e[rows[:, None], axes] = _core.block_recursion(*blocks, mean)
        return e


def rates(e: np.ndarray, runs, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Three-point differences of (N, ...) in each run; zero at its ends."""
    rate, acceleration = np.zeros_like(e), np.zeros_like(e)
    for rows in runs:
        x = e[rows]
        rate[rows[1:-1]] = (x[2:] - x[:-2]) / (2.0 * step)
        acceleration[rows[1:-1]] = (x[2:] - 2.0 * x[1:-1] + x[:-2]) / step**2
    return rate, acceleration


def _positive(mass: np.ndarray) -> np.ndarray:
    """The mass matrices (N, n, n), made positive where those of a trial are not: it would run away."""
    try:
        np.linalg.cholesky(mass)
        return mass
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(mass)
        values = np.maximum(values, _LEAST_INERTIA * values[:, -1:])
        return (vectors * values[:, None, :]) @ np.swapaxes(vectors, 1, 2)
