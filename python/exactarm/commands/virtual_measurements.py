"""What `exactarm simulate` measures: poses, gear runs, motions, tracked motions, closures of a virtual robot.

Each function takes the arguments of the command, the virtual robot, the rows of a planned file (or None)
and a random generator, and gives the rows as a file of that kind holds them.
"""

import argparse
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import make_interp_spline

from exactarm.data.columns import PAYLOAD, PAYLOAD_CENTRE
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import CLOSURES, GEAR_RUN, MOTION, POSES, TRACKED_MOTION
from exactarm.errors import InputError
from exactarm.robot.controller_frames import at_flange
from exactarm.robot.robot import Robot
from exactarm.robot.writer import robot_text
from exactarm.simulate import (
    Sensors,
    VirtualRobot,
    measure_gear_runs,
    measure_motion,
    measure_poses,
    measure_tracked_motion,
)
from exactarm.simulate.closures import fixture_text, measure_closures
from exactarm.simulate.independent import independent_path
from exactarm.simulate.measure import true_path
from exactarm.simulate.partner import FILE as PARTNER_FILE
from exactarm.simulate.profiles import LEAST_OF_A_RUN, excitation, limit

_SPEEDS = (0.4, 0.3)  # of the largest rate, as in the thesis (3.1.2)
PAYLOADS = (PAYLOAD, *PAYLOAD_CENTRE)
DEGREE = np.pi / 180.0


@dataclass(frozen=True)
class Played:
    """What was measured, under which file name, and for a played trajectory the flange's error (N,) in m."""

    data: Dataset
    name: str
    tracking: np.ndarray | None = None
    texts: dict[str, str] = field(default_factory=dict)


def _sensors(arguments: argparse.Namespace) -> Sensors:
    noise = {}
    if arguments.noise is not None:
        noise = {"position_m": arguments.noise, "gyro_rad_s": arguments.noise, "torque_Nm": arguments.noise}
    if arguments.torques is not None:
        noise["torque_Nm"] = arguments.torques
    temperature = None if arguments.temperature is None else tuple(arguments.temperature)
    return Sensors(counts=arguments.counts, wrong_rows=arguments.wrong_rows, temperature_degC=temperature,
                   **noise)


def _poses(arguments: argparse.Namespace, virtual: VirtualRobot, planned: Dataset | None,
           random: np.random.Generator) -> Played:
    robot = virtual.nominal
    if planned is not None:
        angles = planned.joints.get("q", np.full((len(planned), robot.axes), np.nan))
        theta = planned.joints.get("theta", np.full_like(angles, np.nan))
        q = np.where(np.isnan(angles), theta / robot.controller_ratios + robot.controller_offsets, angles)
    else:
        q = random.uniform(limit(robot, "q_min"), limit(robot, "q_max"), (arguments.count, robot.axes))
    carried = ({} if planned is None
               else {name: planned.covariates[name] for name in PAYLOADS if name in planned.covariates})
    data = measure_poses(
        virtual, q, _sensors(arguments), random, visits=arguments.visits, orientation=arguments.orientation,
        session=None if planned is None else planned.session, payload=carried,
        approach=None if planned is None else planned.joints.get("approach"),
        torques=arguments.torques is not None)
    return Played(data, FILES[POSES.measured_as])


def _closures(arguments: argparse.Namespace, virtual: VirtualRobot, planned: Dataset | None,
              random: np.random.Generator) -> Played:
    noise = {} if arguments.noise is None else {"orientation_rad": arguments.noise}
    data, fixture = measure_closures(virtual, arguments.contact, arguments.places, arguments.count,
                                     replace(_sensors(arguments), **noise), random)
    texts = {"fixture.toml": fixture_text(fixture)}
    if (partner := fixture.partner) is not None:
        texts[partner.file] = robot_text(partner.robot)
    return Played(data, FILES[CLOSURES.measured_as], texts=texts)


def _gear(arguments: argparse.Namespace, virtual: VirtualRobot, planned: Dataset | None,
          random: np.random.Generator) -> Played:
    robot = virtual.nominal
    axes = [i for i, joint in enumerate(robot.joints) if joint.has_gear]
    if not axes:
        raise InputError(f"robot {robot.name} declares no gear ratio; expected one for a gear run",
                         file=robot.file)
    if arguments.joint:
        wrong = [axis for axis in arguments.joint if axis - 1 not in axes]
        if wrong:
            raise InputError(f"--joint {wrong[0]}: expected an axis with a gear, one of "
                             f"{[i + 1 for i in axes]}")
        axes = [axis - 1 for axis in arguments.joint]
    parts = []
    for axis in axes:
        top = float(limit(robot, "q_dot_max")[axis])
        speeds = ([speed * DEGREE for speed in arguments.speed]
                  if arguments.speed else [share * top for share in _SPEEDS])
        parts.append(measure_gear_runs(
            virtual, [axis], speeds, arguments.repeats, _sensors(arguments), random, arguments.rate or 1000.0,
            in_motion=arguments.in_motion))
    return Played(_joined(parts), FILES[GEAR_RUN.measured_as])


