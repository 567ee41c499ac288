"""KRL programs with traps: executed before and after `compensate` by an interpreter that knows no reader."""

import numpy as np
import pytest

import exactarm as ea
from compensation_cell import BASE, TOOL, nearby, sign_bits
from interpreters import krl
from interpreters.motion import numbers_zyx, zyx
from interpreters.verdict import arm_of, compensate, corrected, refused, robot_of

OTHER_TOOL = (10.0, 20.0, 150.0, -30.0, 10.0, 5.0)
OTHER_BASE = (-80.0, 60.0, 40.0, 7.0, 2.0, -6.0)
TEXT = lambda name, values: f"{name}={','.join(map(str, values))}"
RECORD = lambda values: "{" + ",".join(f"{key} {value}" for key, value in zip("XYZABC", values)) + "}"
OPTIONS = {"tool": [TEXT(1, TOOL), TEXT(2, OTHER_TOOL)], "base": [TEXT(1, BASE), TEXT(2, OTHER_BASE)]}
ROBOT = robot_of()
ARM = arm_of(ROBOT)
Q = nearby(ROBOT, 6)


def execute(files):
    return krl.execute(files, ARM, Q[0], {1: TOOL, 2: OTHER_TOOL}, {1: BASE, 2: OTHER_BASE})


def tip(i, tool=TOOL, base=BASE):
    return np.linalg.inv(zyx(*base)) @ ARM.pose(Q[i]) @ zyx(*tool)


def pose(i, tool=TOOL, base=BASE, order="XYZABC", turn=True, **changed):
    """The aggregate of point i under a tool and base."""
    fields = dict(zip("XYZABC", (f"{v:.6f}" for v in numbers_zyx(tip(i, tool, base)))))
    if turn:
        fields |= {"S": str(4 * int(Q[i][4] < 0)), "T": str(sign_bits(Q[i]))}
        order = [*order, "S", "T"]
    fields |= changed
    return "{" + ",".join(f"{name} {fields[name]}" for name in order if fields.get(name)) + "}"


def axes(i, names="123456"):
    return "{" + ",".join(f"A{k} {np.degrees(Q[i][int(k) - 1]):.7f}" for k in names) + "}"


def files(source, data="", routines=""):
    wrap = lambda text: "".join(f"{line.strip()}\r\n" for line in text.strip().splitlines())
    source = "&ACCESS RVP\r\nDEF prog()\r\n" + wrap(source) + "END\r\n" + wrap(routines)
    return {"prog.src": source.encode(),
            "prog.dat": ("DEFDAT prog\r\n" + wrap(data) + "ENDDAT\r\n").encode()}


