"""The chain for static poses: motor angles in, position and orientation of the target out.

At rest the spring carries the gravity torque, or what was measured (rest_load.py; E4): q = phi + q_offset -
kappa^{-1}(g(q)), solved by fixed-point iteration (the deflection is small, each pass gains three digits). The
tangent of the fixed point follows from the implicit function theorem:
    (I - S G) T_q = T_0 + S T_L,    S = dq/dtorque, G = dg/dq, T_L = direct tangent of the load.
Left out of the tangents: that geometry changes the gravity torque too (below 1 % of a geometry column).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.chain.gear import declared_output_angle
from exactarm.chain.layout import Layout
from exactarm.chain.propagate import pass_station, pass_tangents
from exactarm.chain.spring import declared_deflection
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.effects.base import Station
from exactarm.numerics.rotation import exp as rotation_exp
from exactarm.numerics.rotation import log as rotation_log
from exactarm.rest_load import RestLoad
from exactarm.robot.robot import Robot
from exactarm.view import View, motor_angles

_FIXED_POINT_TOLERANCE_RAD = 1e-13
_FIXED_POINT_PASSES = 30


@dataclass(frozen=True)
class PosePrediction:
    """What the device should measure. position (N, 3) m, rotation (N, 3, 3), jacobian (N, 6, P) or None.

    Rows of the jacobian: position, then rotation increment delta with R' = exp(delta) R (rad).
    """

    position: np.ndarray
    rotation: np.ndarray
    jacobian: np.ndarray | None
    view: View

    def residual(self, orientation: bool = False) -> np.ndarray:
        """(N, 3) or (N, 6): measured minus predicted; orientation as a rotation vector in the measuring
        frame."""
        data = self.view.data
        position = data.position - self.position
        if not orientation:
            return position
        turned = rotation_log(data.rotation @ np.swapaxes(self.rotation, -1, -2))
        return np.concatenate([position, turned], axis=1)


def predict_poses(
    robot: Robot, layout: Layout, data: Dataset, *, tangents: bool = True, threads: int = 1
) -> PosePrediction:
    """Prediction of every row of `data` with the effects of `layout` in the chain."""
    view = View(layout.baked(robot), data, POSES.name, threads)
    _joint_angles(view, layout, tangents)
    return predict_target(view, layout, tangents)


def _joint_angles(view: View, layout: Layout, tangents: bool) -> None:
    """Fills theta, phi, torque, q and their tangents."""
    rows, n, size = view.rows, view.axes, layout.size
    view.signals["theta"] = motor_angles(view.robot, view.data)
    pass_station(view, layout, Station.MOTOR, "theta", False)
    declared, slope = declared_output_angle(view)
    view.signals["q"] = declared + view.robot.offsets
    view.signals["torque"] = np.zeros((rows, n))
    view.rest_load = load = RestLoad.of(view.robot, view.data, view.threads)
    for _ in range(_FIXED_POINT_PASSES):
        q_before = view.q
        if load.any:
            view.signals["torque"] = load.torque(view.q)
        pass_station(view, layout, Station.LOAD, "torque", False)
        view.signals["torque"] = load.as_measured(view.torque)
        view.signals["phi"] = declared
        pass_station(view, layout, Station.GEAR, "phi", False)
        view.signals["q"] = view.phi + view.robot.offsets + declared_deflection(view.robot, view.torque)[0]
        pass_station(view, layout, Station.SPRING, "q", False)
        if np.max(np.abs(view.q - q_before), initial=0.0) < _FIXED_POINT_TOLERANCE_RAD or not load.any:
            break
    if tangents and size:
        _joint_tangents(view, layout, declared, slope)


def _joint_tangents(view: View, layout: Layout, declared: np.ndarray, slope: np.ndarray) -> None:
    """Tangents of theta, phi, torque and q at the fixed point.

    The torque's own tangent is an unknown, so the stations run with n extra columns that stand for a unit
    change of each joint torque.
    """
    rows, n, size = view.rows, view.axes, layout.size
    wide, axes = size + n, np.arange(n)
    torque, q = view.torque, view.q
    tangents = view.tangents
    nothing = np.zeros((rows, n, wide))
    tangents["theta"] = nothing
    moved = pass_tangents(view, layout, Station.MOTOR, "theta")
    unit = np.zeros((rows, n, wide))
    unit[:, :, size:] = np.eye(n)
    tangents["torque"], tangents["q"] = unit, nothing
    loaded = pass_tangents(view, layout, Station.LOAD, "torque")
    direct = None if loaded is unit else view.rest_load.unless_measured(loaded - unit)[:, :, :size]
    tangents["torque"] = unit
    tangents["phi"] = nothing if moved is nothing else slope[:, :, None] * moved
    view.signals["phi"] = declared
    pass_station(view, layout, Station.GEAR, "phi", True)
    deflection, give = declared_deflection(view.robot, view.torque)
    tangents["q"] = tangents["phi"].copy()
    tangents["q"][:, axes, size + axes] += give
    view.signals["q"] = view.phi + view.robot.offsets + deflection
    pass_station(view, layout, Station.SPRING, "q", True)
    view.signals["torque"], view.signals["q"] = torque, q
    by_torque, right = tangents["q"][:, :, size:], tangents["q"][:, :, :size]
    view.signals["deflection_by_torque"] = by_torque.reshape(rows, -1)
    if direct is not None:
        right = right + by_torque @ direct
    if view.rest_load.any:
        gravity = view.rest_load.slope(q)
        if np.any(by_torque):
            right = np.linalg.inv(np.eye(n) - by_torque @ gravity) @ right  # hundreds of columns
        tangents["torque"] = gravity @ right if direct is None else gravity @ right + direct
    else:
        tangents["torque"] = nothing[:, :, :size] if direct is None else direct
    tangents["q"] = right
    by_torque = tangents["phi"][:, :, size:]
    tangents["phi"] = tangents["phi"][:, :, :size]
    if np.any(by_torque):
        tangents["phi"] = tangents["phi"] + by_torque @ tangents["torque"]
    tangents["theta"] = moved[:, :, :size]


def predict_target(view: View, layout: Layout, tangents: bool) -> PosePrediction:
    """From joint angles to the measured target: geometry, frames of each session, device."""
    rows, n, size = view.rows, view.axes, layout.size
    jacobian = np.zeros((rows, 6, size)) if tangents else None
    tangents = tangents and size > 0
    position, rotation = np.empty((rows, 3)), np.empty((rows, 3, 3))
    columns = np.empty((rows, 6, _core.identification_columns(n))) if tangents else None
    view.signals["base_position"], view.signals["base_rotation"] = np.empty((rows, 3)), np.empty((rows, 9))
    for session, where in view.sessions:
        placed = _placed(view.robot, layout, session)
        core = placed.core
        view.signals["base_position"][where] = placed.base.position
        view.signals["base_rotation"][where] = placed.base.rotation.ravel()
        if tangents:
            result = _core.identification_jacobian(core, view.q[where], threads=view.threads)
            columns[where] = result[2]
        else:
            result = _core.forward_kinematics(core, view.q[where], view.threads)
        position[where], rotation[where] = result[0], result[1]
    view.signals["target"], view.signals["target_rotation"] = position, rotation.reshape(rows, 9)
    view.signals["displacement"] = np.zeros((rows, 6))
    if tangents:
        view.signals["identification"] = columns.reshape(rows, -1)
        joint_columns = view.target_by("q")
        if not view.is_series:
            view.transfers = _transfers(view, joint_columns)
        view.tangents["displacement"] = joint_columns @ view.tangents["q"]
    pass_station(view, layout, Station.GEOMETRY, "displacement", tangents)
    moved = view.signals["displacement"]
    view.signals["measured"] = position + moved[:, :3]
    if np.any(moved[:, 3:]):
        rotation = rotation_exp(moved[:, 3:]) @ rotation
    if tangents:
        view.tangents["measured"] = view.tangents["displacement"][:, :3]
    pass_station(view, layout, Station.DEVICE, "measured", tangents)
    if tangents:
        jacobian[:, :3], jacobian[:, 3:] = view.tangents["measured"], view.tangents["displacement"][:, 3:]
        # What leads there has done its work: kept with a fit of many parameters, it is most of its memory.
        view.tangents = {"measured": jacobian[:, :3]}
    return PosePrediction(view.measured, rotation, jacobian, view)


def _transfers(view: View, joint_columns: np.ndarray) -> dict:
    """First-order effect of a change at each station on position and orientation (6 rows)."""
    by_torque = view.signals["deflection_by_torque"].reshape(view.rows, view.axes, view.axes)
    ratios = view.robot.ratios

    def joint(columns, derivative):
        return joint_columns[:, :, columns] @ derivative

    def motor(columns, derivative):
        return joint_columns[:, :, columns] @ (derivative / ratios[list(columns), None])

    def load(columns, derivative):
        free = ~view.rest_load.fixed[:, list(columns), None]
        return joint_columns @ (by_torque[:, :, columns] @ (derivative * free))

    def geometry(columns, derivative):
        out = np.zeros((view.rows, 6, derivative.shape[2]))
        out[:, list(columns)] = derivative
        return out

    return {
        Station.MOTOR: motor, Station.GEAR: joint, Station.LOAD: load, Station.SPRING: joint,
        Station.GEOMETRY: geometry, Station.DEVICE: geometry,
    }


def _placed(robot: Robot, layout: Layout, session: int) -> Robot:
    base, tool = robot.base, robot.tool
    for effect in layout.effects:
        base, tool = effect.place(session, base, tool)
    moved = base is not robot.base or tool is not robot.tool
    return replace(robot, base=base, tool=tool) if moved else robot
