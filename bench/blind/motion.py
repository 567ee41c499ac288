"""Motion of a true arm with hidden causes: joint angles and torques of an excitation, computed from the link back to the motor.

    q(t) -> link torque (recursive Newton-Euler) -> phi = q - offset + deflection -> theta = ratio phi
    tau  =  link torque + rotor ratio^2 ddq + friction(d theta/dt) + causes        output side, convention of docs/method.md

Newton-Euler as in Luh, Walker and Paul 1980: velocities and accelerations outwards, with the base accelerated by -g,
forces and moments inwards, all in the base frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from blind.arm import Arm, posture, spring_deflection

SMOOTH_RAD_S = 5e-3  # friction turns over in this rate


@dataclass(frozen=True)
class Drive:
    """Fine grid of one record: time (N,), run (N,), joint angles with rates and accelerations (N, n), temperature (N,)."""

    time: np.ndarray
    run: np.ndarray
    q: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    temperature: np.ndarray


def inverse_dynamics(arm: Arm, q: np.ndarray, rate: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """(N, n) torque of the links alone."""
    at, rows, n = posture(arm, q), len(q), arm.axes
    omega, alpha = np.zeros((rows, 3)), np.zeros((rows, 3))
    linear = np.tile(-arm.gravity, (rows, 1))
    force, moment = np.zeros((n, rows, 3)), np.zeros((n, rows, 3))
    for i in range(n):
        z = at.axis[:, i]
        alpha = alpha + z * acceleration[:, i : i + 1] + np.cross(omega, z) * rate[:, i : i + 1]
        omega = omega + z * rate[:, i : i + 1]
        arms = at.origin[:, i + 1] - at.origin[:, i]
        to_centre = at.centre[:, i] - at.origin[:, i]
        at_centre = linear + np.cross(alpha, to_centre) + np.cross(omega, np.cross(omega, to_centre))
        inertia = at.rotation[:, i + 1] @ arm.inertia[i] @ np.swapaxes(at.rotation[:, i + 1], 1, 2)
        spin = np.einsum("nij,nj->ni", inertia, omega)
        force[i] = arm.mass[i] * at_centre
        moment[i] = np.einsum("nij,nj->ni", inertia, alpha) + np.cross(omega, spin) + np.cross(to_centre, force[i])
        linear = linear + np.cross(alpha, arms) + np.cross(omega, np.cross(omega, arms))
    torque = np.zeros_like(q)
    carried_force, carried_moment = np.zeros((rows, 3)), np.zeros((rows, 3))
    for i in reversed(range(n)):
        arms = at.origin[:, i + 1] - at.origin[:, i]
        carried_moment = moment[i] + carried_moment + np.cross(arms, carried_force)
        carried_force = force[i] + carried_force
        torque[:, i] = np.einsum("ni,ni->n", at.axis[:, i], carried_moment)
    return torque


@dataclass(frozen=True)
class Played:
    """What the controller records: theta (N, n) rad and tau (N, n) Nm, output side, without noise."""

    theta: np.ndarray
    tau: np.ndarray
    link: np.ndarray


def play(arm: Arm, drive: Drive, causes) -> Played:
    loaded = arm
    for cause in causes:
        loaded = cause.links(loaded)
    link = inverse_dynamics(loaded, drive.q, drive.rate, drive.acceleration)
    ratio = arm.motor_per_output
    rotor = ratio**2 * arm.rotor * drive.acceleration
    friction = arm.coulomb * np.tanh(drive.rate / SMOOTH_RAD_S) + arm.viscous * drive.rate
    theta = (drive.q - arm.offset + spring_deflection(arm, link)) * ratio
    state = Played(theta, link + rotor + friction, link)
    tau = state.tau + sum(cause.torque(arm, drive, state) for cause in causes)
    theta = theta + sum(cause.motor(arm, drive, state) for cause in causes)
    for cause in causes:
        tau = cause.record(tau, drive)
    return replace(state, theta=theta, tau=tau)


def excitation(arm: Arm, middle: np.ndarray, seconds: float, step: float, runs: int, random) -> Drive:
    """Sums of five harmonics of a base frequency on every axis, to and fro within the limits; each run its own."""
    parts = []
    time = np.arange(0.0, seconds, step)
    base = 2.0 * np.pi / seconds
    for run in range(runs):
        orders = np.arange(1, 6)[:, None]
        cosine, sine = random.normal(size=(2, 5, arm.axes)) / orders
        span = np.abs(cosine).sum(axis=0) + np.abs(sine).sum(axis=0)
        half = random.uniform(0.4, 0.8, arm.axes) * 0.5 * np.minimum(arm.upper - arm.lower, 4.0)
        cosine, sine = cosine * half / span, sine * half / span
        angle = base * orders[:, 0] * time[:, None]
        w = base * orders
        parts.append((
            middle + np.cos(angle) @ cosine + np.sin(angle) @ sine,
            -np.sin(angle) @ (cosine * w) + np.cos(angle) @ (sine * w),
            -np.cos(angle) @ (cosine * w**2) - np.sin(angle) @ (sine * w**2),
            np.full(len(time), run + 1), 25.0 + 10.0 * (1.0 - np.exp(-(time + run * seconds) / 60.0)),
        ))
    q, rate, acceleration, run, temperature = (np.concatenate(values) for values in zip(*parts))
    return Drive(np.tile(time, runs), run, q, rate, acceleration, temperature)
