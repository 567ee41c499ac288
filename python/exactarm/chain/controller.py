"""The arm at the angles that its controller reports: kinematics and torques through the whole chain.

    q_controller -> theta = (q - controller_offset) controller_ratio
    -> gears, springs, effects -> joints -> flange

A calibration leaves the controller's own constants as they are and puts what it found into offsets, geometry,
gears and springs; so the pose at the angles a controller shows is not that of the joint angles. All functions
take q (n,) or (N, n) in rad (m for a prismatic joint) at rest, and return one result or N of them.
Reference points: "flange", the controller's (the last link of a URDF), or "target" (the tool frame of the
robot file). Frames: "base", the controller's (the first link of a URDF), or "device" (where the measuring
device stands).
Limits: at rest, in a direction that `approach` says (-1, 0, +1 an axis; 0 takes the mean of both). Effects of
the measuring device, and those that tell of one record, are no part of where the arm is.
"""

from dataclasses import replace

import numpy as np

from exactarm import _core
from exactarm.chain.layout import Layout
from exactarm.chain.poses import PosePrediction, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.effects.base import Station
from exactarm.errors import ComputationError, InputError
from exactarm.numerics.rotation import log
from exactarm.robot.controller_frames import at_base, at_flange
from exactarm.robot.robot import Frame, Point, Robot

_PASSES = 50
_STEP_RAD = 1e-6  # central differences of the chain: error of order step^2 against rounding 1e-16 / step
_CLOSE_M, _CLOSE_RAD = 1e-10, 1e-10  # where the search for joint angles ends: far below any encoder's count
_DAMPING = 1e-9


def forward(robot: Robot, q: np.ndarray, of: Point = "flange", seen_from: Frame = "base",
            approach: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Positions (N, 3) m and rotations (N, 3, 3) of the point."""
    found = _predict(_placed(robot, of, seen_from), q, approach)
    return found.position, found.rotation


def joint_angles(robot: Robot, q: np.ndarray, approach: np.ndarray | None = None) -> np.ndarray:
    """(N, n) true joint angles behind the controller's."""
    return _predict(_placed(robot, "flange", "base"), q, approach).view.q


def jacobian(robot: Robot, q: np.ndarray, of: Point = "flange", seen_from: Frame = "base") -> np.ndarray:
    """(N, 6, n) change of position (m) and rotation increment (rad) with the controller's angles.

    By central differences of the whole chain, so that gears and springs are in it.
    """
    placed = _placed(robot, of, seen_from)
    n = robot.axes
    count = len(q)
    shifts = np.concatenate([_STEP_RAD * np.eye(n), -_STEP_RAD * np.eye(n)])
    found = _predict(placed, (q[:, None, :] + shifts).reshape(-1, n), None)
    position = found.position.reshape(count, 2, n, 3)
    rotation = found.rotation.reshape(count, 2, n, 3, 3)
    linear = (position[:, 0] - position[:, 1]) / (2.0 * _STEP_RAD)
    turn = rotation[:, 0] @ np.swapaxes(rotation[:, 1], -1, -2)
    skew = (turn - np.swapaxes(turn, -1, -2)) / (4.0 * _STEP_RAD)
    angular = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
    return np.concatenate([np.swapaxes(linear, 1, 2), np.swapaxes(angular, 1, 2)], axis=1)


def inverse(robot: Robot, position: np.ndarray, rotation: np.ndarray, start: np.ndarray | None, of: Point,
            seen_from: Frame) -> np.ndarray:
    """(n,) the controller's angles that put the point at position (3,) with rotation (3, 3).

    Damped Gauss-Newton on the whole chain from `start`; without one, from every branch of the rigid arm
    within the limits, nearest to their middle first. Raises ComputationError where none ends at the pose.
    """
    starts = ([np.asarray(start, float)] if start is not None
              else _branches(robot, position, rotation, of, seen_from))
    for q0 in starts:
        q = _newton(robot, position, rotation, q0, of, seen_from)
        if q is not None:
            return q
    where = ", ".join(f"{x:.3f}" for x in position)
    raise ComputationError(f"no joint angles within the limits reach ({where}) m with this orientation")


def _newton(robot: Robot, position: np.ndarray, rotation: np.ndarray, q: np.ndarray, of: Point,
            seen_from: Frame) -> np.ndarray | None:
    for _ in range(_PASSES):
        at, turned = forward(robot, q[None], of, seen_from)
        error = np.concatenate([position - at[0], log(rotation @ turned[0].T)])
        if np.linalg.norm(error[:3]) < _CLOSE_M and np.linalg.norm(error[3:]) < _CLOSE_RAD:
            return q
        slope = jacobian(robot, q[None], of, seen_from)[0]
        step = slope.T @ np.linalg.solve(slope @ slope.T + _DAMPING * np.eye(6), error)
        q = q + step * min(1.0, 0.5 / max(float(np.max(np.abs(step))), 1e-12))
    return None


def _branches(robot: Robot, position: np.ndarray, rotation: np.ndarray, of: Point,
              seen_from: Frame) -> list[np.ndarray]:
    """Controller angles of the rigid arm's solutions."""
    pose = _core.Pose(np.asarray(rotation, float), np.asarray(position, float))
    found = _core.inverse_kinematics_branches(_placed(robot, of, seen_from).core, pose)
    shift = robot.offsets - robot.controller_offsets
    return [np.asarray(q) - shift for q in found]


def inverse_dynamics(robot: Robot, q: np.ndarray, q_dot: np.ndarray, q_ddot: np.ndarray) -> np.ndarray:
    """(N, n) Nm, link side, without friction: D q_ddot + C q_dot + g at the joints behind q (N, n)."""
    if robot.links is None or robot.generic_masses:
        raise InputError(f"robot {robot.name} declares no link masses; expected them for torques")
    placed = _placed(robot, "flange", "base")
    joints = _predict(placed, q, None)
    return _core.inverse_dynamics(joints.view.robot.core, np.ascontiguousarray(joints.view.q),
                                  np.ascontiguousarray(q_dot), np.ascontiguousarray(q_ddot), 1)


def _placed(robot: Robot, of: Point, seen_from: Frame) -> Robot:
    if of not in ("flange", "target"):
        raise InputError(f"of = {of!r}; expected 'flange' or 'target'")
    if seen_from not in ("base", "device"):
        raise InputError(f"seen_from = {seen_from!r}; expected 'base' or 'device'")
    if not robot.has_geometry:
        raise InputError(f"robot {robot.name} declares no geometry; expected one for poses and torques")
    base = robot.base if seen_from == "device" else at_base(robot).base
    tool = robot.tool if of == "target" else at_flange(robot).tool
    effects = tuple(effect for effect in robot.effects
                    if not effect.record and POSES.name in effect.kinds and effect.station != Station.DEVICE)
    return replace(robot, base=base, tool=tool, effects=effects)


def _predict(robot: Robot, q: np.ndarray, approach: np.ndarray | None) -> PosePrediction:
    joints = {"q": np.ascontiguousarray(q, float)}
    if approach is not None:
        joints["approach"] = np.broadcast_to(np.asarray(approach, float), q.shape)
    data = Dataset.of_arrays(POSES.name, joints)
    return predict_poses(robot, Layout.of(robot.effects, estimate=False), data, tangents=False)
