"""The controller's own chain: what it takes for the pose of joint angles, and which joint angles it takes for
a pose.

Frames from `[controller]` of the robot file, in the controller's base frame, to its flange. Joint angles are
those that the controller reports: offsets and gears do not enter. A coupling that the robot file declares, as
of a parallelogram, is the maker's: the controller knows it. One that was found in data it does not know.

    joints = C q + s,   C (n, n): 1 but for declared couplings, which count from the motors' zeros: s (n,)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from exactarm import _core
from exactarm.chain import Layout, predict_poses
from exactarm.compensate.flange_poses import Poses, pose_error, pseudo_inverse
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES
from exactarm.effects.base import Effect
from exactarm.errors import InputError
from exactarm.robot.robot import Robot, frame_of

STEPS = 8  # from an error of 1e-3 rad, the Jacobian of the start for all
SETTLED_RAD = 1e-13  # of a step: what the next ones would add are the last bits
SAME_BRANCH_RAD = 1.0  # two branches of an arm differ by more in one axis, unless it is close to singular
_TURN = 2.0 * np.pi
ANYWHERE = _core.InverseKinematicsOptions()
ANYWHERE.check_limits, ANYWHERE.largest_jump = False, np.inf
ONE_BY_ONE = _core.InverseKinematicsOptions()
ONE_BY_ONE.check_limits, ONE_BY_ONE.extrapolate = False, False
ONE_BY_ONE.largest_jump = np.nextafter(SAME_BRANCH_RAD, 0.0)  # less than it
SOLVED = _core.InverseKinematicsStatus.solved
_CALIBRATING = ("calibrate", "diagnose")  # commands that change frames


@dataclass(frozen=True)
class ControllerChain:
    """The core robot of the controller's frames; limits (2, n): least and largest angle of the joints,
    infinite where none is declared; turns, shift: C (n, n), s (n,)."""

    core: _core.Robot
    limits: np.ndarray
    turns: np.ndarray
    shift: np.ndarray

    @staticmethod
    def of(robot: Robot) -> ControllerChain:
        """Raises InputError where a calibration has changed the frames and the controller's are not on
        record.

        In a file that no calibration has changed, the declared frames are the controller's.
        """
        frames = robot.controller.frames or robot.joints
        if not robot.controller.frames and _calibrated(robot.record):
            raise InputError(
                f"robot {robot.name}: the frames that its controller works with are not on record; give the "
                "robot file from "
                "before the calibration: --nominal ROBOT (new robot files of calibrate and diagnose hold "
                "them)"
            )
        joints = tuple(
            replace(frame_of(frame), q_min=joint.q_min, q_max=joint.q_max)
            for frame, joint in zip(frames, robot.joints)
        )
        own = replace(
            robot,
            joints=joints,
            links=None,
            effects=(),
            base=robot.controller.base,
            tool=robot.controller.flange,
        )
        least = [-np.inf if joint.q_min is None else joint.q_min for joint in robot.joints]
        largest = [np.inf if joint.q_max is None else joint.q_max for joint in robot.joints]
        return ControllerChain(own.core, np.array([least, largest]), *_turns(robot, own))

    @cached_property
    def plain(self) -> bool:
        """Whether no axis turns another one."""
        return bool(np.array_equal(self.turns, np.eye(len(self.turns))) and not self.shift.any())

    def turned(self, q: np.ndarray) -> np.ndarray:
        """Angles of the joints, by the controller, for those of its axes (..., n)."""
        return q if self.plain else q @ self.turns.T + self.shift

    def unturned(self, joints: np.ndarray) -> np.ndarray:
        """The inverse of `turned`."""
        return joints if self.plain else np.linalg.solve(self.turns, (joints - self.shift)[..., None])[..., 0]

    def jacobian(self, q: np.ndarray, threads: int = 1) -> np.ndarray:
        """(N, 6, n) of the flange by the angles (N, n) of the controller's axes."""
        return _core.geometric_jacobian(self.core, self.turned(q), threads) @ self.turns

    def poses(self, q: np.ndarray) -> Poses:
        """Of the flange, for joint angles (N, n)."""
        return Poses(*_core.forward_kinematics(self.core, self.turned(q)))

    def joints(self, targets: Poses, near: np.ndarray) -> np.ndarray:
        """Joint angles (N, n) of poses close to those of `near` (N, n)."""
        q = np.array(near, dtype=float)
        inverse = pseudo_inverse(self.jacobian(q))
        for _ in range(STEPS):
            step = (inverse @ pose_error(targets, self.poses(q))[:, :, None])[:, :, 0]
            q = q + step
            if not np.any(np.abs(step) > SETTLED_RAD):
                break
        return q

    def newton(self, position: np.ndarray, rotation: np.ndarray, start: np.ndarray) -> np.ndarray | None:
        """Joint angles of one pose from a start that may be far; None where Newton's method does not come
        there."""
        q, report = _core.inverse_kinematics_path(
            self.core, position[None], rotation.reshape(1, 9), self.turned(start), ANYWHERE
        )
        return self.unturned(q[0]) if report.status == SOLVED else None

    def followed(self, targets: Poses, start: np.ndarray) -> np.ndarray:
        """What `newton` finds for each pose from the one before, (K, n): all, or those before the first that
        it does not find, or finds on another branch. Empty where axes turn each other: `nearest` is asked."""
        if not self.plain or not len(targets):
            return np.empty((0, self.core.axes))
        q, report = _core.inverse_kinematics_path(
            self.core, targets.position, targets.rotation.reshape(-1, 9), start, ONE_BY_ONE)
        found = q if report.status == SOLVED else q[: report.index]
        return found if len(found) and np.abs(found[0] - start).max() < SAME_BRANCH_RAD else q[:0]

    def branches(self, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """(K, n) all joint angles of one pose within the limits, whole turns included."""
        options = _core.InverseKinematicsOptions()
        options.check_limits = False
        found = _core.inverse_kinematics_branches(self.core, _core.Pose(rotation, position), options)
        low, high = self.limits
        turned = []
        for q in found:
            choices = [
                [angle + k * _TURN for k in (-2, -1, 0, 1, 2) if a - 1e-9 <= angle + k * _TURN <= b + 1e-9]
                if np.isfinite(b - a)
                else [angle]
                for angle, a, b in zip(q, low, high)
            ]
            turned += [self.unturned(np.array(choice)) for choice in product(*choices)]
        return np.array(turned).reshape(-1, len(low))

    def nearest_path(self, targets: Poses, start: np.ndarray | None) -> np.ndarray:
        """Joint angles (N, n) of poses, each on the branch nearest to the one before; NaN where there are
        none.

        Without a start the first is the branch nearest to the middle of the joint limits.
        """
        rows = np.full((len(targets), self.core.axes), np.nan)
        for i, (position, rotation) in enumerate(zip(targets.position, targets.rotation)):
            found = self.nearest(position, rotation, start)
            if found is not None:
                rows[i] = start = found
        return rows

    def nearest(
        self, position: np.ndarray, rotation: np.ndarray, start: np.ndarray | None
    ) -> np.ndarray | None:
        """Joint angles of one pose nearest to `start`; nearest to the middle of the limits without one."""
        if start is not None:
            near = self.newton(position, rotation, start)
            if near is not None and max(map(abs, (near - start).tolist())) < SAME_BRANCH_RAD:
                return near
        found = self.branches(position, rotation)
        if not len(found):
            return None
        low, high = self.limits
        middle = self.unturned(np.where(np.isfinite(high - low), 0.5 * (low + high), 0.0))
        return found[np.argmin(np.linalg.norm(found - (middle if start is None else start), axis=1))]


def _turns(robot: Robot, own: Robot) -> tuple[np.ndarray, np.ndarray]:
    """C (n, n) and s (n,) of the effects that are `by_design` and were not estimated; they are linear."""
    def estimated(effect: Effect) -> bool:
        bounds = [robot.intervals.get(effect.parameter_label(p), (0.0, 0.0)) for p in effect.parameters()]
        return any(low < high for low, high in bounds)

    known = tuple(effect for effect in robot.effects if effect.by_design and not estimated(effect))
    q = np.vstack([np.zeros(robot.axes), np.eye(robot.axes)])
    if not known:
        return q[1:], q[0]
    rows = Dataset.of_arrays(POSES.name, {"q": q})
    joints = tuple(replace(joint, q_offset=float(offset), controller_offset=float(offset))
                   for joint, offset in zip(own.joints, robot.controller_offsets))
    layout = Layout.of(known, estimate=False)
    found = predict_poses(replace(own, joints=joints), layout, rows, tangents=False).view.q
    return (found[1:] - found[0]).T, found[0]


def _calibrated(record: Mapping[str, Any]) -> bool:
    """Whether a calibration wrote the file, or one that it came from."""
    earlier = record.get("previous")
    return record.get("command") in _CALIBRATING or (isinstance(earlier, Mapping) and _calibrated(earlier))
