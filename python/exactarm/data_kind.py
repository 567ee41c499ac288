"""What kind of data a file holds, from its columns.

    socket, plane, sphere, bar or pair       closures (with or without x, y, z)
    x, y, z without a time series            poses
    x, y, z in a time series                 tracked_motion
    gyro, or theta_i beside q_i              gear_run
    tau_i, tau_motor_i or current_i          motion

A time series: `time` rises in nearly equal steps within each run. Poses measured one after the other may
carry a time as well, so beside x, y, z steps count as a time series only up to a second and without columns
that only static poses have (`visit`, `approach`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from exactarm.errors import InputError
from exactarm.robot import Robot

if TYPE_CHECKING:
    from exactarm.dataset import Dataset

KINDS = ("poses", "gear_run", "motion", "tracked_motion", "closures")
STATIC = ("poses", "closures")  # rows are poses at rest
TORQUES = ("tau", "tau_motor", "current")
NEARLY_EQUAL = 0.5  # a step may differ from the median by this share ...
NEARLY_ALL = 0.9  # ... in this share of all steps, at least: logs lose samples
LEAST_SAMPLES = 8  # of a run: fewer have no derivative that is more than rounding
LONGEST_STEP_S = 1.0  # a robot's motion cannot be followed in longer steps


def data_kinds(dataset: Dataset, robot: Robot, kind: str | None = None) -> dict[str, Any]:
    """`{"kind": ..., "kinds": ...}` of a data set; raises InputError where the columns do not admit one."""
    if kind is not None and kind not in KINDS:
        raise InputError(f"unknown kind of data {kind!r}; expected one of {', '.join(KINDS)}")
    kinds = (kind,) if kind is not None else _from_columns(dataset, robot)
    for each in kinds:
        _CHECKS[each](dataset, robot)
        if each not in STATIC:
            _check_time(dataset)
    return {"kind": kinds[0], "kinds": kinds}


def _from_columns(dataset: Dataset, robot: Robot) -> tuple[str, ...]:
    if dataset.contacts:
        return ("closures",)
    gear = dataset.gyro is not None or _has_both_encoders(dataset)
    torque = any(name in dataset.joints for name in TORQUES)
    static = dataset.visit is not None or "approach" in dataset.joints
    if dataset.position is not None:
        if static or not _looks_like_a_series(dataset):
            return ("poses",)
        return tuple(
            name for name, holds in (("gear_run", gear), ("motion", torque), ("tracked_motion", True))
            if holds
        )
    kinds = tuple(name for name, holds in (("gear_run", gear), ("motion", torque)) if holds)
    if not kinds:
        raise InputError(
            "no measured quantity; expected x, y, z (poses), socket, plane, sphere, bar or pair (closures), "
            "gyro_x, gyro_y, gyro_z or theta_i beside q_i "
            "(gear run), or tau_i, tau_motor_i or current_i (motion)",
            file=_file(dataset),
        )
    return kinds


def _has_both_encoders(dataset: Dataset) -> bool:
    theta, q = dataset.joints.get("theta"), dataset.joints.get("q")
    return theta is not None and q is not None and bool((_has(theta) & _has(q)).any())


def _has(values: np.ndarray | None) -> np.ndarray | bool:
    """(n,) which axes the files have."""
    return False if values is None else ~np.isnan(values[0])


def _looks_like_a_series(dataset: Dataset) -> bool:
    if dataset.time is None:
        return False
    steps = np.concatenate([np.diff(dataset.time[rows]) for rows in _runs(dataset)])
    if steps.size == 0:
        return False
    median = np.median(steps)
    if not 0.0 < median <= LONGEST_STEP_S:
        return False
    return bool(np.mean(np.abs(steps - median) <= NEARLY_EQUAL * median) >= NEARLY_ALL)


def _runs(dataset: Dataset) -> list[np.ndarray]:
    """Row indices of each run, in the order of the file."""
    order = np.argsort(dataset.run, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(dataset.run[order])) + 1)


# -- what each kind needs ----------------------------------------------------------------------------
def _file(dataset: Dataset, index: int = 0) -> str | None:
    return dataset.sources[index].path if dataset.sources else None


def _check_time(dataset: Dataset) -> None:
    if dataset.time is None:
        raise InputError("column missing; expected the time of each sample", file=_file(dataset),
                         column="time_s")
    for rows in _runs(dataset):
        if rows.size < LEAST_SAMPLES:
            place = {"file": _file(dataset, dataset.file_index[rows[0]]), "row": int(dataset.row[rows[0]])}
            raise InputError(f"run {dataset.run[rows[0]]} has {rows.size} rows; expected at least "
                             f"{LEAST_SAMPLES} samples of a motion",
                             column="run", **place)
        time = dataset.time[rows]
        fallen = np.flatnonzero(np.diff(time) <= 0.0)
        if fallen.size:
            at = rows[fallen[0] + 1]
            message = (
                f"time {dataset.time[at]:.9g} s does not rise; expected more than {time[fallen[0]]:.9g} s"
            )
            file = _file(dataset, dataset.file_index[at])
            raise InputError(message, file=file, row=int(dataset.row[at]), column="time_s")


def check_joints(dataset: Dataset, robot: Robot) -> None:
    """Every axis needs an angle that the robot can turn into a joint angle."""
    q, theta = (_has(dataset.joints.get(name)) & np.ones(robot.axes, dtype=bool) for name in ("q", "theta"))
    for index, joint in enumerate(robot.joints):
        unit = "m" if joint.type == "prismatic" else "rad"
        own = f"q_{index + 1}_{unit}"
        if theta[index] and not q[index] and not joint.has_gear:
            message = f"robot {robot.name} declares no gear ratio for axis {index + 1}; expected {own}"
            raise InputError(message, file=_file(dataset), column=f"theta_{index + 1}")
        if not (q[index] or theta[index]):
            expected = f"{own} or theta_{index + 1}_rad" if joint.has_gear else own
            message = f"column missing; robot {robot.name} has {robot.axes} axes, expected {expected}"
            raise InputError(message, file=_file(dataset), column=own)


def _check_geometry(robot: Robot) -> None:
    if not robot.has_geometry:
        raise InputError(f"robot {robot.name} declares no geometry; expected one for data with x, y, z",
                         file=robot.file)


def _check_poses(dataset: Dataset, robot: Robot) -> None:
    if dataset.position is None:
        raise InputError("column missing; expected x, y, z for poses", file=_file(dataset), column="x_m")
    _check_geometry(robot)
    check_joints(dataset, robot)


def _check_closures(dataset: Dataset, robot: Robot) -> None:
    if not dataset.contacts:
        message = "column missing; expected socket, plane, sphere, bar or pair for closures"
        raise InputError(message, file=_file(dataset), column="socket")
    _check_geometry(robot)
    check_joints(dataset, robot)
    touched = np.any([numbers >= 0 for numbers in dataset.contacts.values()], axis=0)
    tracked = np.zeros(len(dataset), bool)
    if dataset.position is not None:
        tracked = ~np.isnan(dataset.position).any(axis=1)
    if not (touched | tracked).all():
        at = int(np.argmin(touched | tracked))
        raise InputError(
            "neither a contact nor x, y, z; expected one of them in every row",
            file=_file(dataset, dataset.file_index[at]), row=int(dataset.row[at]),
            column=next(iter(dataset.contacts)),
        )


def _check_gear_run(dataset: Dataset, robot: Robot) -> None:
    theta = dataset.joints.get("theta")
    if theta is None:
        raise InputError("column missing; expected the motor angle of a gear run", file=_file(dataset),
                         column="theta_1_rad")
    if dataset.gyro is None and not _has_both_encoders(dataset):
        message = "column missing; expected gyro_x, gyro_y, gyro_z or a q_i beside theta_i for a gear run"
        raise InputError(message, file=_file(dataset), column="gyro_x_rad_s")
    for index in np.flatnonzero(_has(theta)):
        if not robot.joints[index].has_gear:
            message = (
                f"robot {robot.name} declares no gear ratio for axis {index + 1}; expected one for a gear run"
            )
            raise InputError(message, file=_file(dataset), column=f"theta_{index + 1}")


def _check_motion(dataset: Dataset, robot: Robot) -> None:
    if not any(name in dataset.joints for name in TORQUES):
        message = "column missing; expected tau_i, tau_motor_i or current_i for a motion"
        raise InputError(message, file=_file(dataset), column="tau_1_Nm")
    check_joints(dataset, robot)


_CHECKS = {
    "poses": _check_poses,
    "closures": _check_closures,
    "gear_run": _check_gear_run,
    "motion": _check_motion,
    "tracked_motion": _check_poses,
}
