"""The chain for static poses: motor angles in, position and orientation of the target out.

At rest the spring carries the gravity torque, or what was measured (rest_load.py; E4): q = phi + q_offset -
kappa^{-1}(g(q)), solved by fixed-point iteration (the deflection is small, each pass gains three digits).
Derivatives are taken backwards (adjoint.py). At the fixed point, by the implicit function theorem, what comes
back from q and from the load is
    A_q = (A_q + A_load G) (I - S G)^{-1},    A_load = A_load + A_q S,    S = dq/dtorque, G = dg/dq.
Left out of the derivatives: that geometry changes the gravity torque too (below 1 % of a geometry column).
"""

from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.chain.adjoint import Adjoint
from exactarm.chain.gear import declared_output_angle
from exactarm.chain.layout import Layout
from exactarm.chain.propagate import Passed, changes, pass_station
from exactarm.chain.spring import declared_deflection
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.effects.base import Station
from exactarm.numerics.rotation import exp as rotation_exp
from exactarm.numerics.rotation import log as rotation_log
from exactarm.rest_load import RestLoad, weighed
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
        """(N, 3) or (N, 6): measured minus predicted; rotation vectors in the measuring frame."""
        data = self.view.data
        position = data.position - self.position
        if not orientation:
            return position
        turned = rotation_log(data.rotation @ np.swapaxes(self.rotation, -1, -2))
        return np.concatenate([position, turned], axis=1)


def predict_poses(robot: Robot, layout: Layout, data: Dataset, *, tangents: bool = True,
                  threads: int = 1) -> PosePrediction:
    """Prediction of every row of `data` with the effects of `layout` in the chain."""
    view = View(layout.baked(robot), data, POSES.name, threads)
    joints = _joint_angles(view, layout, tangents and layout.size > 0)
    prediction, adjoint = _target(view, layout, tangents)
    if joints is not None:
        joints.back(view, adjoint)
        # What leads there has done its work.
        view.tangents = {"measured": adjoint.jacobian[:, :3]}
    return prediction


@dataclass(frozen=True)
class _Joints:
    """What the joints have passed: changes by station, slope (N, n) of the declared gears, and (N, n, n)
    what a unit of each joint's torque does to phi and q."""

    passed: dict[Station, Passed]
    slope: np.ndarray
    phi_by_torque: np.ndarray
    q_by_torque: np.ndarray

    def back(self, view: View, adjoint: Adjoint) -> None:
        """From q, torque, phi and theta to the parameters of the stations before."""
        by, nothing = adjoint.by, np.zeros((view.rows, 6, view.axes))
        q, torque, phi, theta = (by.get(name, nothing) for name in ("q", "torque", "phi", "theta"))
        torque = torque + phi @ self.phi_by_torque
        if view.rest_load.any:
            gravity = view.rest_load.slope(view.q)
            q = (q + torque @ gravity) @ np.linalg.inv(np.eye(view.axes) - self.q_by_torque @ gravity)
        torque = np.swapaxes(view.rest_load.unless_measured(
            np.swapaxes(torque + q @ self.q_by_torque, 1, 2)), 1, 2)
        by |= {"q": q, "torque": torque, "phi": phi, "theta": theta}
        adjoint.back("q", self.passed[Station.SPRING], ("q", "phi", "theta"))
        adjoint.add("phi", by["q"])
        adjoint.back("phi", self.passed[Station.GEAR], ("phi", "theta"))
        adjoint.back("torque", self.passed[Station.LOAD], ("torque", "theta"))
        if self.passed[Station.FLANGE]:
            adjoint.add("flange_load", adjoint.by["torque"] @ view.rest_load.by_flange(view.q))
            adjoint.back("flange_load", self.passed[Station.FLANGE], ())
        adjoint.add("theta", by["phi"] * self.slope[:, None])
        adjoint.back("theta", self.passed[Station.MOTOR], ("theta",))


def _joint_angles(view: View, layout: Layout, tangents: bool) -> _Joints | None:
    """Fills theta, phi, torque, q; what they have passed, if tangents are asked for."""
    rows, n = view.rows, view.axes
    view.signals["theta"] = motor_angles(view.robot, view.data)
    pass_station(view, layout, Station.MOTOR, "theta", False)
    declared, slope = declared_output_angle(view)
    view.signals["q"] = declared + view.robot.offsets
    view.signals["torque"] = np.zeros((rows, n))
    view.signals["flange_load"] = weighed(view.data)
    pass_station(view, layout, Station.FLANGE, "flange_load", False)
    view.rest_load = load = RestLoad.of(view.robot, view.data, view.threads, view.signals["flange_load"])
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
    return _joint_slopes(view, layout, declared, slope) if tangents else None


