"""Fanuc TP programs with traps: executed before and after `compensate` by an interpreter that knows no
reader."""

import numpy as np
import pytest

from compensation_cell import BASE, TOOL, nearby
from interpreters import fanuc_tp
from interpreters.motion import numbers_zyx, zyx
from interpreters.verdict import arm_of, corrected, refused, robot_of

OTHER_TOOL = (80.0, -20.0, 200.0, 22.0, 30.0, -10.0)
OTHER_BASE = (-80.0, 60.0, 40.0, 7.0, 2.0, -6.0)
ROBOT = robot_of(coupling=((3, 2, 1.0),))
COUPLING = np.eye(6)
COUPLING[2, 1] = 1.0
ARM = arm_of(ROBOT)
Q = nearby(ROBOT, 6)
TOOLS, BASES = {4: TOOL, 5: OTHER_TOOL}, {3: BASE, 6: OTHER_BASE}
as_shown = lambda numbers: tuple(np.array(numbers)[[0, 1, 2, 5, 4, 3]])  # W, P, R
GIVEN = {option: [f"{number}={','.join(map(str, as_shown(numbers)))}" for number, numbers in frames.items()]
         for option, frames in (("tool", TOOLS), ("base", BASES))}
GIVEN["start"] = ",".join(f"{angle:.9f}" for angle in np.degrees(np.linalg.solve(COUPLING, Q[0])))


def execute(files):
    shown = lambda frames: {number: as_shown(numbers) for number, numbers in frames.items()}
    return fanuc_tp.execute(files, ARM, Q[0], shown(TOOLS), shown(BASES), COUPLING)


def place(i, number=None, tool=4, base=3, more="", comment=""):
    x, y, z, r, p, w = numbers_zyx(
        np.linalg.inv(zyx(*BASES.get(base, (0,) * 6))) @ ARM.pose(Q[i]) @ zyx(*TOOLS[tool]))
    return (f"P[{number or i}{comment}]{{\n   GP1:\n"
            f"\tUF : {base}, UT : {tool},\t\tCONFIG : 'N U T, 0, 0, 0',\n"
            f"\tX = {x:12.6f}  mm,\tY = {y:12.6f}  mm,\tZ = {z:12.6f}  mm,\n"
            f"\tW = {w:12.7f} deg,\tP = {p:12.7f} deg,\tR = {r:12.7f} deg{more}\n}};\n")


def joints(i, tool=4, base=3):
    shown = np.degrees(np.linalg.solve(COUPLING, Q[i]))
    body = ",\n\t".join(f"J{k}= {angle:12.7f} deg" for k, angle in enumerate(shown, start=1))
    return f"P[{i}]{{\n   GP1:\n\tUF : {base}, UT : {tool},\n\t{body}\n}};\n"


def files(lines, places):
    rows = lines.rstrip().replace("\n    :", "$").splitlines()  # $: goes on in the next line
    numbered = "".join(f"{i:4d}:{row}    ;\n" for i, row in enumerate(rows, start=1)).replace("$",
                                                                                              "    \n    :")
    return {"prog.ls": f"/PROG  PROG\n/ATTR\nCOMMENT = \"J P[3] 100% FINE ;\";\n/MN\n{numbered}/POS\n"
                       f"{places}/END\n"
            .encode()}


