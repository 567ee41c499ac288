"""INFORM jobs with traps: executed before and after `compensate` by an interpreter that knows no reader."""

import numpy as np
import pytest

from compensation_cell import BASE, PULSES, TOOL, nearby
from interpreters import inform
from interpreters.motion import numbers_zyx, zyx
from interpreters.verdict import arm_of, corrected, refused, robot_of

OTHER_TOOL = (80.0, -20.0, 200.0, 22.0, 30.0, -10.0)
OTHER_BASE = (-80.0, 60.0, 40.0, 7.0, 2.0, -6.0)
ROBOT = robot_of(pulses_per_rad=PULSES)
ARM = arm_of(ROBOT)
Q = nearby(ROBOT, 6)
TOOLS, BASES = {0: TOOL, 5: OTHER_TOOL}, {1: BASE, 2: OTHER_BASE}
as_shown = lambda numbers: tuple(np.array(numbers)[[0, 1, 2, 5, 4, 3]])  # Rx, Ry, Rz
GIVEN = {option: [f"{number}={','.join(map(str, as_shown(numbers)))}" for number, numbers in frames.items()]
         for option, frames in (("tool", TOOLS), ("base", BASES))}
GIVEN["start"] = ",".join(f"{angle:.9f}" for angle in np.degrees(Q[0]))


def execute(files):
    shown = lambda frames: {number: as_shown(numbers) for number, numbers in frames.items()}
    return inform.execute(files, ARM, Q[0], shown(TOOLS), shown(BASES), PULSES)


def pose(i, name=None, tool=0, base=None):
    x, y, z, c, b, a = numbers_zyx(
        np.linalg.inv(zyx(*BASES.get(base, (0,) * 6))) @ ARM.pose(Q[i]) @ zyx(*TOOLS[tool]))
    return f"{name or f'C{i:05d}'}=" + ",".join(f"{value:.7f}" for value in (x, y, z, a, b, c)) + "\n"


def pulses(i, name=None):
    return f"{name or f'C{i:05d}'}=" + ",".join(str(round(v)) for v in Q[i] * np.array(PULSES)) + "\n"


def files(places, moves, head="///TOOL 0\n"):
    text = (f"/JOB\n//NAME PROG\n//POS\n///NPOS 9,0,0,0,0,0\n{head}{places}//INST\n///DATE 2026/01/01 12:00\n"
            f"///ATTR SC,RW\n///GROUP1 RB1\nNOP\n{moves}\nEND\n")
    return {"prog.jbi": text.replace("\n", "\r\n").encode()}


