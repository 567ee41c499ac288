"""Motion of a true arm with hidden causes: joint angles and torques of an excitation, computed from the link
back to the motor.

    q(t) -> link torque (recursive Newton-Euler) -> phi = q - offset + deflection -> theta = ratio phi
    tau  =  T' link torque + rotor ratio d2 theta/dt2 + friction(d theta/dt) + causes        output side,
         convention of docs/method.md
    T: turn of every output by every motor over the nominal ratio (virtual work); hidden gears change it, and
        declared
    tables where a `direction` says which of them holds: theta / ratio = phi + error(phi),
    link torque / (1 + d error / d phi)

Newton-Euler as in Luh, Walker and Paul 1980: velocities and accelerations outwards, with the base accelerated
by -g, forces and moments inwards, all in the base frame.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from blind.arm import Arm, posture, spring_deflection

SMOOTH_RAD_S = 5e-3  # friction turns over in this rate


@dataclass(frozen=True)
class Drive:
    """Fine grid of one record: time (N,), run (N,), joint angles with rates and accelerations (N, n),
    temperature (N,).

    direction (N, n), -1 to 1: which of its tables each gear follows; None: the gears have none.
    """

    time: np.ndarray
    run: np.ndarray
    q: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    temperature: np.ndarray
    direction: np.ndarray | None = None

    def part(self, rows: np.ndarray) -> Drive:
        """The samples of an index array."""
        return Drive(*(None if (value := getattr(self, item.name)) is None else value[rows]
                       for item in fields(self)))


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
        moment[i] = np.einsum("nij,nj->ni", inertia,
                              alpha) + np.cross(omega, spin) + np.cross(to_centre, force[i])
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
    phi = drive.q - arm.offset
    # What the motor's angle over its ratio has ahead of the output; its rates by differences, run by run.
    bent = spring_deflection(arm, link)
    error, gain = _table_error(arm, phi + bent, drive.direction)
    ahead = bent + error - sum(cause.gear(arm, drive, phi) for cause in causes)
    rate, acceleration = drive.rate + slope(ahead,
                                            drive), drive.acceleration + slope(slope(ahead, drive), drive)
    carried = link / (1.0 + gain) + sum(cause.carried(arm, drive, phi, link) for cause in causes)
    rotor = ratio**2 * arm.rotor * acceleration
    friction = arm.coulomb * np.tanh(rate / SMOOTH_RAD_S) + arm.viscous * rate
    state = Played((phi + ahead) * ratio, carried + rotor + friction, link)
    tau = state.tau + sum(cause.torque(arm, drive, state) for cause in causes)
    for cause in causes:
        tau = cause.record(tau, drive)
    return replace(state, tau=tau)


def _table_error(arm: Arm, phi: np.ndarray,
                 direction: np.ndarray | None) -> tuple[np.ndarray | float, np.ndarray | float]:
    """(N, n) error of the declared gears at the output angle phi, and its slope; of both tables by their
    share."""
    if direction is None:
        return 0.0, 0.0
    error, gain = np.zeros_like(phi), np.zeros_like(phi)
    for i, tables in enumerate(arm.tables):
        for side, name, other in ((-1.0, "cw", "ccw"), (1.0, "ccw", "cw")) if tables else ():
            table, share = tables.get(name, tables.get(other)), 0.5 * (1.0 + side * direction[:, i])
            angle = phi[:, i : i + 1] * table.order
            error[:, i] += share * table.error(phi[:, i])
            gain[:, i] += share * (np.cos(angle) @ table.a - np.sin(angle) @ table.b)
    return error, gain


def slope(values: np.ndarray, drive: Drive) -> np.ndarray:
    """d/dt of (N, ...) run by run, central differences."""
    if np.ndim(values) == 0:
        return 0.0
    out = np.zeros_like(values)
    for number in np.unique(drive.run):
        rows = np.flatnonzero(drive.run == number)
        out[rows] = np.gradient(values[rows], drive.time[rows], axis=0, edge_order=2)
    return out


def excitation(arm: Arm, middle: np.ndarray, seconds: float, step: float, runs: int, random) -> Drive:
    """Runs of one sort: Fourier series of a base frequency, one sinusoid an axis, or moves from point to
    point."""
    shape = (_series, _sinusoids, _moves)[random.choice(3, p=(0.5, 0.25, 0.25))]
    half = random.uniform(0.4, 0.8, arm.axes) * 0.5 * np.minimum(arm.upper - arm.lower, 4.0)
    time = np.arange(0.0, seconds, step)
    parts = []
    for run in range(runs):
        angle, rate, acceleration = shape(time, half, random)
        temperature = 25.0 + 10.0 * (1.0 - np.exp(-(time + run * seconds) / 60.0))
        parts.append((middle + angle, rate, acceleration, np.full(len(time), run + 1), temperature))
    q, rate, acceleration, run, temperature = (np.concatenate(values) for values in zip(*parts))
    return Drive(np.tile(time, runs), run, q, rate, acceleration, temperature)


def _series(time, half, random):
    """Five harmonics of the base frequency of the run on every axis."""
    orders = np.arange(1, 6)[:, None]
    cosine, sine = random.normal(size=(2, 5, len(half))) / orders
    span = np.abs(cosine).sum(axis=0) + np.abs(sine).sum(axis=0)
    cosine, sine = cosine * half / span, sine * half / span
    w = 2.0 * np.pi / (time[-1] + time[1]) * orders
    angle = w[:, 0] * time[:, None]
    return (np.cos(angle) @ cosine + np.sin(angle) @ sine,
            -np.sin(angle) @ (cosine * w) + np.cos(angle) @ (sine * w),
            -np.cos(angle) @ (cosine * w**2) - np.sin(angle) @ (sine * w**2))


def _sinusoids(time, half, random):
    w = 2.0 * np.pi * random.uniform(0.15, 0.6, len(half))
    x = w * time[:, None] + random.uniform(0.0, 6.28, len(half))
    return half * np.sin(x), half * w * np.cos(x), -half * w**2 * np.sin(x)


def _moves(time, half, random):
    """All axes together from one drawn point to the next, sin^2 profiles of the acceleration's integral,
    short rests."""
    angle, rate, acceleration = np.zeros((3, len(time), len(half)))
    start, at = random.uniform(-half, half), 0.0
    while at < time[-1] + 1.0:
        end, takes = random.uniform(-half, half), random.uniform(1.2, 2.5)
        s = np.clip((time - at) / takes, 0.0, 1.0)[:, None]
        x = 2.0 * np.pi * s
        inside = ((time >= at) & (time < at + takes + 0.2))[:, None]
        way = end - start
        angle = np.where(inside, start + way * (s - np.sin(x) / (2.0 * np.pi)), angle)
        rate = np.where(inside, way / takes * (1.0 - np.cos(x)), rate)
        acceleration = np.where(inside, way * 2.0 * np.pi / takes**2 * np.sin(x), acceleration)
        start, at = end, at + takes + 0.2
    return angle, rate, acceleration
