"""Measures a virtual robot: static poses, gear runs, motions, tracked motions -> Dataset, as a file would
hold them.

All predictions are the chain's. Motions let the springs swing where every axis has one (plant.py);
`quasi_static` takes the chain's own deflection instead, without ringing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from exactarm import _core
from exactarm.chain import Layout, predict_gear_run, predict_poses
from exactarm.chain.direction import eased
from exactarm.chain.motion import MotionView, motion_view, predict_drive
from exactarm.chain.motion_record import MotionRecord, full_record
from exactarm.chain.poses import predict_target
from exactarm.chain.propagate import pass_station
from exactarm.chain.spring import declared_deflection
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import GEAR_RUN, MOTION, POSES, TRACKED_MOTION
from exactarm.effects import Station
from exactarm.simulate.plant import is_elastic, swing
from exactarm.simulate.profiles import gear_run
from exactarm.simulate.sensors import Sensors, read, temperature
from exactarm.simulate.virtual_robot import VirtualRobot

_POSE_S = 10.0  # between two static poses
_STEADY = 1e-6  # of the full speed: far above the rounding of a sample's step, far below a sample of a ramp


def measure_poses(
    robot: VirtualRobot, q: np.ndarray, sensors: Sensors, random: np.random.Generator, *, visits: int = 1,
    orientation: bool = False, session: np.ndarray | None = None,
    payload: Mapping[str, np.ndarray] | None = None,
    approach: np.ndarray | None = None,
    torques: bool = False,
) -> Dataset:
    """The commanded poses q (K, n), each visited `visits` times; of each pose its session (K,), columns of
    its payload (K,), and from which side each axis comes (K, n), random where that is None or NaN; torques:
    those of the joints are measured too."""
    visit = np.tile(np.arange(1, len(q) + 1), visits)
    theta = np.tile(robot.motor_angles(q), (visits, 1))
    time = _POSE_S * np.arange(len(theta))
    side = random.choice([-1.0, 1.0], theta.shape)
    if approach is not None:
        given = np.tile(approach, (visits, 1))
        side = np.where(np.isnan(given), side, given)
    carried = {name: np.tile(values, visits) for name, values in (payload or {}).items()}
    more = {"time": time,
            "covariates": temperature(time, sensors) | carried} | ({"visit": visit} if visits > 1 else {})
    if session is not None:
        more["session"] = np.tile(session, visits)
    data = Dataset.of_arrays(POSES.name, {"theta": theta, "approach": side},
                             position=np.zeros((len(theta), 3)), **more)
    prediction = predict_poses(robot.true, robot.layout, data, tangents=False)
    data = replace(data, position=prediction.position)
    if torques:
        data = replace(data, joints=data.joints | {"tau": prediction.view.torque})
    if orientation:
        from exactarm.numerics.rotation import exp

        turned = random.normal(0.0, sensors.orientation_rad, (len(theta), 3))
        data = replace(data, rotation=exp(turned) @ prediction.rotation)
    return read(data, sensors, random, robot.nominal)


def measure_gear_runs(
    robot: VirtualRobot, axes: Sequence[int], speeds: Sequence[float], repeats: int, sensors: Sensors,
    random: np.random.Generator, rate_hz: float = 1000.0, *, in_motion: bool = False,
) -> Dataset:
    """Constant-speed runs of each axis (from 0) at each speed (rad/s), up and down, under a gyroscope.

    in_motion: runs begin and end at constant speed, as people cut them; else at rest.
    """
    time, q, run = [], [], []
    for axis in axes:
        for speed in speeds:
            for k in range(2 * repeats):
                t, angles = gear_run(robot.nominal, axis, speed, k % 2 == 0, rate_hz)
                time.append(t), q.append(angles), run.append(np.full(t.size, len(run) + 1))
    theta = robot.motor_angles(np.concatenate(q))
    time, run = np.concatenate(time), np.concatenate(run)
    clock = (run - 1) * np.max(time) + time
    data = Dataset.of_arrays(
        GEAR_RUN.name, {"theta": theta}, time=time, run=run, gyro=np.zeros((theta.shape[0], 3)),
        covariates=temperature(clock, sensors),
    )
    prediction = predict_gear_run(robot.true, robot.layout, data, tangents=False)
    data = replace(data, gyro=prediction.measured)
    return read(data.select(_at_full_speed(data)) if in_motion else data, sensors, random, robot.nominal)


def _at_full_speed(data: Dataset) -> np.ndarray:
    """(N,) bool: samples at the constant speed of their run."""
    full = np.zeros(len(data), bool)
    for number in np.unique(data.run):
        rows = np.flatnonzero(data.run == number)
        way = np.abs(np.diff(data.joints["theta"][rows], axis=0)).max(axis=1)
        steady = np.flatnonzero(way > (1.0 - _STEADY) * way.max())
        full[rows[steady[0] : steady[-1] + 2]] = True
    return full


def measure_motion(
    robot: VirtualRobot, time: np.ndarray, theta: np.ndarray, sensors: Sensors, random: np.random.Generator,
    *,
    run: np.ndarray | None = None, joints: np.ndarray | None = None, quasi_static: bool = False,
    damping_s: float = 0.0,
) -> Dataset:
    """Drive torques while the motors follow theta (N, n) at `time` (N,), run by run; `joints` as in
    `joint_motion`."""
    data = _series(MOTION.name, time, theta, run, sensors)
    view = joint_motion(robot, data, joints, quasi_static=quasi_static, damping_s=damping_s)
    predict_drive(view, robot.true, robot.layout, False)
    return read(replace(data, joints=data.joints | {"tau": view.signals["measured"]}), sensors, random,
                robot.nominal)


def measure_tracked_motion(
    robot: VirtualRobot, time: np.ndarray, theta: np.ndarray, sensors: Sensors, random: np.random.Generator,
    *,
    run: np.ndarray | None = None, joints: np.ndarray | None = None, quasi_static: bool = False,
    damping_s: float = 0.0,
) -> Dataset:
    """The target's path under a tracker while the motors follow theta (N, n) at `time` (N,); `joints` as in
    `joint_motion`."""
    data = _series(TRACKED_MOTION.name, time, theta, run, sensors)
    view = joint_motion(robot, data, joints, quasi_static=quasi_static, damping_s=damping_s)
    position = predict_target(view, robot.layout, False).position
    return read(replace(data, position=position), sensors, random, robot.nominal)


def true_path(
    robot: VirtualRobot, data: Dataset, joints: np.ndarray | None = None, *, quasi_static: bool = False,
    damping_s: float = 0.0
) -> np.ndarray:
    """(N, 3) m where the target really goes, in the measuring frame; what the device makes of it does not
    count."""
    view = joint_motion(robot, data, joints, quasi_static=quasi_static, damping_s=damping_s)
    predict_target(view, robot.layout, False)
    return view.signals["target"] + view.signals["displacement"][:, :3]


def joint_motion(
    robot: VirtualRobot, data: Dataset, joints: np.ndarray | None = None, *, quasi_static: bool = False,
    damping_s: float = 0.0
) -> MotionView:
    """All signals up to the joints: the chain's, with the springs left to swing where all axes have one.

    What load and spring effects add to the deflection along the motion without ringing, moves what the links
    swing behind: the springs are in series with it. What jumps there passes as a plan lets it pass
    (chain/direction.py).
    `joints` (N, n): how the joints are to move; reversals and loads of effects are those of this motion.
    Without it they are the motors', which a plan lets make up for gears and clearances.
    """
    layout: Layout = robot.layout
    record = full_record(robot.true, data, joints=joints)
    view = motion_view(robot.true, layout, record, tangents=False, kind=data.kind)
    if quasi_static or not is_elastic(view.robot):
        return view
    behind = view.phi + view.robot.offsets + _added_deflection(view, layout, record, joints)
    moving = {name: np.empty_like(view.q) for name in ("q", "q_dot", "q_ddot", "torque")}
    for rows in record.runs:
        links = swing(view.robot, data.time[rows], behind[rows], damping_s)
        for name, values in moving.items():
            values[rows] = getattr(links, name)
    view.signals |= moving
    pass_station(view, layout, Station.LOAD, "torque", False)
    return view


def _added_deflection(
    view: MotionView, layout: Layout, record: MotionRecord, joints: np.ndarray | None
) -> np.ndarray:
    """(N, n) what effects at load and springs add to q."""
    inside = replace(view, signals=dict(view.signals))
    if joints is not None:
        rate = record.derivative(joints)
        inside.signals |= {"q": joints, "q_dot": rate, "q_ddot": record.derivative(rate)}
    motion = (inside.q, inside.signals["q_dot"], inside.signals["q_ddot"])
    plain = _core.inverse_dynamics(view.robot.core, *motion, view.threads)
    inside.signals["torque"] = plain
    pass_station(inside, layout, Station.LOAD, "torque", False)
    added = declared_deflection(view.robot, inside.torque)[0] - declared_deflection(view.robot, plain)[0]
    for effect in layout.effects:
        if effect.station != Station.SPRING:
            continue
        change = effect.change(inside)
        for rows in record.runs:
            value = change.value[rows]
            added[np.ix_(rows, change.columns)] += value if effect.smooth else eased(value, record.step)
    return added


def _series(kind: str, time: np.ndarray, theta: np.ndarray, run: np.ndarray | None,
            sensors: Sensors) -> Dataset:
    run = np.ones(time.size, int) if run is None else run
    clock = (run - 1) * (np.max(time) if time.size else 0.0) + time
    return Dataset.of_arrays(kind, {"theta": theta}, time=time, run=run,
                             covariates=temperature(clock, sensors))
