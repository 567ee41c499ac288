"""Measures a virtual robot: static poses, gear runs, motions, tracked motions -> Dataset, as a file would hold them.

All predictions are the chain's. Motions let the springs swing where every axis has one (plant.py); `quasi_static`
takes the chain's own deflection instead, without ringing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Sequence

import numpy as np

from exactarm.chain import Layout, predict_gear_run, predict_poses
from exactarm.chain.motion import MotionView, motion_view, predict_drive
from exactarm.chain.motion_record import unthinned_record
from exactarm.chain.poses import predict_target
from exactarm.chain.propagate import pass_station
from exactarm.chain.spring import declared_deflection
from exactarm.dataset import Dataset
from exactarm.effects import Station
from exactarm.simulate.plant import is_elastic, swing
from exactarm.simulate.profiles import gear_run
from exactarm.simulate.sensors import Sensors, read, temperature
from exactarm.simulate.virtual_robot import VirtualRobot

_POSE_S = 10.0  # between two static poses


def measure_poses(
    robot: VirtualRobot, q: np.ndarray, sensors: Sensors, random: np.random.Generator, *, visits: int = 1,
    orientation: bool = False,
) -> Dataset:
    """The commanded poses q (K, n), each visited `visits` times, approached from random sides."""
    visit = np.tile(np.arange(1, len(q) + 1), visits)
    theta = np.tile(robot.motor_angles(q), (visits, 1))
    time = _POSE_S * np.arange(len(theta))
    approach = random.choice([-1.0, 1.0], theta.shape)
    more = {"time": time, "covariates": temperature(time, sensors)} | ({"visit": visit} if visits > 1 else {})
    data = Dataset.of_arrays("poses", {"theta": theta, "approach": approach}, position=np.zeros((len(theta), 3)), **more)
    prediction = predict_poses(robot.true, robot.layout, data, tangents=False)
    data = replace(data, position=prediction.position)
    if orientation:
        from exactarm.rotation import exp

        turned = random.normal(0.0, sensors.orientation_rad, (len(theta), 3))
        data = replace(data, rotation=exp(turned) @ prediction.rotation)
    return read(data, sensors, random)


def measure_gear_runs(
    robot: VirtualRobot, axes: Sequence[int], speeds: Sequence[float], repeats: int, sensors: Sensors,
    random: np.random.Generator, rate_hz: float = 1000.0,
) -> Dataset:
    """Constant-speed runs of each axis (from 0) at each speed (rad/s), up and down, under a gyroscope."""
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
        "gear_run", {"theta": theta}, time=time, run=run, gyro=np.zeros((theta.shape[0], 3)),
        covariates=temperature(clock, sensors),
    )
    prediction = predict_gear_run(robot.true, robot.layout, data, tangents=False)
    return read(replace(data, gyro=prediction.measured), sensors, random)


def measure_motion(
    robot: VirtualRobot, time: np.ndarray, theta: np.ndarray, sensors: Sensors, random: np.random.Generator, *,
    run: np.ndarray | None = None, quasi_static: bool = False, damping_s: float = 0.0,
) -> Dataset:
    """Drive torques while the motors follow theta (N, n) at `time` (N,), run by run."""
    data = _series("motion", time, theta, run, sensors)
    view = joint_motion(robot, data, quasi_static=quasi_static, damping_s=damping_s)
    predict_drive(view, robot.true, robot.layout, False)
    return read(replace(data, joints=data.joints | {"tau": view.signals["measured"]}), sensors, random)


def measure_tracked_motion(
    robot: VirtualRobot, time: np.ndarray, theta: np.ndarray, sensors: Sensors, random: np.random.Generator, *,
    run: np.ndarray | None = None, quasi_static: bool = False, damping_s: float = 0.0,
) -> Dataset:
    """The target's path under a tracker while the motors follow theta (N, n) at `time` (N,)."""
    data = _series("tracked_motion", time, theta, run, sensors)
    return read(replace(data, position=true_path(robot, data, quasi_static=quasi_static, damping_s=damping_s)), sensors, random)


def true_path(robot: VirtualRobot, data: Dataset, *, quasi_static: bool = False, damping_s: float = 0.0) -> np.ndarray:
    """(N, 3) m where the target really goes, in the measuring frame."""
    view = joint_motion(robot, data, quasi_static=quasi_static, damping_s=damping_s)
    return predict_target(view, robot.layout, False).position


def joint_motion(
    robot: VirtualRobot, data: Dataset, *, quasi_static: bool = False, damping_s: float = 0.0
) -> MotionView:
    """All signals up to the joints: the chain's, with the springs left to swing where all axes have one.

    What load and spring effects add, they add to the swinging motion as the chain adds it to a quasi-static one.
    """
    layout: Layout = robot.layout
    record = unthinned_record(robot.true, data)
    view = motion_view(robot.true, layout, record, tangents=False, kind=data.kind)
    if quasi_static or not is_elastic(view.robot):
        return view
    moving = {name: np.empty_like(view.q) for name in ("q", "q_dot", "q_ddot", "torque")}
    for rows in record.runs:
        links = swing(view.robot, data.time[rows], (view.phi + view.robot.offsets)[rows], damping_s)
        for name, values in moving.items():
            values[rows] = getattr(links, name)
    view.signals |= moving
    plain = view.torque
    pass_station(view, layout, Station.LOAD, "torque", False)
    more = declared_deflection(view.robot, view.torque)[0] - declared_deflection(view.robot, plain)[0]
    view.signals["q"] = view.q + more
    pass_station(view, layout, Station.SPRING, "q", False)
    return view


def _series(kind: str, time: np.ndarray, theta: np.ndarray, run: np.ndarray | None, sensors: Sensors) -> Dataset:
    run = np.ones(time.size, int) if run is None else run
    clock = (run - 1) * (np.max(time) if time.size else 0.0) + time
    return Dataset.of_arrays(kind, {"theta": theta}, time=time, run=run, covariates=temperature(clock, sensors))
