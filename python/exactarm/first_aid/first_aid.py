"""First aid before every identification: which usual mistake of the user would explain the data better?

    first_aid(robot, data) -> warnings, one line each, the likeliest mistake of every sort; empty where
        nothing is suspicious

A wrong sign or unit is rarely refused by a fit: it is absorbed by parameters that then mean nothing. So the
mistakes are tried on some rows first. It never corrects anything, and takes a fraction of a second.
"""

from collections.abc import Callable, Sequence

from exactarm.data.dataset import Dataset
from exactarm.data.kinds import CLOSURES, GEAR_RUN, MOTION, POSES, TRACKED_MOTION
from exactarm.errors import InputError
from exactarm.first_aid.camera_mistakes import camera_mistakes
from exactarm.first_aid.coarse_torques import coarse_torques
from exactarm.first_aid.gear_mistakes import gear_mistakes
from exactarm.first_aid.load_mistakes import load_mistakes
from exactarm.first_aid.lone_readings import lone_readings
from exactarm.first_aid.lost_readings import lost_readings
from exactarm.first_aid.motion_mistakes import motion_mistakes
from exactarm.first_aid.odd_rows import odd_rows
from exactarm.first_aid.odd_runs import odd_runs
from exactarm.first_aid.pose_mistakes import pose_mistakes
from exactarm.first_aid.ratio_mistakes import ratio_mistakes
from exactarm.first_aid.signal_mistakes import (
    cell_mistakes,
    column_mistakes,
    limit_mistakes,
    repeated_rows,
)
from exactarm.first_aid.suspicion import Suspicion, in_order
from exactarm.first_aid.touch_mistakes import touch_mistakes, unused_distances
from exactarm.first_aid.tracked_mistakes import tracked_mistakes
from exactarm.identify.declared import carried_layout
from exactarm.identify.match import Mismatch
from exactarm.robot.generic_masses import with_declared_masses
from exactarm.robot.robot import Robot


def first_aid(robot: Robot, data: Dataset, placed: bool = False) -> tuple[str, ...]:
    """One line for the likeliest mistake of every sort that the data give cause to suspect.

    placed: base and tool are known from other data, which judge better where these belong.
    """
    found: list[Suspicion] = []
    alone, cleaned = lone_readings(robot, data)
    for kind in data.kinds:
        for check in _CHECKS.get(kind, ()):
            if (placed and check is _poses) or not (robot.has_geometry or check is gear_mistakes):
                continue
            try:
                found += check(robot, cleaned)[:1]
            except InputError:  # what the command itself refuses, it says itself
                continue
    # What a column shows by itself is certain; what explains the data tells more than a limit that is passed.
    found = list(column_mistakes(robot, data)) or found or list(limit_mistakes(robot, data))
    cells = list(cell_mistakes(data)) or list(lost_readings(data)) or alone
    found = [*cells, *coarse_torques(data), *repeated_rows(data), *found]
    return tuple(dict.fromkeys(suspicion.text for suspicion in found))


def with_cause(error: Mismatch, found: Sequence[str] = ()) -> InputError:
    """The refusal with the mistake that its own rows show, else the first of `found`, what all rows show."""
    meant = pose_mistakes(error.robot, error.rows, error.carried, error.seed)
    if not meant and not found:
        return error
    told = (meant[0].text if meant[0].sentence else f"is it {meant[0].words}?") if meant else found[0]
    return InputError(f"{error.refusal}: {told}", file=error.file)


def _poses(robot: Robot, data: Dataset) -> list[Suspicion]:
    carried = carried_layout(robot, data)
    return in_order([*pose_mistakes(robot, data, carried), *odd_rows(robot, data, carried)])


def _loads(robot: Robot, data: Dataset) -> list[Suspicion]:
    return list(load_mistakes(robot, data))


def _motions(robot: Robot, data: Dataset) -> list[Suspicion]:
    robot = with_declared_masses(robot)
    whole = motion_mistakes(robot, data)
    if parts := odd_runs(robot, data):  # which a whole motion's friction and units only hint at
        return in_order([*(each for each in whole if not each.sentence), *parts])
    return whole or list(ratio_mistakes(robot, data))


_CHECKS: dict[str, tuple[Callable[[Robot, Dataset], list[Suspicion]], ...]] = {
    POSES.name: (_poses, _loads),
    CLOSURES.name: (camera_mistakes, touch_mistakes, unused_distances, _loads),
    TRACKED_MOTION.name: (_poses, tracked_mistakes),
    MOTION.name: (_motions,),
    GEAR_RUN.name: (gear_mistakes,),
}
