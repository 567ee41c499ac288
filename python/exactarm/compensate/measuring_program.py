"""A program that drives an arm through measuring poses, in the language of its controller.

Each stop is a joint target that every axis reaches in the direction of `approach`: from a point before it,
short of it by a few degrees (so much more than a gear's lost motion), where the limits leave room. Then the
arm waits, for the tracker to see it still. Speeds are slow and stand at the top of the program. Joint targets
alone: no tool, no base, no branch is needed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from exactarm.compensate.setting import Setting
from exactarm.errors import InputError
from exactarm.robot.robot import Robot

BEFORE_RAD = np.radians(3.0)  # several times the lost motion of any gear that still works
WAIT_S = 3.0
SPEED = 0.1  # of the largest
_UR_RATE, _UR_ACCELERATION = 0.3, 0.5  # rad/s, rad/s^2


@dataclass(frozen=True)
class Stop:
    """q (n,) in the controller's angles, rad; before (n,): where the arm comes from, or None for straight
    there."""

    q: np.ndarray
    before: np.ndarray | None


def stops_of(q: np.ndarray, approach: np.ndarray | None, lower: np.ndarray, upper: np.ndarray) -> list[Stop]:
    """q (N, n), approach (N, n) of -1, 0, 1 or None. A point before a target never leaves the limits."""
    if approach is None:
        return [Stop(each, None) for each in q]
    return [Stop(each, np.clip(each - BEFORE_RAD * way, lower, upper)) for each, way in zip(q, approach)]


def measuring_program(robot: Robot, dialect: str, stops: list[Stop],
                      wait_s: float = WAIT_S) -> tuple[str, str]:
    """(file name, text). dialect: one of WRITERS. Raises InputError where the robot file lacks what the
    dialect needs."""
    writer = WRITERS.get(dialect)
    if writer is None:
        raise InputError(f"--program {dialect}: expected one of {', '.join(WRITERS)}")
    if any(joint.type == "prismatic" for joint in robot.joints):
        raise InputError("--program: a sliding axis has a unit of its own in each controller; expected "
                         "revolute axes only",
                         file=robot.file)
    setting = Setting(robot)
    path = [(setting.reported(angles), measured) for stop in stops
            for angles, measured in ((stop.before, False), (stop.q, True)) if angles is not None]
    return writer(robot, path, wait_s)


Route = list[tuple[np.ndarray, bool]]  # reported joint angles in rad, and whether the arm is measured there


def _krl(robot: Robot, path: Route, wait_s: float) -> tuple[str, str]:
    lines = ["&ACCESS RVP", "DEF measure()", "; exactarm: measuring poses, joint targets only",
             "BAS(#INITMOV, 0)",
             f"BAS(#VEL_PTP, {100.0 * SPEED:.0f})"]
    for q, measured in path:
        axes = ", ".join(f"A{i} {np.degrees(angle):.5f}" for i, angle in enumerate(q, start=1))
        lines.append(f"PTP {{{axes}}}")
        lines += [f"WAIT SEC {wait_s:.1f}"] * measured
    return "measure.src", "\n".join([*lines, "END"]) + "\n"


def _rapid(robot: Robot, path: Route, wait_s: float) -> tuple[str, str]:
    _at_most(robot, 6, "a jointtarget has six")
    lines = ["MODULE measure", "  ! exactarm: measuring poses, joint targets only", "  PROC main()",
             f"    VelSet {100.0 * SPEED:.0f}, 500;"]
    outside = ",".join(["9E9"] * 6)
    for q, measured in path:
        axes = ",".join([f"{np.degrees(angle):.5f}" for angle in q] + ["0"] * (6 - len(q)))
        lines.append(f"    MoveAbsJ [[{axes}],[{outside}]], v1000, fine, tool0;")
        lines += [f"    WaitTime {wait_s:.1f};"] * measured
    return "measure.mod", "\n".join([*lines, "  ENDPROC", "ENDMODULE"]) + "\n"


def _fanuc(robot: Robot, path: Route, wait_s: float) -> tuple[str, str]:
    if robot.controller.coupling is None:
        raise InputError("Fanuc may count J3 from the horizon or from link 2, and the file does not say; put "
                         "it into the robot file: "
                         "[controller] coupling = [[3, 2, 1.0]], or coupling = [] where J3 is q_3",
                         file=robot.file)
    moves, places = [], []
    for number, (q, measured) in enumerate(path, start=1):
        moves.append(f"J P[{number}] {100.0 * SPEED:.0f}% FINE    ;")
        moves += [f"WAIT {wait_s:6.2f}(sec) ;"] * measured
        axes = ",\n".join(f"\tJ{i}= {np.degrees(angle):.3f} deg" for i, angle in enumerate(q, start=1))
        places.append(f"P[{number}]{{\n   GP1:\n\tUF : 0, UT : 1,\n{axes}\n}};")
    listed = [f"{line:4d}:  {move}" for line, move in enumerate(moves, start=1)]
    head = ["/PROG  MEASURE", "/ATTR", 'COMMENT = "exactarm";', "DEFAULT_GROUP = 1,*,*,*,*;", "/MN"]
    return "measure.ls", "\n".join([*head, *listed, "/POS", *places, "/END"]) + "\n"


def _urscript(robot: Robot, path: Route, wait_s: float) -> tuple[str, str]:
    lines = ["def measure():", "  # exactarm: measuring poses, joint targets only"]
    for q, measured in path:
        axes = ", ".join(f"{angle:.9f}" for angle in q)
        lines.append(f"  movej([{axes}], a={_UR_ACCELERATION:g}, v={_UR_RATE:g})")
        lines += [f"  sleep({wait_s:.1f})"] * measured
    return "measure.script", "\n".join([*lines, "end"]) + "\n"


def _inform(robot: Robot, path: Route, wait_s: float) -> tuple[str, str]:
    pulses = np.array(robot.controller.pulses_per_rad)
    if pulses.size != robot.axes:
        raise InputError("INFORM counts pulses; expected [controller] pulses_per_rad of all axes in the "
                         "robot file", file=robot.file)
    places, moves = [], []
    for number, (q, measured) in enumerate(path):
        places.append(f"C{number:05d}=" + ",".join(f"{round(count)}" for count in q * pulses))
        moves.append(f"MOVJ C{number:05d} VJ={100.0 * SPEED:.2f}")
        moves += [f"TIMER T={wait_s:.2f}"] * measured
    head = ["/JOB", "//NAME MEASURE", "//POS", f"///NPOS {len(path)},0,0,0,0,0", "///TOOL 0",
            "///POSTYPE PULSE", "///PULSE"]
    middle = ["//INST", "///DATE 2026/01/01 00:00", "///ATTR SC,RW", "///GROUP1 RB1", "NOP"]
    return "measure.jbi", "\r\n".join([*head, *places, *middle, *moves, "END"]) + "\r\n"


def _at_most(robot: Robot, axes: int, why: str) -> None:
    if robot.axes > axes:
        raise InputError(f"--program: {robot.axes} axes, but {why}", file=robot.file)


WRITERS: MappingProxyType[str, Callable[[Robot, Route, float], tuple[str, str]]] = MappingProxyType(
    {"krl": _krl, "rapid": _rapid, "fanuc": _fanuc, "urscript": _urscript, "inform": _inform})