ALL = "".join(place(i) for i in range(1, 6))
GROUP2 = "\n   GP2:\n\tUF : 0, UT : 1,\n\tJ1= 10.000 deg,\n\tJ2= 1.000 deg"
SET = "  UFRAME_NUM=3\n  UTOOL_NUM=4\n"
RIGHT = {
    "joint and straight motions": (f"{SET}J P[1] 100% FINE\nL P[2] 500mm/sec CNT100 ACC50", ALL),
    "frames change between motions": (
        f"{SET}J P[1] 100% FINE\n  UTOOL_NUM=5\nL P[2] 100mm/sec FINE\n  UFRAME_NUM=6\n"
        f"L P[3] 100mm/sec FINE\n"
        "  UFRAME_NUM=0\nL P[4] 9mm/sec FINE",
        place(1) + place(2, tool=5) + place(3, tool=5, base=6) + place(4, tool=5, base=0)),
    "an arc over two lines": (f"{SET}J P[1] 100% FINE\nC P[2]\n    :  P[3] 100mm/sec FINE", ALL),
    "joint angles, the third from the horizon": (f"{SET}J P[1] 100% FINE\nJ P[2] 50% CNT10",
                                                 joints(1) + joints(2)),
    "comments that look like motions": (
        f"  !J P[3] 100% FINE\n  --eg:J P[4] 100% FINE\n  //J P[5] 100% FINE\n{SET}J P[1:J P 4] 100% FINE\n"
        f"L P[2] "
        "9mm/sec FINE", place(1, comment=':"J P 4"') + place(2) + place(3) + place(4) + place(5)),
    "two groups": (f"{SET}J P[1] 100% FINE", place(1, more=GROUP2)),
    "two groups, the second first": (f"{SET}J P[1] 100% FINE",
                                     place(1).replace("   GP1:", f"{GROUP2}\n   GP1:")),
    "numbers and units without blanks": (
        f"{SET}J P[1] 100% FINE", place(1).replace(" = ", "=").replace("  mm", "mm").replace(" deg", "deg")),
    "positions in another order, a number twice in the text": (
        f"{SET}J P[12] 100% FINE\nL P[1] 9mm/sec FINE\nL P[12] 9mm/sec FINE", place(2, 12) + place(1)),
    "jumps and loops": (
        f"{SET}  R[1]=0\n  LBL[1]\nJ P[1] 100% FINE\nL P[2] 9mm/sec FINE\n  R[1]=R[1]+1\n"
        f"  IF R[1]<2,JMP LBL[1]\n"
        "  FOR R[2]=1 TO 2\nL P[3] 9mm/sec FINE\n  ENDFOR", ALL),
    "words behind a motion": (
        f"{SET}J P[1] 100% CNT0 ACC100 TB    .10sec,P-SPS\nL P[2] R[9]mm/sec FINE TA .2sec,DO[1]=ON\n"
        "L P[3] 9mm/sec FINE Wjnt PTH RTCPX" .replace(" RTCPX", ""), ALL),
    "an extended axis at zero": (f"{SET}J P[1] 100% FINE", place(1, more=",\n\tE1=     0.000  mm")),
}
REFUSED = {
    "a tool whose number is in a register, that the program sets": (
        f"{SET}  UTOOL[R[1:tool]]=PR[2]\nJ P[1] 100% FINE", ALL),
    "a pallet": (f"{SET}J P[1] 100% FINE\nL PAL_1[BTM] 100mm/sec FINE\nL P[2] 100mm/sec FINE", ALL),
    "an offset by touching": (f"{SET}  Touch Offset PR[5]\nJ P[1] 100% FINE\n  Touch Offset End", ALL),
    "a seam that is tracked": (f"{SET}J P[1] 100% FINE\n  Track TAST[1] RPM[1]\nL P[2] 9mm/sec FINE", ALL),
    "a motion that ends where it touches": (f"{SET}J P[1] 100% FINE\nL P[2] 9mm/sec FINE Search[-Z]", ALL),
    "a spline": (f"{SET}J P[1] 100% FINE\nS P[2] 9mm/sec FINE\nS P[3] 9mm/sec FINE", ALL),
    "an increment": (f"{SET}J P[1] 100% FINE\nL P[2] 9mm/sec FINE INC", ALL),
    "an offset": (f"{SET}J P[1] 100% FINE Offset,PR[1]", ALL),
    "an offset of the tool": (f"{SET}J P[1] 100% FINE Tool_Offset,PR[1]", ALL),
    "an offset that a condition named": (f"{SET}  OFFSET CONDITION PR[1]\nJ P[1] 100% FINE Offset", ALL),
    "a register": (f"{SET}J PR[1] 100% FINE", ALL),
    "a number from a register": (f"{SET}  R[1]=1\nJ P[R[1]] 100% FINE", ALL),
    "another frame is active than that of the position": (
        "  UFRAME_NUM=6\n  UTOOL_NUM=4\nJ P[1] 100% FINE", ALL),
    "another tool is active than that of the position": (f"{SET}  UTOOL_NUM=5\nJ P[1] 100% FINE", ALL),
    "a frame that the program sets": (f"{SET}  UFRAME[3]=PR[2]\nJ P[1] 100% FINE", ALL),
    "a tool that the program sets": (f"{SET}  UTOOL[4]=PR[2]\nJ P[1] 100% FINE", ALL),
    "an element of a frame": (f"{SET}  PR[2,3]=PR[2,3]+5\n  UFRAME[3:part]=PR[2]\nJ P[1] 100% FINE", ALL),
    "a position that the program sets": (f"{SET}  P[1]=LPOS\nJ P[1] 100% FINE", ALL),
    "an unknown frame": ("  UFRAME_NUM=8\n  UTOOL_NUM=4\nJ P[1] 100% FINE", place(1).replace("UF : 3",
                                                                                             "UF : 8")),
    "a frame with a letter": (f"{SET}J P[1] 100% FINE", place(1).replace("UF : 3", "UF : F")),
    "an extended axis": (f"{SET}J P[1] 100% FINE", place(1, more=",\n\tE1=   100.000  mm")),
    "a tool at rest": (f"{SET}L P[1] 9mm/sec FINE RTCP", ALL),
    "a part that moves": (f"{SET}L P[1] 9mm/sec FINE COORD", ALL),
    "a correction by a camera": (f"{SET}L P[1] 9mm/sec FINE VOFFSET,VR[1]", ALL),
    "a position without numbers": (f"{SET}J P[1] 100% FINE", place(1).replace("X = ", "X = ******** mm !",
                                                                              1)),
    "a position given twice": (f"{SET}J P[1] 100% FINE", place(1) + place(2, 1)),
    "a load that the program chooses": (f"{SET}  PAYLOAD[2]\nJ P[1] 100% FINE", ALL),
}


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.slow
def test_every_motion_reaches_what_the_program_meant(tmp_path, name):
    corrected(tmp_path, ROBOT, execute, files(*RIGHT[name]), **GIVEN)


