"""What stands for the controller's base and flange on the identified chain: the gauge that no calibration can
know.

    p = B A(q) F      A: the identified chain, B: its base in the controller's base frame, F: the controller's
                      flange on its last frame

A calibration finds base and tool together with the geometry; a shift of the first frames and one of the base
look the same.
    nominal      B = F = 1: the first and the last frame are where the tables have them
    identified   B, F by which the identified chain comes closest to the nominal one over the work space: as
                 if base and tool had been measured with the robot before its calibration
    points       B and a shift of F by reference points in the cell: least squares, with a prior of a few mm
                 and mrad
Only reference points remove the gauge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from exactarm.compensate.flange_poses import Poses, pose_error
from exactarm.compensate.law import CompensationModel
from exactarm.data.dataset import read_dataset
from exactarm.data.kinds import POSES
from exactarm.errors import InputError
from exactarm.files.memory_table import AnyFile, MemoryTable
from exactarm.numerics.factors import lstsq, svd
from exactarm.numerics.rotation import exp, log, skew
from exactarm.robot.robot import Placement, Robot

SAMPLES, SEED, STEPS = 200, 1, 6
LEVER_M = 0.2  # an orientation error counts as the shift of a tool of that length
TOUCHED_M = 5e-5  # a reference point is touched, or a reflector measured, to about that
PLAUSIBLE_M, PLAUSIBLE_RAD = 5e-3, 5e-3  # how far base and flange may be from where the tables have them
LEAST_POINTS = 3
# of the work space's size: `deviated` arms of the five shipped drawings are off by at most 0.006, by 0.02 at
# three times the usual deviations, arms against another's drawing by 0.87 and more
OTHER_ARM = 0.05
MISSED_M = 5e-4  # a point that lies further off after the fit does not belong to this model


@dataclass(frozen=True)
class CellFrames:
    """base: B, flange: F; choice: one sentence for the reader; warnings."""

    base: Placement
    flange: Placement
    choice: str
    warnings: tuple[str, ...] = ()


def cell_frames(robot: Robot, choice: AnyFile, tip: Placement, threads: int = 1) -> CellFrames:
    """choice: "nominal", "identified" or a table of points; tip: of the tool that touched them, in the
    flange."""
    if choice == "nominal":
        return CellFrames(
            Placement(),
            Placement(),
            (
                "Base and flange are the first and the last frame of the identified model (--frames "
                "nominal). Where the calibrated frames have shifted against the true base, all targets are "
                "off alike; reference points in the cell remove it (--frames POINTS.csv)."
            ),
        )
    if choice == "identified":
        base, flange = _closest(robot, threads)
        shift, turn = 1e3 * np.linalg.norm(base.position), 1e3 * np.linalg.norm(log(base.rotation))
        return CellFrames(
            base,
            flange,
            (
                "Base and flange are where the identified model comes closest to the nominal one over the "
                "work space (--frames "
                f"identified): the base moves by {shift:.3f} mm and {turn:.3f} mrad. Reference points would "
                "tell more (--frames POINTS.csv)."
            ),
        )
    return _by_points(robot, choice if isinstance(choice, MemoryTable) else Path(choice), tip, threads)


def _drawn(robot: Robot, threads: int) -> tuple[Poses, Poses]:
    """Poses over the work space, by the controller's chain and by the identified one."""
    model = CompensationModel.of(robot)
    low, high = model.controller.limits
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    q = np.random.default_rng(SEED).uniform(low, high, (SAMPLES, model.actual.axes))
    return model.controller.poses(q), model.reached(q, threads=threads)


def _closest(robot: Robot, threads: int) -> tuple[Placement, Placement]:
    wanted, reached = _drawn(robot, threads)
    base, flange = Placement(), Placement()
    for _ in range(STEPS):
        placed = _placed(reached, base, flange)
        error = pose_error(wanted, placed)
        jacobian = np.zeros((SAMPLES, 6, 12))
        jacobian[:, :3, :3] = jacobian[:, 3:, 3:6] = np.eye(3)
        jacobian[:, :3, 3:6] = -skew(placed.position)
        jacobian[:, :3, 6:9] = jacobian[:, 3:, 9:] = placed.rotation
        error[:, 3:] *= LEVER_M
        jacobian[:, 3:] *= LEVER_M
        step = lstsq(jacobian.reshape(-1, 12), error.ravel(), rcond=1e-10)[0]
        base = Placement(exp(step[3:6]) @ base.rotation, exp(step[3:6]) @ base.position + step[:3])
        flange = Placement(flange.rotation @ exp(step[9:]), flange.position + flange.rotation @ step[6:9])
    return base, flange


