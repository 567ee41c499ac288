"""What the planner knows of the robot beyond the tables of the solver: effects and gear directions along a
reference.

Every effect of the robot that is `compensable` enters. What lives in tables (`bake`: payload, gear ratio,
geometry) goes into the tables; every other change is evaluated along the reference and enters the equation of
motion as a known function of time, a shift of the gear's output angle,
    phi + q_offset + phi_shift - q = kappa^{-1}(torque),
    phi_shift = gear + spring - kappa^{-1} by the load's change
exact but for the tracking error (about 1e-7 rad). A displacement of the flange moves the desired pose the
other way.

The gear's table is the one of the direction in which the axis moves along the reference, and passes into the
other's at a reversal as chain/direction.py says: never a jump in the motor angle. Effects see that direction
too; what else jumps in them (a flank that changes with the load) is eased with the same kernel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.chain import Layout
from exactarm.chain.direction import direction_of_motion, eased
from exactarm.chain.spring import declared_deflection
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import TRACKED_MOTION
from exactarm.effects.base import Effect, Station
from exactarm.numerics.rotation import exp as rotation_exp
from exactarm.plan.reference import Reference
from exactarm.robot.controller_frames import at_flange
from exactarm.robot.robot import Link, Robot
from exactarm.view import View

# stiffness for a rigid joint, in inertias per square sample; its deflection is taken out again
RIGID_SHARE = 100.0


@dataclass(frozen=True)
class PlanningModel:
    """The robot as the planner sees it, from the controller's base to its flange; which effects enter, what
    is left out.

    `rigid`: no masses are declared or no joint has a spring, so that the motors follow from q alone.
    """

    robot: Robot
    effects: tuple[Effect, ...]
    rigid: bool
    warnings: tuple[str, ...]

    @property
    def core(self) -> _core.Robot:
        return self.robot.core


def planning_model(robot: Robot) -> PlanningModel:
    """Tables with the compensable effects baked in; rigid joints and absent masses replaced and told."""
    used = tuple(effect for effect in robot.effects if effect.compensable)
    left_out = [effect.where_unknown for effect in robot.effects
                if not effect.compensable and not effect.record]
    warnings = [f"not compensated, because no plan can: {', '.join(left_out)}"] if left_out else []
    baked = Layout.of(used, estimate=False).baked(robot)
    if baked.links is None:
        warnings.append("no link masses are declared: planned without dynamics and deflection")
        baked = replace(baked, links=(Link(0.0, np.zeros(3), np.zeros((3, 3))),) * baked.axes)
    rigid = (
        robot.links is None or robot.generic_masses or not any(joint.spring_linear for joint in baked.joints)
    )
    joints = tuple(_with_both_tables(joint) for joint in baked.joints)
    baked = replace(at_flange(baked), joints=joints, effects=())
    return PlanningModel(baked, used, rigid, tuple(warnings))


def _with_both_tables(joint):
    return replace(joint, cw=joint.cw or joint.ccw, ccw=joint.ccw or joint.cw)


@dataclass(frozen=True)
class KnownFunctions:
    """Along a reference: direction (N, n) between the gear tables, shift of the output angle (N, n),
    displacement (N, 6) of the flange."""

    direction: np.ndarray
    phi_shift: np.ndarray
    displacement: np.ndarray


def known_functions(
    model: PlanningModel, q: np.ndarray, step: float, gear_direction: str, threads: int,
    theta: np.ndarray | None = None
) -> KnownFunctions:
    """Evaluated where the links follow q (N, n), sampled at equal steps; theta (N, n): the motors, where
    known already."""
    robot = model.robot
    direction = direction_of_motion(step * np.arange(len(q)), q * np.sign(robot.ratios))
    view = _view(model, q, step, direction, theta, threads)
    shift, displacement = np.zeros_like(q), np.zeros((len(q), 6))
    torque = view.torque.copy()
    for effect in sorted(model.effects, key=lambda effect: effect.station):
        change = effect.change(view)
        value = change.value if effect.smooth else eased(change.value, step)
        columns = list(change.columns)
        if effect.station in (Station.GEAR, Station.SPRING):
            shift[:, columns] += value
        elif effect.station == Station.LOAD:
            torque[:, columns] += value
        elif effect.station == Station.GEOMETRY:
            displacement[:, columns] += value
    shift += declared_deflection(robot, torque)[0] - declared_deflection(robot, view.torque)[0]
    springs = solver_springs(model, q, step)
    for i, joint in enumerate(robot.joints):
        if not joint.spring_linear:
            shift[:, i] += view.torque[:, i] / springs[i].linear
    if gear_direction != "motion":
        direction = np.full_like(q, -1.0 if gear_direction == "cw" else 1.0)
    return KnownFunctions(direction, shift, displacement)


def solver_springs(model: PlanningModel, q: np.ndarray, step: float) -> list[_core.Spring]:
    """The declared springs, and for a rigid joint one that is stiff against the samples."""
    inertia = _core.mass_matrix(model.core, q[:: max(len(q) // 20, 1)], 1)
    springs = []
    for i, joint in enumerate(model.robot.joints):
        stiff = RIGID_SHARE * max(float(inertia[:, i, i].max()), 1e-3) / step**2
        linear, cubic = (joint.spring_linear, joint.spring_cubic) if joint.spring_linear else (stiff, 0.0)
        springs.append(_core.Spring(linear, cubic))
    return springs


def moved_reference(reference: Reference, displacement: np.ndarray) -> Reference:
    """Where the undisturbed arm must aim, so that the displaced flange meets the reference."""
    rotation = np.swapaxes(rotation_exp(displacement[:, 3:]), -1, -2) @ reference.rotation
    return replace(reference, position=reference.position - displacement[:, :3], rotation=rotation)


def _view(
    model: PlanningModel, q: np.ndarray, step: float, direction: np.ndarray, theta: np.ndarray | None,
    threads: int
) -> View:
    """The chain's signals along the reference."""
    robot = model.robot
    q_dot = np.gradient(q, step, axis=0)
    q_ddot = np.gradient(q_dot, step, axis=0)
    torque = _core.inverse_dynamics(robot.core, q, q_dot, q_ddot, threads)
    phi = q - robot.offsets - declared_deflection(robot, torque)[0]
    theta = phi * robot.ratios if theta is None else theta
    time = step * np.arange(len(q))
    data = Dataset.of_arrays(TRACKED_MOTION.name, {"theta": theta}, time=time)
    rows = len(q)
    position, rotation = _core.forward_kinematics(robot.core, q, threads)
    signals = {
        "theta": theta, "theta_dot": q_dot * robot.ratios, "theta_ddot": q_ddot * robot.ratios, "phi": phi,
        "phi_dot": q_dot, "torque": torque, "q": q, "q_dot": q_dot, "q_ddot": q_ddot, "direction": direction,
        "base_position": np.tile(robot.base.position, (rows, 1)),
        "base_rotation": np.tile(robot.base.rotation.ravel(), (rows, 1)),
        "displacement": np.zeros((rows, 6)), "target": position, "target_rotation": rotation.reshape(rows, 9),
    }
    return View(robot, data, TRACKED_MOTION.name, threads, signals=signals)
