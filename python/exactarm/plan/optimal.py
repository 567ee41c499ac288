"""Planning: a path of the flange -> the motor motion that puts it there (thesis (4.2), (4.3)).

Inverse kinematics on the accurate model, known functions along the reference (plan/compensation.py), then the
optimal control problem in the core. The result is checked with KKT errors that are computed outside the
solver. theta in rad at the motor; N knots, n axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from exactarm import _core
from exactarm.chain.extrapolation import extrapolations
from exactarm.chain.spring import spring_inverse
from exactarm.errors import ComputationError, InputError
from exactarm.plan.compensation import (
    PlanningModel,
    known_functions,
    moved_reference,
    planning_model,
    solver_springs,
)
from exactarm.plan.inverse_kinematics import inverse_kinematics
from exactarm.plan.limits import Violation, shortest_duration, violations
from exactarm.plan.path_file import NU, PlannedPath
from exactarm.plan.reference import Reference
from exactarm.robot.robot import Robot

LEAST_KNOTS = 12  # fewer leave no freedom between the two ends
ENERGY_SHARE = 0.99  # of the input, below the bandwidth
NO_INPUT_RAD_S2 = 1e-6  # output side: an axis below does not move
_OFF_PATH_M = 5e-5  # beyond what arms repeat to
_DISPLACEMENT_PASSES = 3
_MEMORY_PASSES = 3  # an effect that remembers the motor's way sees the motor that makes up for it


@dataclass(frozen=True)
class PlanOptions:
    """threads; start: joint angles near the first pose; iterations of the solver; bounds: keep to the robot's
    limits."""

    threads: int = 1
    start: np.ndarray | None = None
    iterations: int = 200
    bounds: bool = True


@dataclass(frozen=True)
class Solver:
    """How the solver ended. kkt_error: largest of the recomputed first-order errors of the scaled problem."""

    name: str
    linear_solver: str
    status: str
    iterations: int
    seconds: float
    kkt_error: float
    objective: float


@dataclass(frozen=True)
class Tracking:
    """Error of the flange and of the joints at the knots, on the planner's own model."""

    position_rms: float
    position_max: float
    joint_max: float


@dataclass(frozen=True)
class Plan:
    """The motor motion: time (N,), theta and its derivatives, q, q_desired (N, n), position (N, 3) of the
    flange."""

    path: PlannedPath
    reference: Reference
    time: np.ndarray
    theta: np.ndarray
    theta_dot: np.ndarray
    theta_ddot: np.ndarray
    theta_dddot: np.ndarray | None
    q: np.ndarray
    q_dot: np.ndarray
    q_desired: np.ndarray
    position: np.ndarray
    position_error: np.ndarray  # (N,) m
    solver: Solver
    tracking: Tracking
    bandwidth: tuple[float | None, ...]  # Hz; None for an axis that does not move
    violations: tuple[Violation, ...]  # of the reference, where the motors cannot follow it
    shortest_duration: float | None  # s, where there are violations of rate or acceleration
    compensated: tuple[str, ...]
    warnings: tuple[str, ...]


def plan_path(robot: Robot, path: PlannedPath, options: PlanOptions = PlanOptions()) -> Plan:
    """Plans one path. Raises ComputationError, with time and reason, where there is no motion."""
    model = planning_model(robot)
    reference = path.reference()
    if len(reference.time) < LEAST_KNOTS:
        raise InputError(f"the path has {len(reference.time)} samples, expected at least {LEAST_KNOTS}")
    joints, known, warnings = _joint_reference(model, reference, path, options)
    warnings = model.warnings + warnings + extrapolations(robot, joints, "samples")
    flat = _flat_motion(model, joints, known, reference.step)
    broken = violations(model.robot, reference.time, *flat[1:]) if options.bounds else ()
    fits = _fitting_duration(model, path, options) if broken else None
    if model.rigid:
        return _plan(model, path, reference, joints, known, _rigid_motion(joints, flat, reference.step),
                     broken, fits,
                     warnings)
    problem = _problem(model, path, reference.step, joints, known, options)
    motion = _core.plan_motion(model.core, problem, _solve_options(path, options))
    if motion.status not in ("solved", "acceptable"):
        raise ComputationError(_failure(motion, broken, fits))
    return _plan(model, path, reference, joints, known, motion, broken, fits, warnings)


def _joint_reference(model: PlanningModel, reference: Reference, path: PlannedPath, options: PlanOptions):
    """q_desired (N, n) and the known functions along it; displacements of the flange are aimed against."""
    found = inverse_kinematics(model.core, reference, options.start)
    along = lambda q, theta=None: known_functions(model, q, reference.step, path.gear_direction,
                                                  options.threads, theta)
    known = along(found.q)
    for _ in range(_DISPLACEMENT_PASSES if np.any(known.displacement) else 0):
        found = inverse_kinematics(model.core, moved_reference(reference, known.displacement), found.q[0])
        known = along(found.q)
    for _ in range(0 if all(effect.smooth for effect in model.effects) else _MEMORY_PASSES):
        known = along(found.q, _flat_motion(model, found.q, known, reference.step)[0])
    return found.q, known, found.warnings


@dataclass(frozen=True)
class _FlatSolution:
    """The answer for a rigid arm, in closed form, with the names of the core's motion."""

    q: np.ndarray
    q_dot: np.ndarray
    theta: np.ndarray
    theta_dot: np.ndarray
    theta_ddot: np.ndarray
    status: str = "solved"
    linear_solver: str = "closed form"
    iterations: int = 0
    seconds: float = 0.0
    kkt_error: float = 0.0
    objective: float = 0.0