def _joined(parts: list[Dataset]) -> Dataset:
    first, runs = [], 0
    for part in parts:
        first.append(part.run + runs)
        runs += int(part.run.max())
    stack = lambda pick: np.concatenate([pick(part) for part in parts])
    covariates = {name: stack(lambda part, name=name: part.covariates[name]) for name in parts[0].covariates}
    return Dataset.of_arrays(
        GEAR_RUN.name, {"theta": stack(lambda part: part.joints["theta"])},
        time=stack(lambda part: part.time),
        run=np.concatenate(first), gyro=stack(lambda part: part.gyro), covariates=covariates)


def _motion(arguments: argparse.Namespace, virtual: VirtualRobot, planned: Dataset | None,
            random: np.random.Generator) -> Played:
    joints = None
    if planned is None:
        pieces, rate = [], arguments.rate or 500.0
        if (samples := round(arguments.seconds * rate)) < LEAST_OF_A_RUN:
            raise InputError(f"--seconds {arguments.seconds:g}, --rate {rate:g}: {samples} samples; expected "
                             f"{LEAST_OF_A_RUN} or more")
        for _ in range(arguments.runs):
            time, q = excitation(virtual.nominal, arguments.seconds, rate, random)
            pieces.append((time, virtual.motor_angles(q)))
        time, theta = (np.concatenate([piece[k] for piece in pieces]) for k in (0, 1))
        run = np.repeat(np.arange(1, len(pieces) + 1), [len(piece[0]) for piece in pieces])
    else:
        time, theta, joints = _resampled(planned, virtual.nominal, arguments.rate)
        run = np.ones(time.size, int)
    damping = 1e-3 if arguments.damping is None else arguments.damping
    data = measure_motion(virtual, time, theta, _sensors(arguments), random, run=run, joints=joints,
                          quasi_static=arguments.quasi_static, damping_s=damping)
    return Played(data, FILES[MOTION.measured_as])


def _tracked(arguments: argparse.Namespace, virtual: VirtualRobot, planned: Dataset | None,
             random: np.random.Generator) -> Played:
    if planned is None:
        raise ValueError("expected a planned trajectory")
    time, theta, joints = _resampled(planned, virtual.nominal, arguments.rate)
    how = {"quasi_static": arguments.quasi_static, "damping_s": arguments.damping or 0.0}
    series = Dataset.of_arrays(TRACKED_MOTION.name, {"theta": theta}, time=time)
    seen = VirtualRobot(virtual.nominal, at_flange(virtual.true))
    if arguments.engine == "pinocchio":
        flange = independent_path(seen, time, theta, joints)
    else:
        flange = true_path(seen, series, joints, **how)
    data = measure_tracked_motion(virtual, time, theta, _sensors(arguments), random, joints=joints, **how)
    tracking = None
    if planned.position is not None:
        desired = make_interp_spline(planned.sample_times, planned.position, k=5)(time)
        tracking = np.linalg.norm(flange - desired, axis=1)
    return Played(data, FILES[TRACKED_MOTION.measured_as], tracking)


def _resampled(planned: Dataset, robot: Robot,
               rate_hz: float | None) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """time, motor angles and joint angles (as planned, None if not in the file).

    By a quintic spline where another rate is asked for (the controller's interpolation).
    """
    angles, joints = planned.joints.get("theta"), _planned_joints(planned, robot)
    if angles is None or np.isnan(angles).any():
        angles = (planned.joints["q"] - robot.controller_offsets) * robot.controller_ratios
    given = planned.sample_times
    if len(planned) < 6 or np.any(np.diff(given) <= 0.0):
        raise InputError("a trajectory needs at least 6 rows whose time_s rises")
    if rate_hz is None:
        return given, angles, joints
    time = np.arange(given[0], given[-1] + 0.5 / rate_hz, 1.0 / rate_hz)
    time = time[time <= given[-1] + 1e-12]
    at = lambda values: make_interp_spline(given, values, k=5)(time)
    return time, at(angles), None if joints is None else at(joints)


def _planned_joints(planned: Dataset, robot: Robot) -> np.ndarray | None:
    """(N, n) the joint angles that a trajectory is for, else those that it reaches."""
    desired = [planned.covariates.get(f"q_desired_{i + 1}_rad") for i in range(robot.axes)]
    found = [column for column in desired if column is not None]
    if len(found) == robot.axes:
        return np.column_stack(found)
    reached = planned.joints.get("q")
    return None if reached is None or np.isnan(reached).any() else reached


MEASURES = {
    POSES.measured_as: _poses, GEAR_RUN.measured_as: _gear, MOTION.measured_as: _motion,
    TRACKED_MOTION.measured_as: _tracked, CLOSURES.measured_as: _closures,
}
FILES = {
    POSES.measured_as: "measured.csv", GEAR_RUN.measured_as: "gear_runs.parquet",
    MOTION.measured_as: "motion.parquet", TRACKED_MOTION.measured_as: "tracked.csv",
    CLOSURES.measured_as: "closures.csv",
}
FIXTURE_FILES = ("fixture.toml", PARTNER_FILE)  # beside closures
SHOW_THE_TARGET = (POSES.measured_as, TRACKED_MOTION.measured_as, CLOSURES.measured_as)