PULSE = "///POSTYPE PULSE\n///PULSE\n"
ROBOT_FRAME = "///POSTYPE ROBOT\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0\n"
BASE_FRAME = ROBOT_FRAME.replace("ROBOT", "BASE")
USER = "///USER {}\n///POSTYPE USER\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0\n"
TWO = PULSE + pulses(1) + pulses(2)
RIGHT = {
    "pulses": (TWO, "MOVJ C00001 VJ=50.00\nMOVL C00002 V=100.0 PL=1"),
    "pulses beside poses of three frames": (
        PULSE + pulses(1) + BASE_FRAME + pose(2) + USER.format(1) + pose(3, base=1) + USER.format(2)
        + pose(4, base=2) + ROBOT_FRAME + pose(5),
        "MOVJ C00001 VJ=50.00\nMOVL C00002 V=9.0\nMOVL C00003 V=9.0\nMOVL C00004 V=9.0\nMOVJ C00005 VJ=1.00"),
    "tools change between positions": (
        ROBOT_FRAME + pose(1) + "///TOOL 5\n" + pose(2, tool=5) + "///TOOL 0\n" + pose(3),
        "MOVJ C00001 VJ=50.00\nMOVL C00002 V=9.0\nMOVL C00003 V=9.0"),
    "positions back from poses to pulses": (
        ROBOT_FRAME + pose(1) + PULSE + pulses(2), "MOVJ C00001 VJ=50.00\nMOVJ C00002 VJ=50.00"),
    "motions in another order than the positions, one twice": (
        TWO, "MOVJ C00002 VJ=50.00\nMOVJ C00001 VJ=50.00\nMOVJ C00002 VJ=50.00"),
    "comments that look like motions": (TWO, "'MOVJ C00002 VJ=50.00\nMOVJ C00001 VJ=50.00\n"
                                             "'C00001=1,2,3,4,5,6"),
    "arcs and splines": (
        ROBOT_FRAME + pose(1) + pose(2) + pose(3) + pose(4),
        "MOVJ C00001 VJ=50.00\nMOVC C00002 V=9.0\nMOVC C00003 V=9.0\nMOVS C00004 V=9.0"),
    "loops": (TWO, "SET B000 0\n*AGAIN\nMOVJ C00001 VJ=50.00\nMOVL C00002 V=9.0\nINC B000\n"
                   "JUMP *AGAIN IF B000<2"),
    "waiting for the end": (TWO, "MOVJ C00001 VJ=50.00 NWAIT\nMOVJ C00002 VJ=50.00 PL=0 ACC=20 DEC=20"),
}
REFUSED = {
    "a motion along a conveyor": (TWO, "MOVJ C00001 VJ=50.00\nSYMOVL C00002 V=9.0 CV#(1)"),
    "a conveyor": (TWO, "SYSTART CV#(1) STP=10.0\nMOVJ C00001 VJ=50.00"),
    "a motion of two arms together": (TWO, "MOVJ C00001 VJ=50.00\n+MOVL C00002 V=9.0"),
    "a motion of a second arm to the first": (TWO, "MOVJ C00001 VJ=50.00\nSMOVL C00002 V=9.0"),
    "a position variable": (TWO, "MOVJ C00001 VJ=50.00\nMOVJ P001 VJ=50.00"),
    "a step": (TWO, "MOVJ C00001 VJ=50.00\nIMOV P001 V=9.0 RF"),
    "a shift": (TWO, "SFTON P001 BF\nMOVJ C00001 VJ=50.00\nSFTOF"),
    "a shift of one motion": (TWO, "MOVJ C00001 VJ=50.00\nMOVL C00002 V=9.0 +P001"),
    "a tool in the motion": (TWO, "MOVJ C00001 VJ=50.00\nMOVL C00002 V=9.0 TL#(5)"),
    "a shift that a register makes": (TWO, "MSHIFT PX000 BF PX001 PX002\nSFTON P000\nMOVJ C00001 VJ=50.00"),
    "a position in the tool frame": (
        ROBOT_FRAME.replace("ROBOT", "TOOL") + pose(1), "MOVJ C00001 VJ=50.00"),
    "a user frame that is not known": (USER.format(7) + pose(1), "MOVJ C00001 VJ=50.00"),
    "a tool that is not known": ("///TOOL 9\n" + ROBOT_FRAME + pose(1), "MOVJ C00001 VJ=50.00"),
    "a user frame that the job makes": (
        USER.format(1) + pose(1, base=1), "MFRAME UF#(1) C00001 C00002 C00003\nMOVJ C00001 VJ=50.00"),
    "a position that is given twice": (TWO + pulses(3, "C00001"), "MOVJ C00001 VJ=50.00"),
    "a position that is not there": (TWO, "MOVJ C00007 VJ=50.00"),
    "a base that moves": (TWO + "BC00001=100\n", "MOVJ C00001 BC00001 VJ=50.00"),
    "a second arm": (TWO, "MOVJ C00001 VJ=50.00  +MOVJ C00002 VJ=50.00"),
}


@pytest.mark.parametrize("name", RIGHT)
def test_every_motion_reaches_what_the_job_meant(tmp_path, name):
    corrected(tmp_path, ROBOT, execute, files(*RIGHT[name]), **GIVEN)


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_one_right_number_is_refused(tmp_path, name):
    refused(tmp_path, ROBOT, files(*REFUSED[name]), **GIVEN)
