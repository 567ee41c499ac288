"""The command that reaches a target on the identified model, and its inverse.

    q <- q + (J M)^+ e(q),   e = (p* - p(q), log(R* R(q)')),   p, R = T_actual(q, approach)

J: of the arm; M (n, n): how its joints turn with the axes that are commanded, 1 but for gears and couplings.
A coupled wrist may turn an axis as far as its own motor does: first the joints go to the angles meant.
The first steps keep the Jacobian of the start: the deviations are about 1e-3 of the arm, so each gains three
digits. T_actual is the chain at rest (chain/poses.py) with every compensable effect of the robot file:
geometry, gear tables of the
direction from which each axis comes, springs under the load of the tool.
Targets of N rows, n axes; m, rad; poses are those of the controller's flange in the controller's base frame.
A joint target stands for the pose that the controller's own chain has there.
Olabi et al., Robotics and CIM 26 (2010), mirror the targets of a program in this way, one step of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.chain import Layout, PosePrediction, predict_poses
from exactarm.chain.motion import transmission
from exactarm.compensate.controller import ControllerChain
from exactarm.compensate.flange_poses import Poses, missing, pose_error, pseudo_inverse, unreached
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.effects.base import Effect
from exactarm.effects.payload import Payload
from exactarm.errors import InputError
from exactarm.robot.mdh_frames import compose
from exactarm.robot.robot import Placement, Robot
from exactarm.robot_file import AnyRobot, robot_of

STEPS = (
    8  # three gain nine digits of a millimetre; more close to a singular pose, or where a flank changes side
)
FAR_RAD = 0.1  # of a joint from where it was meant: a coupling; gears and springs deviate by less than 0.02
SAME_JACOBIAN = 3  # steps with the Jacobian of the start
NOT_REACHED = 1e-8  # m and rad left over: a thousandth of what a program has to hold
REACHED = 1e-10  # m and rad: a hundredth of the last digit that any program carries
# Frobenius norm of J^-1 (rad per m or rad): 1 mrad, the orientation error of an arm as delivered, turns an
# axis by 0.1 rad.
NEAR_SINGULAR = 100.0
# a correction that turns an axis further changes the branch, or the model is not this arm's
LARGEST_TURN_RAD = 0.2


@dataclass(frozen=True)
class Commands:
    """Joint angles q (N, n) to command, the error left (N,) m and rad (of fewer than six axes: of the place,
    m), the norm (N,) of J^-1, and the largest turn (N,) of an axis from where the search began."""

    q: np.ndarray
    left_over: np.ndarray
    amplification: np.ndarray
    turned: np.ndarray


@dataclass(frozen=True)
class CompensationModel:
    """actual: the identified robot, placed so that its target is the controller's flange in the controller's
    base frame; controller: its own chain; layout: the effects that enter; left_out: what no program can
    compensate."""

    actual: Robot
    controller: ControllerChain
    layout: Layout
    left_out: tuple[Effect, ...]

    @staticmethod
    def of(
        robot: Robot, base: Placement = Placement(), flange: Placement = Placement()
    ) -> CompensationModel:
        """base: the model's base in the controller's; flange: the controller's in the model's
        (compensate/frames.py)."""
        chain = ControllerChain.of(robot)
        standing = [effect for effect in robot.effects if not effect.record]
        used = tuple(effect for effect in standing if effect.compensable and effect.at_rest)
        left_out = tuple(effect for effect in standing if effect not in used)
        place, end = compose(base, robot.controller.base), compose(robot.controller.flange, flange)
        actual = replace(robot, base=place, tool=end, effects=used)
        return CompensationModel(actual, chain, Layout.of(used, estimate=False), left_out)

    def with_load(self, mass: float, centre: np.ndarray) -> CompensationModel:
        """The same with another load at the flange: kg, and its centre (3,) m in the controller's flange
        frame."""
        flange = self.actual.controller.flange
        moment = mass * (flange.rotation @ centre + flange.position)
        others = tuple(effect for effect in self.layout.effects if not effect.carried)
        effects = (*others, Payload(None, (mass, *map(float, moment))))
        return replace(
            self, actual=replace(self.actual, effects=effects), layout=Layout.of(effects, estimate=False)
        )

    def reached(self, q: np.ndarray, approach: np.ndarray | None = None, threads: int = 1) -> Poses:
        """Where the flange really goes: q (N, n) as commanded, approach (N, n) from -1 to 1 in the motors'
        sense."""
        prediction = self.prediction(q, approach, threads)
        return Poses(prediction.position, prediction.rotation)

    def prediction(self, q: np.ndarray, approach: np.ndarray | None = None,
                   threads: int = 1) -> PosePrediction:
        """The chain at q (N, n) as commanded, with the angles of the joints in its view."""
        joints = {"q": q} if approach is None else {"q": q, "approach": approach}
        data = Dataset.of_arrays(POSES.name, joints)
        return predict_poses(self.actual, self.layout, data, tangents=False, threads=threads)

    def _turned(self, prediction: PosePrediction) -> np.ndarray:
        """M (N, n, n)."""
        turned: np.ndarray = transmission(prediction.view, self.layout) * self.actual.controller_ratios
        return turned

    def _inverse(self, prediction: PosePrediction, threads: int) -> np.ndarray:
        """(J M)^+ (N, n, 6)."""
        jacobian = _core.geometric_jacobian(self.actual.core, prediction.view.q, threads)
        return pseudo_inverse(jacobian @ self._turned(prediction))

    def _started(self, near: np.ndarray, approach: np.ndarray,
                 threads: int) -> tuple[np.ndarray, PosePrediction]:
        """Commands (N, n) that bring the joints to about `near`, where couplings turn them far from it; and
        the chain there."""
        prediction = self.prediction(near, approach, threads)
        missed = self.controller.turned(near) - prediction.view.q
        far = np.abs(missed).max(axis=1) > FAR_RAD
        q = np.array(near, dtype=float)
        if far.any():
            q[far] += np.linalg.solve(self._turned(prediction)[far], missed[far, :, None])[:, :, 0]
            prediction = self.prediction(q, approach, threads)
        return q, prediction

    def commands(
        self, targets: Poses, near: np.ndarray, approach: np.ndarray | None = None, threads: int = 1
    ) -> Commands:
        """The joint angles that reach the targets, started from `near` (N, n): those by the controller's
        chain."""
        side = np.zeros_like(near, dtype=float) if approach is None else approach
        q, there = self._started(np.asarray(near, float), side, threads)
        inverse = self._inverse(there, threads)
        amplification = np.linalg.norm(inverse, axis=(1, 2))
        error = pose_error(targets, Poses(there.position, there.rotation))
        axes, begun = q.shape[1], q.copy()
        left_over = missing(error, axes)
        for step in range(STEPS):
            rows = np.flatnonzero((left_over > REACHED) & np.isfinite(amplification))
            if not rows.size:
                break
            if step >= SAME_JACOBIAN:
                inverse[rows] = self._inverse(self.prediction(q[rows], side[rows], threads), threads)
            trial = q[rows] + (inverse[rows] @ error[rows, :, None])[:, :, 0]
            left = pose_error(targets.rows(rows), self.reached(trial, side[rows], threads))
            better = missing(left, axes) < left_over[rows]
            rows = rows[better]
            q[rows], error[rows] = trial[better], left[better]
            left_over[rows] = missing(left[better], axes)
        return Commands(q, unreached(error, axes), amplification, np.abs(q - begun).max(axis=1, initial=0.0))


def command_of(
    robot: AnyRobot,
    targets: np.ndarray | Poses,
    near: np.ndarray | None = None,
    approach: np.ndarray | None = None,
    threads: int = 1,
) -> np.ndarray:
    """Joint angles (N, n) to command so that the real arm reaches the targets.

    targets: joint angles (N, n) as a planner means them (the pose of the controller's own chain), or Poses
    with `near` (N, n) beside them, angles on the branch that is wanted. approach (N, n): as each axis comes
    to its target. NaN in rows that no command within the limits of the axes reaches, or only one that turns
    an axis by LARGEST_TURN_RAD and more, as at a singular pose.
    """
    model = CompensationModel.of(robot_of(robot))
    if isinstance(targets, Poses):
        if near is None:
            near = model.controller.nearest_path(targets, None)
        found = np.full(np.shape(near), np.nan)
        rows = np.flatnonzero(np.isfinite(near).all(axis=1))
        poses, start = targets.rows(rows), np.asarray(near, float)[rows]
    else:
        start = _rows(model, targets, "targets")
        found, rows = np.full(start.shape, np.nan), np.arange(len(start))
        poses = model.controller.poses(start)
    side = None if approach is None else _rows(model, approach, "approach", len(found))[rows]
    commands = model.commands(poses, start, side, threads)
    low, high = model.controller.limits
    good = (commands.left_over < NOT_REACHED) & (commands.turned < LARGEST_TURN_RAD)
    good &= np.all((commands.q >= low) & (commands.q <= high), axis=1)
    found[rows] = np.where(good[:, None], commands.q, np.nan)
    return found


def _rows(model: CompensationModel, values: np.ndarray, name: str, count: int | None = None) -> np.ndarray:
    """Angles, or what stands beside them, of each axis."""
    try:
        rows = np.asarray(values, float)
    except (TypeError, ValueError):
        rows = np.empty(0)
    n = model.actual.axes
    if rows.ndim != 2 or rows.shape[1] != n or count not in (None, len(rows)) or not np.isfinite(rows).all():
        shape = f"({'N' if count is None else count}, {n})"
        raise InputError(f"{name}: expected an array {shape} of finite numbers, found shape "
                         f"{np.shape(values)}")
    return rows


def actual_of(
    robot: AnyRobot, joints: np.ndarray, approach: np.ndarray | None = None, threads: int = 1
) -> np.ndarray:
    """The inverse of `command_of`: joint angles (N, n) at which a planner should see an arm whose encoders
    say `joints`.

    The controller's own chain has there the pose in which the real arm stands. NaN in rows where it has that
    pose nowhere near by, as at a singular pose.
    """
    model = CompensationModel.of(robot_of(robot))
    joints = _rows(model, joints, "joints")
    side = None if approach is None else _rows(model, approach, "approach", len(joints))
    there = model.prediction(joints, side, threads)
    near, real = model.controller.unturned(there.view.q), Poses(there.position, there.rotation)
    found = model.controller.joints(real, near)
    left_over = unreached(pose_error(real, model.controller.poses(found)), model.actual.axes)
    good = (left_over < NOT_REACHED) & (np.abs(found - near).max(axis=1, initial=0.0) < LARGEST_TURN_RAD)
    return np.where(good[:, None], found, np.nan)
