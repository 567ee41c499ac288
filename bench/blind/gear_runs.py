"""Gear runs of a true arm with hidden causes: motor angles beside a gyroscope behind the gear, or link
encoders.

    theta(t) --gear of the run's direction--> phi --own cause--> --gravity on springs--> q(t)
    gyroscope on the link behind axis j:  R_tilt' S' sum_{k <= j} z_k dq_k/dt        S: nominal axes, z along
                                          axis j
    link encoders:                        q of the axes that have one, each run with an offset of its own

Everything is computed `OVERSAMPLING` times as finely as it is recorded; rates are fourth-order differences
there. Quasi-static: the arm does not swing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from blind.arm import Arm, gravity_torque, output_angle, posture, rotation_about, spring_deflection

OVERSAMPLING = 4
LOADED_PASSES = 4  # the load bends the arm, and the bent arm has another load


@dataclass(frozen=True)
class Runs:
    """Commands on the fine grid: time (N,), theta (N, n), direction (N, n) of each run, run (N,), moved axis
    (N,) from 0.

    logged (N,): which of it was recorded, where a run is cut; None: all of it.
    """

    time: np.ndarray
    theta: np.ndarray
    direction: np.ndarray
    run: np.ndarray
    moved: np.ndarray
    temperature: np.ndarray
    encoder_axes: tuple[int, ...] = ()
    logged: np.ndarray | None = None

    @property
    def step(self) -> float:
        return float(self.time[1] - self.time[0])


@dataclass(frozen=True)
class GearState:
    """What a cause may follow, on the fine grid; joints (N, n); force (N, 3): gravity's reaction in the
    sensor's axes, g."""

    arm: Arm
    runs: Runs
    theta: np.ndarray
    phi: np.ndarray
    rate: np.ndarray
    torque: np.ndarray
    force: np.ndarray | None = None


def slope(values: np.ndarray, runs: Runs) -> np.ndarray:
    """d/dt run by run: (-f(+2) + 8 f(+1) - 8 f(-1) + f(-2)) / 12 h inside, second order at the ends."""
    out = np.empty_like(values)
    for number in np.unique(runs.run):
        rows = np.flatnonzero(runs.run == number)
        f = values[rows]
        d = np.gradient(f, runs.step, axis=0, edge_order=2)
        d[2:-2] = (8.0 * (f[3:-1] - f[1:-3]) - (f[4:] - f[:-4])) / (12.0 * runs.step)
        out[rows] = d
    return out


@dataclass(frozen=True)
class Reading:
    """Recorded samples (every OVERSAMPLING-th): sensor (M, 3) rad/s or (M, E) rad; state on the fine grid."""

    sensor: np.ndarray
    state: GearState
    picked: np.ndarray


def sense(arm: Arm, runs: Runs, causes, tilt: np.ndarray) -> Reading:
    """What the sensors say, without noise."""
    theta = runs.theta
    state = GearState(arm, runs, theta, theta / arm.motor_per_output,
                      slope(theta, runs) / arm.motor_per_output, 0.0 * theta)
    for cause in causes:
        theta = theta + cause.motor(state)
    phi = output_angle(arm, theta, runs.direction)
    q, torque = phi + arm.offset, np.zeros_like(phi)
    for _ in range(LOADED_PASSES if arm.mass is not None else 0):
        torque = gravity_torque(arm, posture(arm, q))
        q = phi + arm.offset - spring_deflection(arm, torque)
    state = GearState(arm, runs, theta, phi, state.rate, torque)
    phi = phi + sum(cause.gear(state) for cause in causes)
    q = phi + arm.offset - spring_deflection(arm, torque) + sum(cause.spring(state) for cause in causes)
    picked = _picked(runs)
    if runs.encoder_axes:
        return Reading(q[np.ix_(picked, runs.encoder_axes)], state, picked)
    rates = slope(q, runs)[picked]
    reading, force = _gyroscope(arm, runs, q[picked], rates, picked)
    at_samples = GearState(arm, _only(runs, picked), theta[picked], phi[picked], state.rate[picked],
                           torque[picked], force)
    for cause in causes:
        reading = reading + cause.device(reading, at_samples)
    return Reading(reading @ tilt, state, picked)


def _picked(runs: Runs) -> np.ndarray:
    rows = [np.flatnonzero(runs.run == number)[::OVERSAMPLING] for number in np.unique(runs.run)]
    picked = np.concatenate(rows)
    return picked if runs.logged is None else picked[runs.logged[picked]]


def _only(runs: Runs, picked: np.ndarray) -> Runs:
    return Runs(runs.time[picked], runs.theta[picked], runs.direction[picked], runs.run[picked],
                runs.moved[picked],
                runs.temperature[picked], runs.encoder_axes)


def _gyroscope(arm: Arm, runs: Runs, q, rates, picked):
    """(M, 3) rates in the sensor's nominal axes, and the specific force in them."""
    at = posture(arm, q)
    reading, force = np.zeros((len(q), 3)), np.zeros((len(q), 3))
    moved = runs.moved[picked]
    for j in np.unique(moved):
        rows = np.flatnonzero(moved == j)
        nominal = at.rotation[rows, j] @ rotation_about(2, arm.sign[j] * q[rows, j] + arm.zero[j])
        if arm.sign[j] < 0:
            nominal = nominal @ np.diag([1.0, -1.0, -1.0])
        omega = np.einsum("nki,nk->ni", at.axis[rows, : j + 1], rates[rows, : j + 1])
        reading[rows] = np.einsum("nij,ni->nj", nominal, omega)
        force[rows] = -np.einsum("nij,i->nj", nominal, arm.gravity) / 9.81
    return reading, force


def ramped(distance: float, speed: float, ramp_s: float, step: float, rest_s: float = 0.1) -> np.ndarray:
    """(N,) path from 0 to `distance`: rest, a ramp with smooth acceleration (sin^2), constant speed, ramp,
    rest."""
    cruise = max(distance / speed - ramp_s, 0.1)
    top = distance / (cruise + ramp_s)
    t = np.arange(0.0, 2.0 * rest_s + 2.0 * ramp_s + cruise, step)
    up = lambda s: np.clip(s / ramp_s, 0.0,
                           1.0) - np.sin(2.0 * np.pi * np.clip(s / ramp_s, 0.0, 1.0)) / (2.0 * np.pi)
    rate = top * (up(t - rest_s) - up(t - rest_s - ramp_s - cruise))
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1])) * step])


def to_and_fro(half: float, duration: float, step: float, random) -> np.ndarray:
    """(N,) a smooth wander of three waves that starts and ends at rest at 0."""
    t = np.arange(0.0, duration, step)
    window = np.clip(np.minimum(t, duration - t) / 0.5, 0.0, 1.0)
    window = window * window * (3.0 - 2.0 * window)
    waves = sum(a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in
                zip((0.6, 0.3, 0.1), random.uniform((0.1, 0.2, 0.4), (0.2, 0.4, 0.8)),
                    random.uniform(0, 6.28, 3)))
    return half * window * waves