def _joint_slopes(view: View, layout: Layout, declared: np.ndarray, slope: np.ndarray) -> _Joints:
    """The stations once more at the fixed point. Its torque is an unknown: a unit of each joint's is passed
    along."""
    rows, n = view.rows, view.axes
    torque, q, axes = view.torque, view.q, np.arange(n)
    nothing, unit = np.zeros((rows, n, n)), np.tile(np.eye(n), (rows, 1, 1))
    tangents = view.tangents
    tangents |= {"theta": nothing, "torque": unit, "q": nothing, "phi": nothing}
    passed = {station: changes(view, layout, station)
              for station in (Station.MOTOR, Station.FLANGE, Station.LOAD)}
    view.signals["phi"] = declared
    passed[Station.GEAR] = pass_station(view, layout.held, Station.GEAR, "phi", True)
    deflection, give = declared_deflection(view.robot, view.torque)
    tangents["q"] = tangents["phi"].copy()
    tangents["q"][:, axes, axes] += give
    view.signals["q"] = view.phi + view.robot.offsets + deflection
    passed[Station.SPRING] = pass_station(view, layout.held, Station.SPRING, "q", True)
    view.signals["torque"], view.signals["q"] = torque, q
    view.signals["deflection_by_torque"] = tangents["q"].reshape(rows, -1)
    joints = _Joints(passed, slope, tangents["phi"], tangents["q"])
    view.tangents = {}
    return joints


def predict_target(view: View, layout: Layout, tangents: bool) -> PosePrediction:
    """From joint angles, and their tangents in the view, to the measured target: geometry, frames of each
    session, device."""
    prediction, adjoint = _target(view, layout, tangents)
    if adjoint is not None:
        for name, tangent in view.tangents.items():
            if name in adjoint.by:
                adjoint.jacobian += adjoint.by[name] @ tangent
        view.tangents = {"measured": adjoint.jacobian[:, :3]}
    return prediction


def _target(view: View, layout: Layout, tangents: bool) -> tuple[PosePrediction, Adjoint | None]:
    """The prediction, with the derivatives by what acts behind the joints; and those by the joints."""
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
        if not view.is_series:
            view.transfers = _transfers(view, view.target_by("q"))
    moves = pass_station(view, layout, Station.GEOMETRY, "displacement", tangents)
    if Station.LOAD in view.transfers and tangents:
        view.transfers[Station.FLANGE] = _flange_transfer(view, moves)
    moved = view.signals["displacement"]
    view.signals["measured"] = np.concatenate([position + moved[:, :3], moved[:, 3:]], axis=1)
    reads = pass_station(view, layout, Station.DEVICE, "measured", tangents)
    turned = view.measured[:, 3:]
    if np.any(turned):
        rotation = rotation_exp(turned) @ rotation
    prediction = PosePrediction(view.measured[:, :3], rotation, jacobian, view)
    if not tangents:
        return prediction, None
    adjoint = Adjoint(layout, jacobian, {"measured": np.tile(np.eye(6), (rows, 1, 1))})
    adjoint.back("measured", reads)
    adjoint.add("displacement", adjoint.by["measured"])
    adjoint.back("displacement", moves)
    adjoint.add("q", adjoint.by["displacement"] @ view.target_by("q"))
    return prediction, adjoint


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

    return {Station.MOTOR: motor, Station.GEAR: joint, Station.LOAD: load, Station.SPRING: joint,
            Station.GEOMETRY: geometry, Station.DEVICE: geometry}


def _flange_transfer(view: View, moves: Passed):
    """The same of what the flange carries: through springs of joints, and what else gives way under it."""
    def flange(columns, derivative):
        by_torque = view.rest_load.by_flange(view.q)[:, :, columns]
        out = view.transfers[Station.LOAD](tuple(range(view.axes)), by_torque @ derivative)
        for _, change in moves:
            if (slope := change.by_signal.get("flange_load")) is not None:
                out[:, list(change.columns)] += slope[:, :, columns] @ derivative
        return out

    return flange


def _placed(robot: Robot, layout: Layout, session: int) -> Robot:
    base, tool = robot.base, robot.tool
    for effect in layout.effects:
        base, tool = effect.place(session, base, tool)
    moved = base is not robot.base or tool is not robot.tool
    return replace(robot, base=base, tool=tool) if moved else robot
