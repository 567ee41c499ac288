"""A gear run as a simple simulation makes it, with its own formulas: a test is not judged by the code it
tests.

One axis moves to and fro between its limits on a trapezoidal profile of the motor; the others stand. The link
turns at theta_dot / u(phi); gravity bends the declared spring; a tilted gyroscope adds noise; the motor
encoder counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm.data.dataset import Dataset

DEGREE = np.pi / 180.0


@dataclass(frozen=True)
class GearRuns:
    """What is measured: `speed` of the link in rad/s, `runs` one-way motions, alternately counter- and
    clockwise."""

    joint: int
    speed: float
    runs: int = 2
    rate_hz: float = 1000.0
    noise: float = 0.05 * DEGREE
    tilt: tuple[float, float] = (0.02, -0.01)  # turns about the sensor's x, then y
    counts: int = 2**16  # per motor revolution; 0 = no quantisation
    margin: float = 3.0 * DEGREE
    seed: int = 1
    first_run: int = 1


def profile(distance: float, speed: float, acceleration: float, rate_hz: float, rest_s: float = 0.05):
    """Times and path (N,) of a trapezoidal motion that begins and ends at rest."""
    ramp = min(speed / acceleration, np.sqrt(distance / acceleration))
    top = acceleration * ramp
    cruise = distance / top - ramp
    total = 2.0 * rest_s + 2.0 * ramp + cruise
    time = np.arange(0.0, total, 1.0 / rate_hz)
    t = np.clip(time - rest_s, 0.0, 2.0 * ramp + cruise)
    up = np.minimum(t, ramp)
    flat = np.clip(t - ramp, 0.0, cruise)
    down = np.clip(t - ramp - cruise, 0.0, ramp)
    return time, 0.5 * acceleration * up**2 + top * flat + top * down - 0.5 * acceleration * down**2


def link_angle(theta: np.ndarray, ratio: float, table) -> np.ndarray:
    """phi with ratio (phi + sum (a sin + b (cos - 1)) / w) = theta, by Newton's method."""
    phi = theta / ratio
    if table is None:
        return phi
    for _ in range(60):
        angle = np.multiply.outer(phi, table.order)
        sine, cosine = np.sin(angle), np.cos(angle)
        error = sine @ (table.a / table.order) + (cosine - 1.0) @ (table.b / table.order)
        step = (theta / ratio - error - phi) / (1.0 + cosine @ table.a - sine @ table.b)
        phi = phi + step
        if np.max(np.abs(step)) < 1e-9:  # its square, times the largest slope of the ratio, is rounding
            break
    return phi


def simulate(robot, case: GearRuns, gravity=None, rest=None, extra=None) -> Dataset:
    """Measured data. gravity(q (N, n)) -> torque (N, n) bends the declared springs; rest (n,): where the
    others stand; extra(time, phi, direction) -> angle (N,) that the link turns further than the declared gear
    says."""
    random = np.random.default_rng(case.seed)
    index = case.joint - 1
    joint = robot.joints[index]
    theta_all, gyro_all, time_all, run_all = [], [], [], []
    low, high = joint.q_min + case.margin - joint.q_offset, joint.q_max - case.margin - joint.q_offset
    acceleration = joint.q_ddot_max

    def run(sign: float):
        """Time, motor angle and rate of the link (N,) of one way: all runs that go it are alike."""
        time, path = profile(high - low, case.speed, acceleration, case.rate_hz)
        # Ten times as fine, so that the difference quotient below is as good as exact.
        fine = np.arange(0, 10 * time.size) / (10.0 * case.rate_hz)
        _, fine_path = profile(high - low, case.speed, acceleration, 10.0 * case.rate_hz)
        fine_path = np.append(fine_path,
                              np.full(max(0, fine.size - fine_path.size), fine_path[-1]))[: fine.size]
        start = low if sign > 0 else high
        theta = (start + sign * fine_path) * joint.ratio
        phi = link_angle(theta, joint.ratio, joint.ccw if sign > 0 else joint.cw)
        q_link = phi + joint.q_offset
        if gravity is not None:
            q = np.tile(np.zeros(robot.axes) if rest is None else rest, (fine.size, 1))
            q[:, index] = q_link
            q_link = q_link - gravity(q)[:, index] / joint.spring_linear
        if extra is not None:
            q_link = q_link + extra(fine, phi, sign)
        return time, theta[::10], np.gradient(q_link, fine, edge_order=2)[::10]

    ways = {sign: run(sign) for sign in (1.0, -1.0)[: case.runs]}
    for k in range(case.runs):
        time, motor, rate = ways[1.0 if k % 2 == 0 else -1.0]
        reading = np.zeros((time.size, 3))
        reading[:, 2] = rate
        a, b = case.tilt
        about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
        reading = reading @ (about_x @ about_y)  # R' omega, row by row
        gyro_all.append(reading + random.normal(0.0, case.noise, reading.shape))
        if case.counts:
            step = 2.0 * np.pi / case.counts
            motor = np.round(motor / step) * step
        others = (
            np.zeros((time.size, robot.axes))
            if rest is None else (np.tile(rest, (time.size, 1)) - robot.offsets) * robot.ratios
        )
        others[:, index] = motor
        theta_all.append(others), time_all.append(time), run_all.append(
            np.full(time.size, case.first_run + k)
        )
    joints = {"theta": np.concatenate(theta_all)}
    return Dataset.of_arrays(
        "gear_run", joints, time=np.concatenate(time_all), run=np.concatenate(run_all),
        gyro=np.concatenate(gyro_all)
    )


def joined(*parts: Dataset) -> Dataset:
    """Several data sets as one; their runs must bear different numbers."""
    stack = lambda name: np.concatenate([getattr(part, name) for part in parts])
    return Dataset.of_arrays(
        "gear_run", {"theta": np.concatenate([part.joints["theta"] for part in parts])},
        time=stack("time"), run=stack("run"), gyro=stack("gyro"),
    )