P = {i: f"DECL E6POS XP{i}={pose(i)}\n" for i in range(6)}
SET = "$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[1]\n"
RIGHT = {
    "tool and base change between motions": (
        f"""{SET}PTP XP1
        $TOOL=TOOL_DATA[2]
        PTP {pose(2, OTHER_TOOL)}
        $BASE=BASE_DATA[2]
        LIN {pose(3, OTHER_TOOL, OTHER_BASE)}
        BAS(#TOOL,1)
        BAS(#BASE,1)
        LIN {pose(4)} C_DIS""", P[1]),
    "tool and base as numbers": (
        f"""$TOOL={{X 85.0,Y -30.0,Z 210.0,A 20.0,B 35.0,C -15.0}}
        $BASE={{C 4.0,B -3.0,A 12.0,Z 260.0,Y -120.0,X 350.0}}
        PTP XP1
        PTP {axes(2)}
        $BASE=$NULLFRAME
        PTP {pose(3, TOOL, (0,) * 6)}""", P[1]),
    "fields in another order, in other letters, with blanks": (
        f"{SET}ptp xP1\nPtp {pose(2, order='CBAZYX')} c_ptp\nlin {pose(3).replace(',', ' , ').lower()}",
        "decl e6pos Xp1 = " + pose(1, order="ZXYCAB")),
    "comments and strings that look like points": (
        f"""{SET};PTP {{X 1,Y 2,Z 3,A 4,B 5,C 6}}
        MSG[]="PTP XP2; {{X 1}}" ; PTP XP3
        PTP XP1 ; {{X 1,Y 2}}""", P[1] + ";" + P[2]),
    "a point on the way": (f"{SET}PTP XP1\nCIRC XP2,{pose(3)}\nSCIRC XP4,XP5 C_DIS",
                           P[1] + P[2] + P[4] + P[5]),
    "inline forms with another tool than their neighbours": (
        f"""{SET}PTP XP1
        ;FOLD PTP P2 Vel=100 % PDAT1 Tool[2] Base[2];%{{PE}}
        $BWDSTART=FALSE
        PDAT_ACT=PPDAT1
        FDAT_ACT=FP2
        BAS(#PTP_PARAMS,100)
        PTP XP2
        ;ENDFOLD
        PTP {pose(3, OTHER_TOOL, OTHER_BASE)}""",
        P[1] + f"DECL E6POS XP2={pose(2, OTHER_TOOL, OTHER_BASE)}\nDECL PDAT PPDAT1={{VEL 100.0,ACC 100.0}}\n"
        'DECL FDAT FP2={TOOL_NO 2,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " "}'),
    "forms of KSS 8": (
        f"""{SET}PTP XP1
        SPTP XP2 WITH $VEL_AXIS[1]=SVEL_JOINT(100.0), $TOOL=STOOL2(FP2), $BASE=SBASE(FP2.BASE_NO)
        SLIN XP3""",
        P[1] + P[3] + f"DECL E6POS XP2={pose(2, OTHER_TOOL, OTHER_BASE)}\n"
        'DECL FDAT FP2={TOOL_NO 2,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " "}'),
    "a loop and a routine": (
        f"""{SET}FOR I=1 TO 3
        PTP XP1
        step()
        ENDFOR
        PTP XP3""", P[1] + P[2] + P[3] + "DECL INT I", "DEF step()\nPTP XP2\nEND"),
    "axis angles": (f"{SET}PTP XHOME\nPTP {axes(2, '654321')}", "DECL E6AXIS XHOME=" + axes(1)),
    "an angle of a whole turn more": (
        f"{SET}PTP XP1", "DECL E6POS XP1=" + pose(1, A=f"{numbers_zyx(tip(1))[3] + 360:.6f}")),
    "two motions by a semicolon's side": (f"{SET}PTP XP1 ;LIN XP2\nLIN XP2", P[1] + P[2]),
    "a spline": (f"{SET}PTP XP1\nSPLINE\nSPL XP2\nSLIN {pose(3)}\nENDSPLINE", P[1] + P[2]),
    "a spline block by inline forms": (
        f"""{SET}PTP XP1
        SPLINE WITH $VEL=SVEL_CP(0.2), $TOOL=STOOL2(FS1), $BASE=SBASE(FS1.BASE_NO), $APO=SAPO(0)
        SPL XP2
        SLIN XP3 WITH $TOOL=STOOL2(FP3), $BASE=SBASE(FP3.BASE_NO)
        SPL XP4
        ENDSPLINE
        LIN XP5""",
        P[1] + P[3] + P[5] + f"DECL E6POS XP2={pose(2, OTHER_TOOL, OTHER_BASE)}\n"
        f"DECL E6POS XP4={pose(4, OTHER_TOOL, OTHER_BASE)}\n"
        'DECL FDAT FS1={TOOL_NO 2,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " "}\n'
        'DECL FDAT FP3={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE,POINT2[] " "}'),
    "S and T as bits": (
        f"{SET}PTP XP1\nPTP XP2", "DECL POS XP1=" + pose(1, S=f"'B{4 * int(Q[1][4] < 0):03b}'",
                                                          T=f"'B {sign_bits(Q[1]):06b}'")
        + "\nDECL POS XP2=" + pose(2, S=f"'H{4 * int(Q[2][4] < 0):X}'", T=f"'h{sign_bits(Q[2]):02x}'")),
    "a point of the routine alone": (
        f"DECL E6POS P7\n{SET}P7={pose(1)}\nPTP P7\nPTP {{E6POS: {pose(2)[1:]} C_PTP\n"
        f"LIN {{FRAME: {pose(3)[1:]}", ""),
    "a base that both ways of a branch agree on": (
        f"{SET}IF I==1 THEN\n$BASE=BASE_DATA[2]\nPTP XP1\nELSE\n$BASE=BASE_DATA[2]\nPTP XP2\nENDIF\nLIN XP3",
        "INT I=2\n" + "".join(f"DECL E6POS XP{i}={pose(i, TOOL, OTHER_BASE)}\n" for i in (1, 2, 3))),
    "the head of every program": (
        f"""GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM()
        INTERRUPT ON 3
        BAS(#INITMOV,0)
        {SET}PTP XP1""", P[1]),
    "the world as base, no tool": (
        "$TOOL=$NULLFRAME\n$BASE=$WORLD\nPTP XP1\n$BASE=BASE_DATA[0]\nLIN XP2",
        "".join(f"DECL GLOBAL E6POS XP{i}={pose(i, (0,) * 6, (0,) * 6)}\n" for i in (1, 2))),
    "numbers in every form": (
        f"{SET}PTP XP1\nPTP XP2", "DECL E6POS XP1=" + pose(1, X=f"{numbers_zyx(tip(1))[0] / 1e2:.8f}E2",
                                                          Y=f"{numbers_zyx(tip(1))[1]:+.6f}") + "\n" + P[2]),
}
REFUSED = {
    "a point that a routine changes which is given it": (
        f"{SET}raise(XP1)\nPTP XP1", P[1], "DEF raise(P:OUT)\nDECL E6POS P\nP.Z=P.Z+10.0\nEND"),
    "a point that a routine sets which is given it": (
        f"{SET}raise(XP1)\nPTP XP1", P[1], "DEF raise(P)\nE6POS P\nP=XP2\nEND"),
    "a base of an external axis": (f"{SET}PTP XP1\nBAS(#EX_BASE,17)\nLIN XP2", P[1] + P[2]),
    "a tool before what may take it back": (f"{SET}BAS(#INITMOV,0)\nPTP XP1", P[1]),
    "an orientation that stays": (f"{SET}PTP XP1\n$ORI_TYPE=#CONSTANT\nLIN XP2", P[1] + P[2]),
    "an orientation that stays, by its form": (
        f"{SET}PTP XP1\nLDAT_ACT=LCPDAT1\nBAS(#CP_PARAMS,2)\nLIN XP2",
        P[1] + P[2] + "DECL LDAT LCPDAT1={VEL 2.0,ACC 100.0,APO_DIST 100.0,APO_FAC 50.0,ORI_TYP #CONSTANT}"),
    "a base that a trigger sets": (
        f"{SET}PTP XP1\nTRIGGER WHEN PATH=0 DELAY=0 DO $BASE=BASE_DATA[2]\nLIN XP2\nLIN XP3",
        P[1] + P[2] + P[3]),
    "a tool that an interrupt sets": (
        f"INTERRUPT DECL 5 WHEN $IN[1]==TRUE DO hand()\nINTERRUPT ON 5\n{SET}PTP XP1", P[1],
        "DEF hand()\n$TOOL=TOOL_DATA[2]\nEND"),
    "a path that a sensor corrects": (f"{SET}PTP XP1\nRET=RSI_ON(#RELATIVE)\nLIN XP2", P[1] + P[2]),
    "a place of the arm that the program sets": (
        f"{SET}$ROBROOT={RECORD((0, 0, 500.0, 0, 0, 0))}\nPTP XP1", P[1]),
    "a base that is numbers and an offset": (
        f"{SET}$BASE={RECORD(BASE)}:BASE_DATA[2]\nPTP XP1", P[1]),
    "a tool that is numbers and an offset, in the data list": (
        f"{SET}$TOOL=MINE\nPTP XP1",
        P[1] + f"DECL FRAME MINE={RECORD(TOOL)}:{RECORD((10.0, 0, 0, 0, 0, 0))}"),
    "a point that is numbers and an offset": (
        f"{SET}XP1={pose(1)} : {RECORD((10.0, 0, 0, 0, 0, 0))}\nPTP XP1", "DECL E6POS XP1"),
    "a load that the program sets": (f"{SET}$LOAD={{M 5.0,CM {{X 0,Y 0,Z 100,A 0,B 0,C 0}}}}\nPTP XP1", P[1]),
    "a load that the program picks": (f"{SET}$LOAD=LOAD_DATA[3]\nPTP XP1", P[1]),
    "a mass that the program sets": (f"{SET}$LOAD.M=5.0\nPTP XP1", P[1]),
    "two points in one declaration": (f"{SET}PTP XP2", f"DECL E6POS XP1={pose(1)},XP2={pose(2)}"),
    "an arc with an angle": (f"{SET}PTP XP1\nCIRC XP2,{pose(3)},CA 180", P[1] + P[2]),
    "S as bits that are none": (f"{SET}PTP XP1", "DECL POS XP1=" + pose(1, S="'B012'")),
    "a jump past a tool": (f"{SET}PTP XP1\nGOTO NEXT\n$TOOL=TOOL_DATA[2]\nNEXT:\nPTP XP2", P[1] + P[2]),
    "a loop that calls what sets a tool": (
        f"{SET}FOR I=1 TO 2\nPTP XP1\nhand()\nENDFOR", P[1] + "INT I", "DEF hand()\n$TOOL=TOOL_DATA[2]\nEND"),
    "a frame with a name, of which a component is set": (
        f"{SET}MINE.Z=70.0\n$BASE=MINE\nPTP XP1",
        f"{P[1]}DECL FRAME MINE={{X 1,Y 2,Z 3,A 0,B 0,C 0}}"),
    "a tool from an aggregate that leaves numbers out": (f"{SET}$TOOL={{Z 100.0}}\nPTP XP1", P[1]),
    "a table of tools that the program fills": (
        f"TOOL_DATA[1]={{X 1,Y 2,Z 3,A 0,B 0,C 0}}\n{SET}PTP XP1", P[1]),
    "an external axis": (f"{SET}PTP XP1", "DECL E6POS XP1=" + pose(1)[:-1] + ",E1 10.0}"),
    "a point that belongs to two tools by its form": (
        f"{SET}PTP XP1", P[1] + 'DECL FDAT FP1={TOOL_NO 2,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " "}'),
    "a component that the target leaves out": (f"{SET}PTP XP1\nLIN {{Z {numbers_zyx(tip(1))[2] + 10.0:.4f}}}",
                                               P[1]),
    "one axis that moves alone": (f"PTP {axes(1)}\nPTP {axes(2, '3')}", ""),
    **{f"a motion with {words}": (
        f"{SET}PTP XP1\nSLIN XP2 WITH {words}\nSLIN XP3", P[1] + P[2] + P[3]
        + 'DECL FDAT FP2={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE,POINT2[] " "}')
        for words in ("$TOOL=STOOL2(FP2), $BASE=BASE_DATA[2]", "$BASE=BASE_DATA[1], $TOOL=TOOL_DATA[2]",
                      "$IPO_MODE=#TCP", "$TOOL=STOOL2(FP2), $BASE=SBASE(FP2.BASE_NO), $IPO_MODE=#TCP")},
    "a shift of a point before its motion": (f"{SET}PTP XP1\nXP2=XP1\nXP2.Z=XP2.Z+10\nPTP XP2", P[1] + P[2]),
    "a component that the program sets": (f"{SET}XP1.X=XP1.X+5.0\nPTP XP1", P[1]),
    "a point that is computed": (f"{SET}PTP XP1\nPTP XP2:{{X 5,Y 0,Z 0,A 0,B 0,C 0}}", P[1] + P[2]),
    "a base that is computed": (f"{SET}$BASE=BASE_DATA[1]:BASE_DATA[2]\nPTP XP1", P[1]),
    "a base of which one number changes": (f"{SET}PTP XP1\n$BASE.Z=$BASE.Z+5\nPTP XP2", P[1] + P[2]),
    "a table of bases that the program changes": (
        f"BASE_DATA[1].X=340.0\n{SET}PTP XP1", P[1]),
    "a relative motion": (f"{SET}PTP XP1\nLIN_REL {{Z 10.0}}", P[1]),
    "a relative motion of axes": (f"{SET}PTP XP1\nPTP_REL {{A1 2.0}}\nPTP XP2", P[1] + P[2]),
    "a point that is assigned from another": (f"{SET}XP1=XP2\nPTP XP1", P[1] + P[2]),
    "a point that gets new numbers": (f"{SET}XP1={pose(2)}\nPTP XP1", P[1]),
    "a point of a list": (f"{SET}FOR I=1 TO 2\nPTP XQ[I]\nENDFOR",
                          f"DECL INT I\nDECL E6POS XQ[2]\nXQ[1]={pose(1)}\nXQ[2]={pose(2)}"),
    "a point as an argument": (f"{SET}go(XP1)", P[1], "DEF go(X:IN)\nDECL E6POS X\nPTP X\nEND"),
    "a point of its routine with a name of the data list": (
        f"{SET}PTP XP1\nsub()", P[1], f"DEF sub()\nDECL POS XP1\nXP1={pose(2)}\nPTP XP1\nEND"),
    "one point with two tools": (f"{SET}PTP XP1\n$TOOL=TOOL_DATA[2]\nPTP XP1", P[1]),
    "a tool that hangs on a branch": (f"{SET}IF I==1 THEN\n$TOOL=TOOL_DATA[2]\nENDIF\nPTP XP1",
                                      P[1] + "INT I=2"),
    "a tool at rest": (f"{SET}$IPO_MODE=#TCP\nPTP XP1", P[1]),
    "a tool number from a variable": ("N=2\n$TOOL=TOOL_DATA[N]\n$BASE=BASE_DATA[1]\nPTP XP1",
                                      f"INT N=1\nDECL E6POS XP1={pose(1, OTHER_TOOL)}"),
    "a tool set in a routine": (f"{SET}hand()\nPTP XP1", f"DECL E6POS XP1={pose(1, OTHER_TOOL)}",
                                "DEF hand()\n$TOOL=TOOL_DATA[2]\nEND"),
}


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.slow
def test_every_motion_reaches_what_the_program_meant(tmp_path, name):
    corrected(tmp_path, ROBOT, execute, files(*RIGHT[name]), **OPTIONS)


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.slow
def test_what_has_no_one_right_number_is_refused(tmp_path, name):
    refused(tmp_path, ROBOT, files(*REFUSED[name]), **OPTIONS)


