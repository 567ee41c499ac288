"""What every kind of data says of itself; one file of this folder a kind, one object each.

    held_by       whether the columns hold it
    check         what it needs; raises InputError
    at_rest       where its chain begins: with motor angles at rest, else with their path and its rates
    device        what ends its chain
    alike         runs that are repetitions of one another: the groups that are split between identification
                  and validation
    set_ups       which rows share the frames of a set-up

A time series: `time` rises in nearly equal steps within each run. Poses measured one after the other may
carry a time as well, so beside x, y, z steps count as a time series only up to a second and without columns
that only static poses have (`visit`, `approach`).
"""

import re
from difflib import get_close_matches
from enum import Enum
from typing import ClassVar

import numpy as np

from exactarm.data.rows import Rows
from exactarm.errors import InputError
from exactarm.robot.robot import Robot

_SAME_TIME = 0.1  # of the rows: more share their time with the row before because it was rounded
_LEAST_STRETCH = 20  # rows of a series in one set, on average
STANDS_STILL = 0.02  # an axis moves when its range is more than this share of the largest
_LEAST_RANGE = 1e-3  # rad, m: where an arm has both kinds of axes, the largest of one kind may stand still
NEARLY_EQUAL = 0.5  # a step may differ from the median by this share ...
NEARLY_ALL = 0.9  # ... in this share of all steps, at least: logs lose samples
LEAST_SAMPLES = 8  # of a run: fewer have no derivative that is more than rounding
_UNITS = {"rad": ("rad", "deg"), "m": ("m", "mm")}  # of a column -> those that its name may end with
LONGEST_STEP_S = 1.0  # a robot's motion cannot be followed in longer steps


def moving_axes(robot: Robot, span: np.ndarray) -> np.ndarray:
    """(n,) bool: axes that move, by the range (n,) of each (rad; m of a sliding one). Radians are compared
    with radians and metres with metres: a quill of 150 mm moves beside an axis of two turns."""
    sliding = np.array([joint.type == "prismatic" for joint in robot.joints])
    largest = np.array([span[sliding == kind].max() for kind in sliding])
    least = _LEAST_RANGE if sliding.any() and not sliding.all() else np.finfo(float).tiny
    return span > np.maximum(STANDS_STILL * largest, least)


class Device(Enum):
    """What a kind's numbers are readings of."""

    TARGET = "the place of a target"
    GEAR = "a sensor behind the gears"
    DRIVES = "the torque of the drives"
    CONTACT = "what the tool touches, or the direction of gravity"


class Kind:
    """A kind of data: its name in files and results, its chain, and words for reports."""

    name: ClassVar[str]
    device: ClassVar[Device]
    at_rest: ClassVar[bool] = False
    alone: ClassVar[bool] = False  # a file that holds it is of no other kind
    rows: ClassVar[str] = "samples"
    row: ClassVar[str] = "sample"
    error: ClassVar[str] = "error"
    measured_as: ClassVar[str]  # by `exactarm simulate --measure`
    anew: ClassVar[str]  # what to measure so that a new model is judged by new data

    @property
    def target_at_rest(self) -> bool:
        """Whether each row is the place of a target at rest."""
        return self.at_rest and self.device is Device.TARGET

    @property
    def shows_generic_loads(self) -> bool:
        """Whether masses that are right in kind only may bend the arm: they say nothing of drive torques, and
        one axis that turns between two sensors hardly feels them."""
        return self.device not in (Device.GEAR, Device.DRIVES)

    def held_by(self, data: Rows) -> bool:
        raise NotImplementedError

    def check(self, data: Rows, robot: Robot) -> None:
        raise NotImplementedError

    def alike(self, data: Rows) -> list[np.ndarray]:
        """Numbers of the runs, grouped by what they repeat."""
        return [np.unique(data.run)]

    def set_ups(self, data: Rows, robot: Robot) -> np.ndarray:
        """(N,) the session of each row, where the columns tell more set-ups apart than the file counts."""
        return data.session


def runs_by_session(data: Rows) -> list[np.ndarray]:
    """Numbers of the runs of each session."""
    return [np.unique(data.run[data.session == session]) for session in np.unique(data.session)]


def has(values: np.ndarray | None) -> np.ndarray | bool:
    """(n,) which axes the files have."""
    return False if values is None else ~np.isnan(values[0])


def rows_by_number(numbers: np.ndarray) -> list[np.ndarray]:
    """Row indices of equal numbers (N,), in rising order of the numbers."""
    order = np.argsort(numbers, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)


def rows_of_runs(data: Rows) -> list[np.ndarray]:
    """Row indices of each run, in the order of the file."""
    return rows_by_number(data.run)


def runs_in_time(data: Rows) -> list[np.ndarray]:
    """The same, in the order of time."""
    return [rows[np.argsort(data.time[rows], kind="stable")] for rows in rows_of_runs(data)]


def file_of(data: Rows, index: int = 0) -> str | None:
    return data.sources[index].path if data.sources else None


