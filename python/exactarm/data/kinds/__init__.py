"""Kinds of data: which of them a file holds, told by its columns (each in a file of its own).

    closures, poses                     stand alone, in this order
    gear_run, motion, tracked_motion    several may be in one file; the first is analysed first
"""

from typing import Any

from exactarm.data.kinds.base import Device, Kind, file_of
from exactarm.data.kinds.closures import CLOSURES
from exactarm.data.kinds.gear_run import GEAR_RUN
from exactarm.data.kinds.gear_set_ups import words_of_set_ups
from exactarm.data.kinds.motion import MOTION
from exactarm.data.kinds.poses import POSES
from exactarm.data.kinds.tracked_motion import TRACKED_MOTION
from exactarm.data.rows import Rows
from exactarm.errors import InputError
from exactarm.robot.robot import Robot

_IN_ORDER = (CLOSURES, POSES, GEAR_RUN, MOTION, TRACKED_MOTION)
_BY_NAME = {kind.name: kind for kind in (POSES, GEAR_RUN, MOTION, TRACKED_MOTION, CLOSURES)}
KIND_NAMES = tuple(_BY_NAME)
# Which kinds show an effect, by name; closures show what poses show.
WITH_TARGET = tuple(kind.name for kind in _BY_NAME.values() if kind.device is Device.TARGET)
IN_TIME = tuple(kind.name for kind in _BY_NAME.values() if not kind.at_rest)
ALL_KINDS = (POSES.name, *IN_TIME)
__all__ = ["ALL_KINDS", "CLOSURES", "GEAR_RUN", "IN_TIME", "KIND_NAMES", "MOTION", "POSES", "TRACKED_MOTION",
           "WITH_TARGET", "Device", "Kind", "data_kinds", "kind_of"]


def kind_of(name: str) -> Kind:
    """The kind of that name."""
    return _BY_NAME[name]


def data_kinds(data: Rows, robot: Robot, name: str | None = None) -> dict[str, Any]:
    """`kind`, `kinds`, `session`, `notes` of a data set; raises InputError where the columns admit none."""
    if name is not None and name not in _BY_NAME:
        raise InputError(f"unknown kind of data {name!r}; expected one of {', '.join(KIND_NAMES)}")
    kinds = (_BY_NAME[name],) if name is not None else _from_columns(data)
    for kind in kinds:
        kind.check(data, robot)
    session = kinds[0].set_ups(data, robot)
    return {"kind": kinds[0].name, "kinds": tuple(kind.name for kind in kinds), "session": session,
            "notes": words_of_set_ups(data.session, session, data.run)}


_NAMES_SHOWN, _LETTERS_SHOWN = 3, 30  # of columns, in a refusal of one line


def _from_columns(data: Rows) -> tuple[Kind, ...]:
    held = [kind for kind in _IN_ORDER if kind.held_by(data)]
    if not held:
        raise InputError("no measured quantity; expected x, y, z (poses), socket, plane, sphere, bar, pair, "
                         "tilt_x_rad, accel_x_m_s2 or u_px (closures), "
                         "gyro_x, gyro_y, gyro_z or theta_i beside q_i "
                         "(gear run), or tau_i, tau_motor_i or current_i (motion)" + _other_names(data),
                         file=file_of(data))
    return (held[0],) if held[0].alone else tuple(held)


def _other_names(data: Rows) -> str:
    """Columns that mean nothing by their names, and how they are given others."""
    names = [name[:_LETTERS_SHOWN] for name in data.covariates]
    shown = ", ".join(names[:_NAMES_SHOWN]) + (", ..." if len(names) > _NAMES_SHOWN else "")
    return f'; what {shown} stand for is told by --map "{names[0]}=q_1_deg" and so on' if names else ""