def _rigid_motion(q: np.ndarray, flat: tuple[np.ndarray, ...], step: float) -> _FlatSolution:
    return _FlatSolution(q, np.gradient(q, step, axis=0), *flat)


def _problem(model, path, step, q_desired, known, options) -> _core.PlanProblem:
    problem = _core.PlanProblem(model.core)
    problem.springs = solver_springs(model, q_desired, step)
    problem.step, problem.weight, problem.input = step, path.nu, getattr(_core.PlanInput, path.input)
    problem.q_desired, problem.direction, problem.phi_shift = q_desired, known.direction, known.phi_shift
    if not options.bounds:
        _lift(problem)
    return problem


def _lift(problem: _core.PlanProblem) -> None:
    none, bounds = np.full(problem.q_desired.shape[1], np.inf), problem.bounds
    bounds.q_min = bounds.theta_min = -none
    bounds.q_max = bounds.theta_max = bounds.q_dot = none
    bounds.theta_dot = bounds.theta_ddot = bounds.theta_dddot = none


def _solve_options(path: PlannedPath, options: PlanOptions) -> _core.PlanOptions:
    core = _core.PlanOptions()
    core.method, core.linear_solver = getattr(_core.PlanMethod, path.solver), path.linear_solver
    core.threads, core.iterations = options.threads, options.iterations
    return core


def _flat_motion(model, q, known, step) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """theta, theta_dot, theta_ddot (N, n) that exact tracking needs."""
    robot = model.robot
    q_dot = np.gradient(q, step, axis=0)
    torque = _core.inverse_dynamics(robot.core, q, q_dot, np.gradient(q_dot, step, axis=0), 1)
    theta = np.empty_like(q)
    for i, spring in enumerate(solver_springs(model, q, step)):
        phi = q[:, i] - robot.offsets[i] - known.phi_shift[:, i] + _stretch(spring, torque[:, i])
        blend = known.direction[:, i]
        gear = robot.core.joints[i].gear
        cw, ccw = (_core.gear_motor_angle(gear.ratio, table, phi) for table in (gear.cw, gear.ccw))
        theta[:, i] = 0.5 * (1.0 - blend) * cw + 0.5 * (1.0 + blend) * ccw
    theta_dot = np.gradient(theta, step, axis=0)
    return theta, theta_dot, np.gradient(theta_dot, step, axis=0)


def _stretch(spring: _core.Spring, torque: np.ndarray) -> np.ndarray:
    return spring_inverse(spring.linear, spring.cubic, torque)[0]


def _fitting_duration(model: PlanningModel, path: PlannedPath, options: PlanOptions) -> float:
    """Shortest duration whose motor motion keeps to the limits."""
    def motion(duration: float):
        slower = path.lasting(duration)
        reference = slower.reference()
        joints, known, _ = _joint_reference(model, reference, slower, options)
        return _flat_motion(model, joints, known, reference.step)[1:]

    return shortest_duration(model.robot, path.duration, motion)


def _failure(motion: _core.PlanMotion, broken: tuple[Violation, ...], fits: float | None) -> str:
    if not broken:
        return f"the solver ended with status {motion.status}: {motion.message}"
    line = (
        f"{motion.status}: no motion within the limits" if motion.status == "infeasible"
        else f"the solver ended with status {motion.status}"
    )
    line += "; " + "; ".join(str(violation) for violation in broken)
    return line + (f"; the shortest duration that fits is {fits:.3f} s" if fits else "")


def _plan(model, path, reference, q_desired, known, motion, broken, fits, warnings) -> Plan:
    position, rotation = _core.forward_kinematics(model.core, motion.q)
    moved = position + known.displacement[:, :3]
    error = np.linalg.norm(moved - reference.position, axis=1)
    solver = Solver(path.solver, motion.linear_solver, motion.status, motion.iterations, motion.seconds,
                    motion.kkt_error, motion.objective)
    tracking = Tracking(float(np.sqrt(np.mean(error**2))), float(error.max()),
                        float(np.abs(motion.q - q_desired).max()))
    if broken:
        warnings += tuple(f"the reference is faster than the drives: {violation}" for violation in broken)
        warnings += (f"the shortest duration that fits is {fits:.3f} s",) if fits else ()
    if tracking.position_max > _OFF_PATH_M and not broken:
        warnings += (f"the flange misses the path by up to {1e3 * tracking.position_max:.2g} mm: nu "
                     f"{path.nu:g} weighs smooth motors against it; the default is {NU:g}",)
    if motion.status == "acceptable":
        warnings += ("the solver stopped at its acceptable level",)
    return Plan(
        path, reference, reference.time, motion.theta, motion.theta_dot, motion.theta_ddot,
        motion.theta_dddot if path.input == "jerk" and not model.rigid else None, motion.q, motion.q_dot,
        q_desired, moved, error,
        solver, tracking, bandwidth(motion.theta_ddot / model.robot.ratios, reference.step), broken, fits,
        tuple(effect.label for effect in model.effects), warnings,
    )


def bandwidth(acceleration: np.ndarray, step: float) -> tuple[float | None, ...]:
    """Per axis the frequency (Hz) below which ENERGY_SHARE of the energy of the acceleration (N, n) lies."""
    frequency = np.fft.rfftfreq(len(acceleration), step)
    found: list[float | None] = []
    for column in acceleration.T:
        if np.abs(column).max() < NO_INPUT_RAD_S2:
            found.append(None)
            continue
        energy = np.cumsum(np.abs(np.fft.rfft(column)) ** 2)
        found.append(float(frequency[np.searchsorted(energy, ENERGY_SHARE * energy[-1])]))
    return tuple(found)