def is_a_series(data: Rows) -> bool:
    """Whether the rows follow a motion; what only static poses have says that they do not. Rows that move on
    under one time are a motion whose time has too few digits."""
    if data.time is None or data.visit is not None or "approach" in data.joints:
        return False
    steps = np.concatenate([np.diff(data.time[rows]) for rows in rows_of_runs(data)])
    if np.count_nonzero(steps > 0.0) >= LEAST_SAMPLES and _moves_on(data, steps == 0.0):
        steps = steps[steps > 0.0]
    if steps.size == 0:
        return False
    median = np.median(steps)
    if not 0.0 < median <= LONGEST_STEP_S:
        return False
    return bool(np.mean(np.abs(steps - median) <= NEARLY_EQUAL * median) >= NEARLY_ALL)


def _moves_on(data: Rows, same: np.ndarray) -> bool:
    """Whether many rows share their time with the row before, (K,) bool over all runs, and the arm goes as
    far there as elsewhere; readings of one stop may share theirs, too."""
    angles = data.joints.get("q", data.joints.get("theta"))
    if angles is None or np.mean(same) <= _SAME_TIME:
        return False
    way = np.concatenate([np.abs(np.diff(angles[rows], axis=0)) for rows in rows_of_runs(data)])
    there, whole = np.nansum(way[same]), np.nansum(way)
    return bool(there > 0.5 * np.mean(same) * whole)


def check_time(data: Rows) -> None:
    if data.time is None:
        raise InputError("column missing; expected the time of each sample", file=file_of(data),
                         column="time_s")
    for rows in rows_of_runs(data):
        if rows.size < LEAST_SAMPLES:
            place = {"file": file_of(data, data.file_index[rows[0]]), "row": int(data.row[rows[0]])}
            raise InputError(f"run {data.run[rows[0]]} has {rows.size} rows; expected at least "
                             f"{LEAST_SAMPLES} samples of a motion", column="run", **place)
        time = data.time[rows]
        fallen = np.flatnonzero(np.diff(time) <= 0.0)
        if fallen.size:
            at = rows[fallen[0] + 1]
            message = f"time {data.time[at]:.9g} s does not rise; expected more than {time[fallen[0]]:.9g} s"
            if np.mean(np.diff(time) == 0.0) > _SAME_TIME:
                alike = np.sum(time == data.time[at])
                message = (f"time {data.time[at]:.9g} s stands in {alike} rows, as others do; expected the "
                           "time of each sample, with all its digits")
            elif data.time[at] <= time[1]:
                message += " (where a second run begins, number the runs in a column run)"
            file = file_of(data, data.file_index[at])
            raise InputError(message, file=file, row=int(data.row[at]), column="time_s")
        sets = data.identification
        turns = np.flatnonzero(np.diff(sets[rows])) if sets is not None else time[:0]
        if turns.size and rows.size < _LEAST_STRETCH * (turns.size + 1):
            at = rows[int(turns[0]) + 1]
            raise InputError(
                f"run {data.run[at]} passes {turns.size} times between identification and validation, every "
                f"{rows.size / (turns.size + 1):.2g} rows; expected whole runs, or stretches of seconds: "
                "neighbours in time are no test of each other", file=file_of(data, data.file_index[at]),
                row=int(data.row[at]), column="set")


def check_joints(data: Rows, robot: Robot) -> None:
    """Every axis needs an angle that the robot can turn into a joint angle."""
    q, theta = (has(data.joints.get(name)) & np.ones(robot.axes, dtype=bool) for name in ("q", "theta"))
    for index, joint in enumerate(robot.joints):
        unit = "m" if joint.type == "prismatic" else "rad"
        own = f"q_{index + 1}_{unit}"
        if theta[index] and not q[index] and not joint.has_gear:
            message = f"robot {robot.name} declares no gear ratio for axis {index + 1}; expected {own}"
            raise InputError(message, file=file_of(data), column=f"theta_{index + 1}")
        if not (q[index] or theta[index]):
            expected = f"{own} or theta_{index + 1}_rad" if joint.has_gear else own
            message = f"column missing; robot {robot.name} has {robot.axes} axes, expected {expected}"
            raise InputError(message + _meant(data, own), file=file_of(data), column=own)


def _meant(data: Rows, own: str) -> str:
    """A column of the file that may be the missing one by another name, in the unit that this name has."""
    axis = own.split("_")[1]
    close = (get_close_matches(own, data.covariates, n=1)
             or [name for name in data.covariates if re.search(rf"(?<!\d){axis}(?!\d)", name)])
    if not close:
        return ""
    stem, _, unit = own.rpartition("_")
    theirs = close[0].rpartition("_")[2]
    shown = theirs if theirs in _UNITS[unit] else unit
    return f"; did you mean it with {close[0]} (--map {close[0]}={stem}_{shown})?"


def check_geometry(robot: Robot) -> None:
    if not robot.has_geometry:
        raise InputError(f"robot {robot.name} declares no geometry; expected one for data with x, y, z",
                         file=robot.file)


def check_positions(data: Rows, robot: Robot) -> None:
    """What a target needs that a tracker follows."""
    if data.position is None:
        raise InputError("column missing; expected x, y, z for poses", file=file_of(data), column="x_m")
    check_geometry(robot)
    check_joints(data, robot)