def test_a_first_point_of_several_branches_is_told_where_nothing_says_which(tmp_path):
    program = files(f"{SET}LIN {pose(1, turn=False)}")
    said = {}
    for name, start in (("guessed", {}), ("said", {"start": ",".join(map(str, np.degrees(Q[0])))})):
        (tmp_path / name).mkdir()
        paths = [tmp_path / name / file for file in program]
        for path in paths:
            path.write_bytes(program[path.name])
        result = ea.compensate(ROBOT, paths, points="calculated", threads=1, **OPTIONS, **start)
        said[name] = [words for words in result.json["warnings"] if "on which branch" in words]
    assert len(said["guessed"]) == 1 and "(line 5)" in said["guessed"][0] and not said["said"]


def test_axis_angles_are_corrected_beside_an_external_axis_which_moves_the_arm_as_one_body(tmp_path):
    """On a track the flange is wrong by the same, seen from the arm's own base; a pose is refused there."""
    there, here = (compensate(tmp_path, ROBOT, files(f"PTP {axes(1)[:-1]},E1 {away}}}"))["prog.src"]
                   for away in ("850.0", "9E9"))
    assert there.replace(b"E1 850.0", b"E1 9E9") == here != files(f"PTP {axes(1)[:-1]},E1 9E9}}")["prog.src"]