def test_a_comment_that_names_a_section_begins_none(tmp_path):
    told = files(f"{SET}J P[1] 100% FINE\nL P[2] 500mm/sec FINE", ALL)
    told["prog.ls"] = told["prog.ls"].replace(b"/ATTR\n", b'/ATTR\nOWNER = "see /MN, /POS";\n')
    corrected(tmp_path, ROBOT, execute, told, **GIVEN)


OF_CONTROLLERS = {
    "a conveyor": (b"/MN", b"/APPL\n\nLINE_TRACK;\n  LINE_TRACK_SCHEDULE_NUMBER      : 1;\n/MN"),
    "a frame that a system variable sets": (b"UFRAME_NUM=3 ", b"$MNUFRAME[1,3]=PR[2] "),
    "a listing in German": (b"COMMENT = ", b"EIGN. = AUROM;\nKOMMENTAR = "),
}


@pytest.mark.parametrize("name", OF_CONTROLLERS)
def test_what_else_moves_targets_is_refused(tmp_path, name):
    told = files(f"{SET}J P[1] 100% FINE", ALL)["prog.ls"]
    refused(tmp_path, ROBOT, {"prog.ls": told.replace(*OF_CONTROLLERS[name], 1)}, **GIVEN)


def test_a_conveyor_that_is_not_followed_is_none(tmp_path):
    told = files(f"{SET}J P[1] 100% FINE", ALL)
    told["prog.ls"] = told["prog.ls"].replace(
        b"/MN", b"/APPL\n\nLINE_TRACK;\n  LINE_TRACK_SCHEDULE_NUMBER      : 0;\n/MN", 1)
    corrected(tmp_path, ROBOT, execute, told, **GIVEN)


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_one_right_number_is_refused(tmp_path, name):
    refused(tmp_path, ROBOT, files(*REFUSED[name]), **GIVEN)
