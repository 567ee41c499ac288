"""Errors of two models of one arm on rows that neither was fitted to.

Which rows were fitted follows from the record of the robot file: files by their SHA-256 or the marks of their
rows (data/row_marks.py), the split by its seed. Base and tool frame of each session are found anew by rows
that do not judge: the fitted ones, else a share of the poses. Only where a session has too few poses, the
same rows find the frames and judge; a warning says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from exactarm.chain import predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.split import DEFAULT_SEED, pose_groups
from exactarm.errors import InputError
from exactarm.identify.declared import carried_layout, frames_layout, require_geometry
from exactarm.identify.match import require_match
from exactarm.identify.pose_fit import PoseFit, fit_poses
from exactarm.numerics.quadratic import variances
from exactarm.numerics.rotation import log, nearest
from exactarm.robot.robot import Joint, Placement, Robot, frame_of

FRAME_POSES = 12  # different poses that find the nine numbers of a set-up: four times as many numbers
FRAME_SHARE = 0.3  # of the poses of a session that nothing was fitted to, to find its frames by


@dataclass(frozen=True)
class Rows:
    """judged, frames (N,) bool: rows that judge, rows that find the frames. why: a sentence. warnings: what a
    reader must know.
    unseen: some rows were not fitted."""

    judged: np.ndarray
    frames: np.ndarray
    why: str
    warnings: tuple[str, ...]
    unseen: bool = True

    @property
    def word(self) -> str:
        """What to call them."""
        return "held-out" if self.unseen else "fitted"


@dataclass(frozen=True)
class Judged:
    """One model on the judged rows (M of them).

    residual (M, 3): measured minus predicted, m; predicted (M, 3) in the device's frame; frames (M,):
    variance of one coordinate of the prediction from the uncertainty of the frames, mean over the three, m^2;
    freedom: of the fit of the frames. base (M, 3, 3): rotation of the controller's base in the device's
    frame; turn (M, 3): measured beyond predicted orientation, rotation vector in the base's axes, rad, None
    where no orientation is measured.
    """

    residual: np.ndarray
    predicted: np.ndarray
    frames: np.ndarray
    freedom: int
    fit: PoseFit
    base: np.ndarray
    turn: np.ndarray | None

    @property
    def error(self) -> np.ndarray:
        """(M,) Euclidean, m."""
        return np.linalg.norm(self.residual, axis=1)


def controllers_robot(robot: Robot) -> Robot:
    """The chain that the controller itself works with: its frames, offsets and ratios, rigid, without gear
    tables and effects, declared ones too: not the nominal model, which has what was declared."""
    require_geometry(robot)
    frames = robot.controller.frames
    if not frames and any(known["command"] in ("calibrate", "diagnose") for known in fits_on_record(robot)):
        raise InputError(
            "the controller's frames are not on record here; expected --before ROBOT, the file from before "
            "the calibration",
            file=robot.file,
        )
    joints = tuple(
        _bare(frame, joint, robot, i)
        for i, (frame, joint) in enumerate(zip(frames or robot.joints, robot.joints))
    )
    name = f"{robot.name} as its controller calculates it"
    return replace(robot, name=name, joints=joints, effects=(), intervals={}, record={})


def _bare(frame: Joint, joint: Joint, robot: Robot, index: int) -> Joint:
    return replace(
        frame_of(frame),
        ratio=None if joint.ratio is None else float(robot.controller_ratios[index]),
        q_offset=float(robot.controller_offsets[index]),
        q_min=joint.q_min,
        q_max=joint.q_max,
    )


def fits_on_record(robot: Robot) -> Iterator[Mapping[str, Any]]:
    """The records of all commands that have changed the file, the last one first."""
    record: Any = robot.record
    while isinstance(record, Mapping):
        if isinstance(record.get("command"), str):
            yield record
        record = record.get("previous")


def fitted_files(robot: Robot, data: Dataset) -> list[str]:
    """Names of the files of which the robot was fitted to rows, by its record."""
    known = np.zeros(len(data.sources), bool)
    for record in fits_on_record(robot):
        known |= data.shared_files([entry for entry in record.get("data", ()) if isinstance(entry, Mapping)])
    return [Path(source.path).name for source, met in zip(data.sources, known) if met]


def choose_rows(robots: tuple[Robot, ...], data: Dataset, seed: int = DEFAULT_SEED) -> Rows:
    """The rows that none of the robots was fitted to, and those that find the frames."""
    fitted, warnings = _fitted(robots, data, seed)
    if data.identification is not None:
        why = "Judged: the rows that the column `set` calls validation."
    elif fitted.any():
        why = "Judged: the rows that the record of the robot file shows to have been held out."
    else:
        why = (
            "Judged: rows of files that the robot file has no record of, so that nothing was fitted to them."
        )
    judged = ~fitted
    if not judged.any():
        judged = np.ones(len(data), bool)
        why = "Judged: all rows, although all were fitted."
        warnings = (
            *warnings,
            "all rows were fitted: the errors are those of a fit, not of the arm; expected data measured "
            "after it",
        )
    rows = _with_frames(data, judged, fitted, why, warnings, seed)
    return replace(rows, unseen=not fitted.all())


def _fitted(robots: tuple[Robot, ...], data: Dataset, seed: int) -> tuple[np.ndarray, tuple[str, ...]]:
    """(N,) bool: rows that were fitted, or may have been."""
    fitted, warnings = np.zeros(len(data), bool), []
    if data.identification is not None:
        fitted |= data.identification
    for record in (known for robot in robots for known in fits_on_record(robot)):
        files = [entry for entry in record.get("data", ()) if isinstance(entry, Mapping)]
        known = data.shared_files(files)
        if not known.any() or data.identification is not None:
            continue
        if data.is_of(files):
            if not isinstance(record.get("seed"), int):
                warnings.append(
                    f"the robot file does not tell the seed of its split; taken as {seed}, the present one"
                )
            fitted |= data.split(record["seed"] if isinstance(record.get("seed"), int) else seed)
        else:
            fitted |= known[data.file_index]
            warnings.append(
                "some of these files, or rows of theirs, were fitted together with others, so their split is "
                "not known here: all their rows count as fitted"
            )
    return fitted, tuple(dict.fromkeys(warnings))


def _with_frames(
    data: Dataset, judged: np.ndarray, fitted: np.ndarray, why: str, warnings: tuple[str, ...], seed: int
) -> Rows:
    """A share of the judged poses finds the frames where no fitted rows can."""
    groups, frames, judged = pose_groups(data), np.zeros(len(data), bool), judged.copy()
    counts = np.bincount(groups)
    for session in np.unique(data.session[judged]):
        here = data.session == session
        if len(np.unique(groups[here & fitted])) >= FRAME_POSES:
            frames |= here & fitted
            continue
        free = np.unique(groups[here & judged])
        once = free[
            counts[free] == 1
        ]  # poses measured again tell the repeatability: they judge as long as others are there
        chosen = np.random.default_rng(seed).permutation(once if len(once) >= 2 * FRAME_POSES else free)
        take = max(int(round(FRAME_SHARE * len(free))), FRAME_POSES)
        if len(chosen) >= 2 * FRAME_POSES:
            taken = here & np.isin(groups, chosen[:take])
            frames |= taken
            judged &= ~taken
            continue
        frames |= here & judged
        warnings = (
            *warnings,
            f"session {session} has {len(free)} different poses, too few to find its frames by rows that do "
            f"not judge "
            f"(expected {2 * FRAME_POSES}): its errors are too small by what the frames absorb",
        )
    return Rows(judged, frames, why, warnings)


def judge(robot: Robot, data: Dataset, rows: Rows, seed: int = DEFAULT_SEED, threads: int = 1) -> Judged:
    """The model of `robot` on the judged rows, frames found by `rows.frames`."""
    require_geometry(robot)
    finding, judged = data.select(rows.frames), data.select(rows.judged)
    layout, found = frames_layout(robot, finding, orientation=False, seed=seed)
    require_match(robot, finding, found, carried_layout(robot, finding), seed)
    fit = fit_poses(robot, layout.joined(carried_layout(robot, data)), finding, threads=threads)
    variance, predicted = np.empty(len(judged)), np.empty((len(judged), 3))
    rotation = np.empty((len(judged), 3, 3))
    for start in range(0, len(judged), BLOCK_ROWS):
        block = np.arange(start, min(start + BLOCK_ROWS, len(judged)))
        prediction = predict_poses(robot, fit.layout, judged.select(block), threads=threads)
        tangent = prediction.jacobian[:, :3]
        variance[block] = variances(tangent, fit.fit.covariance).mean(axis=1)
        predicted[block], rotation[block] = prediction.position, prediction.rotation
    base = _base_rotation(fit, judged)
    turn = None
    if judged.rotation is not None:
        rotation = rotation @ _tool_rotation(fit, finding, judged, threads)
        turn = log(base.transpose(0, 2, 1) @ judged.rotation @ rotation.transpose(0, 2, 1) @ base)
    return Judged(judged.position - predicted, predicted, variance, fit.fit.freedom, fit, base, turn)


def _base_rotation(fit: PoseFit, data: Dataset) -> np.ndarray:
    """(N, 3, 3) of the controller's base in the device's frame, as fitted to each row's session."""
    out, first = np.empty((len(data), 3, 3)), fit.robot.controller.base.rotation
    for session in np.unique(data.session):
        base = Placement()
        for effect in fit.layout.effects:
            base = effect.place(int(session), base, Placement())[0]
        out[data.session == session] = base.rotation @ first.T
    return out


def _tool_rotation(fit: PoseFit, finding: Dataset, judged: Dataset, threads: int) -> np.ndarray:
    """(M, 3, 3) turn of the measured target in the last frame, by the rows that find the frames: positions do
    not show it. It is the mean over them, so that the frames of the positions stay as they are."""
    assert finding.rotation is not None
    out = np.tile(np.eye(3), (len(judged), 1, 1))
    for session in np.unique(judged.session):
        rows = finding.select(finding.session == session)
        predicted = predict_poses(fit.robot, fit.layout, rows, tangents=False, threads=threads).rotation
        out[judged.session == session] = nearest(
            (predicted.transpose(0, 2, 1) @ rows.rotation).mean(axis=0))
    return out


BLOCK_ROWS = 5000