def test_the_middle_of_a_circle_that_is_turned_is_told(tmp_path):
    """KUKA takes its place alone: its orientation is that of the way between both ends."""
    said = []
    for turned in (0.0, 20.0):
        x, y, z, a, b, c = numbers_zyx(tip(1))
        end, middle = (f"{{X {x + dx:.4f},Y {y:.4f},Z {z + dz:.4f},A {a + angle:.4f},B {b:.4f},C {c:.4f}}}"
                       for dx, dz, angle in ((80.0, 0.0, 0.0), (40.0, 30.0, turned)))
        program = files(f"{SET}PTP XP1\nCIRC {middle},{end}", P[1])
        paths = [tmp_path / name for name in program]
        for path in paths:
            path.write_bytes(program[path.name])
        result = ea.compensate(ROBOT, paths, points="calculated", threads=1, **OPTIONS)
        said.append([words for words in result.json["warnings"] if "middle points of circles" in words])
    assert not said[0] and len(said[1]) == 1 and "line 6" in said[1][0]


@pytest.mark.parametrize("motion", [
    "PTP XP2:{X 5,Y 0,Z 0,A 0,B 0,C 0}", f"LIN {pose(2)}:{RECORD((0, 0, 10.0, 0, 0, 0))}", "LIN XQ[2]",
    f"CIRC XP2,{pose(3)},CA 180"])