def _by_points(robot: Robot, path: Path | MemoryTable, tip: Placement, threads: int) -> CellFrames:
    data = read_dataset(path, robot, POSES.name)
    if (
        len(data) < LEAST_POINTS
        or svd(data.position - data.position.mean(0), compute_uv=False)[1] < 1e-2
    ):
        raise InputError(
            f"expected at least {LEAST_POINTS} reference points that lie not on one line", file=path
        )
    model = CompensationModel.of(robot)
    q = (
        data.joints["q"]
        if "q" in data.joints
        else data.joints["theta"] / robot.controller_ratios + robot.controller_offsets
    )
    reached = model.reached(q, data.joints.get("approach"), threads)
    prior = np.repeat([TOUCHED_M / PLAUSIBLE_M, TOUCHED_M / PLAUSIBLE_RAD, TOUCHED_M / PLAUSIBLE_M], 3)
    x = np.zeros(9)  # shift and turn of the base, shift of the flange
    for _ in range(STEPS):
        base, arm = Placement(exp(x[3:6]), x[:3]), tip.position + x[6:]
        turned = base.rotation @ reached.rotation
        from_base = (reached.position + reached.rotation @ arm) @ base.rotation.T
        error = data.position - from_base - base.position
        jacobian = np.zeros((len(data), 3, 9))
        jacobian[:, :, :3], jacobian[:, :, 3:6], jacobian[:, :, 6:] = np.eye(3), -skew(from_base), turned
        rows = np.concatenate([jacobian.reshape(-1, 9), np.diag(prior)])
        x = x + lstsq(rows, np.concatenate([error.ravel(), -prior * x]), rcond=None)[0]
    missed = np.linalg.norm(error, axis=1)
    if np.linalg.norm(x[:3]) > 10 * PLAUSIBLE_M or np.linalg.norm(x[3:6]) > 10 * PLAUSIBLE_RAD:
        raise InputError(
            f"the points lie {1e3 * np.linalg.norm(x[:3]):.1f} mm and {1e3 * np.linalg.norm(x[3:6]):.1f} "
            "mrad off this robot's base; expected "
            "them in the controller's base frame, touched with the tool of --tool (the flange without one)",
            file=path,
        )
    warnings = tuple(f"{path.name}: {note}" for note in data.notes)
    if missed.max() > MISSED_M:
        warnings += (f"{path.name}: a reference point is {1e3 * missed.max():.2f} mm off after the fit",)
    choice = (
        f"Base and flange by {len(data)} reference points of {path.name}: the base moves by "
        f"{1e3 * np.linalg.norm(x[:3]):.3f} mm and "
        f"{1e3 * np.linalg.norm(x[3:6]):.3f} mrad, the flange by {1e3 * np.linalg.norm(x[6:]):.3f} mm; the "
        "points are met within "
        f"{1e3 * np.sqrt(np.mean(missed**2)):.3f} mm (RMS)."
    )
    return CellFrames(Placement(exp(x[3:6]), x[:3]), Placement(np.eye(3), x[6:]), choice, warnings)


def _placed(poses: Poses, base: Placement, flange: Placement) -> Poses:
    position = poses.position + poses.rotation @ flange.position
    return Poses(position @ base.rotation.T + base.position, base.rotation @ poses.rotation @ flange.rotation)


def with_nominal(robot: Robot, nominal: Robot) -> Robot:
    """The robot with the frames of another file as those of its controller."""
    if nominal.axes != robot.axes:
        raise InputError(
            f"--nominal: robot {nominal.name} has {nominal.axes} axes, {robot.name} has {robot.axes}"
        )
    if not nominal.has_geometry:
        raise InputError(
            f"--nominal: robot {nominal.name} declares no geometry; expected the frames of the controller"
        )
    theirs = nominal.with_controller_frames.controller
    merged = replace(robot.controller, frames=theirs.frames, base=theirs.base, flange=theirs.flange)
    found = replace(robot, controller=merged)
    if robot.has_geometry:
        _require_same_arm(found, nominal)
    return found


def _require_same_arm(robot: Robot, nominal: Robot) -> None:
    """Its flange, base and flange fitted, stands about where the controller's frames have it."""
    base, flange = _closest(robot, threads=1)
    wanted, reached = _drawn(robot, threads=1)
    apart = _placed(reached, base, flange).position - wanted.position
    missed = float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))
    size = float(np.sqrt(np.mean(np.sum((wanted.position - wanted.position.mean(axis=0)) ** 2, axis=1))))
    if missed > OTHER_ARM * size:
        raise InputError(
            f"--nominal: robot {nominal.name} has not the lengths and axes of {robot.name} (flanges "
            f"{missed:.2g} m apart over the work space): is it another robot?"
        )