def test_a_motion_to_no_place_of_its_own_may_be_left_as_it_is(tmp_path, motion):
    """A sum of frames and an arc with an angle stopped the run whatever --keep-refused said."""
    program = files(f"{SET}PTP XP1\n{motion}\nLIN {pose(4)}", P[1] + P[2])
    refused(tmp_path, ROBOT, program, **OPTIONS)
    written = compensate(tmp_path, ROBOT, program, keep_refused=True, **OPTIONS)
    line = lambda content, k: content["prog.src"].splitlines()[k]
    assert line(written, 5) == line(program, 5) and line(written, 6) != line(program, 6)
    assert written["prog.dat"].splitlines()[1] != program["prog.dat"].splitlines()[1]  # XP1


def test_points_of_an_arm_with_absolute_accuracy_are_told(tmp_path):
    """Bit 4 of S: once for all of them."""
    status = lambda i: str(16 + 4 * int(Q[i][4] < 0))
    data = "".join(f"DECL E6POS XP{i}={pose(i, S=status(i))}\n" for i in (1, 2))
    program = files(f"{SET}PTP XP1\nPTP XP2", data)
    paths = [tmp_path / name for name in program]
    for path in paths:
        path.write_bytes(program[path.name])
    result = ea.compensate(ROBOT, paths, points="calculated", threads=1, **OPTIONS)
    (told,) = [words for words in result.json["warnings"] if "bit 4 of S" in words]
    assert told.startswith("XP1 (line 2)")
    plain = tmp_path / "plain"
    plain.mkdir()
    corrected(plain, ROBOT, execute, program, **OPTIONS)
