"""RAPID programs with traps: executed before and after `compensate` by an interpreter that knows no
reader."""

import math

import numpy as np
import pytest

from compensation_cell import BASE, LOAD, TOOL, nearby
from exactarm.errors import InputError
from interpreters import rapid
from interpreters.motion import zyx
from interpreters.rapid import to_pose
from interpreters.verdict import arm_of, compensate, corrected, refused, robot_of, same_motions

OTHER_TOOL = (80.0, -20.0, 200.0, 22.0, 30.0, -10.0)
OTHER_BASE = (-80.0, 60.0, 40.0, 7.0, 2.0, -6.0)
OBJECT = (12.0, 34.0, -20.0, 3.0, 4.0, 5.0)
ROBOT = robot_of()
ARM = arm_of(ROBOT)
Q = nearby(ROBOT, 6)
NONE = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"


def execute(files):
    return rapid.execute(files, ARM, Q[0])


def row(values, digits=7):
    return "[" + ",".join(f"{value:.{digits}f}" for value in values) + "]"


def frame(numbers):
    position, turn = to_pose(zyx(*numbers))
    return f"[{row(position)},{row(turn, 10)}]"


def target(i, tool=TOOL, base=zyx(*BASE), outside=NONE, sign=1.0):
    position, turn = to_pose(np.linalg.inv(base) @ ARM.pose(Q[i]) @ zyx(*tool))
    quarters = [math.floor(angle / (np.pi / 2)) for angle in Q[i][[0, 3, 5]]]
    word = ",".join(map(str, [*quarters, int(Q[i][4] < 0)]))
    return f"[{row(position)},{row([sign * value for value in turn], 10)},[{word}],{outside}]"


def joints(i, outside=NONE):
    return f"[{row(np.degrees(Q[i]))},{outside}]"


def named(i, conf="conf"):
    position, turn, *_ = target(i).split("],[")
    return f"{position}],[{turn}],{conf},extj]"


HEAVY = f"[{LOAD[0]},{row(1e3 * np.array(LOAD[1]))},[1,0,0,0],0,0,0]"
LIGHT = "[0.001,[0,0,0.001],[1,0,0,0],0,0,0]"
DATA = f"""PERS tooldata torch:=[TRUE,{frame(TOOL)},{HEAVY}];
TASK PERS tooldata Hand:=[TRUE,{frame(OTHER_TOOL)},{LIGHT}];
PERS wobjdata table:=[FALSE,TRUE,"",{frame(BASE)},{frame((0,) * 6)}];
PERS wobjdata other:=[FALSE,TRUE,"",{frame(OTHER_BASE)},{frame(OBJECT)}];
"""
BOTH = zyx(*OTHER_BASE) @ zyx(*OBJECT)
P = {i: f"CONST robtarget p{i}:={target(i)};\n" for i in range(6)}
T = "torch\\WObj:=table;"
SPACED = target(2).replace(",", " ,\n").replace("]", " ]")
EXPONENT = f"[[{float(target(1)[2:].split(',')[0]) / 100.0:.9f}E+2,{target(1).split(',', 1)[1]}"
RIGHT = {
    "tools and work objects change between motions": (
        P[1], f"MoveJ p1,v100,fine,{T}\nMoveL {target(2, OTHER_TOOL)},v100,z10,Hand\\WObj:=table;\n"
              f"MoveL {target(3, OTHER_TOOL, BOTH)},v100,z10,hand\\WObj:=OTHER;\n"
              f"MoveL {target(4, TOOL, np.eye(4))},v100,z10,torch;\n"
              f"MoveL {target(5, TOOL, np.eye(4))},v5,z1,torch"
              "\\WObj:=wobj0;"),
    "configuration and external axes by their names, as offline programs have them": (
        f"VAR confdata conf:=[0,0,0,0];\nVAR extjoint extj := {NONE};\n",
        f"ConfL\\Off;\nMoveAbsJ {joints(0, 'extj')},v100,fine,{T}\nMoveL {named(1)},v100,fine,{T}\n"
        f"MoveL {named(2)},v100,z10,{T}"),
    "no tool": ("", f"MoveJ {target(1, (0,) * 6, np.eye(4))},v100,fine,tool0;"),
    "an instruction over several lines, letters large and small": (
        P[1], f"movej  P1 ,\n   v100\\V:=50 , fine\\Inpos:=inpos50 ,\n  TORCH \\wobj := Table ; ! MoveL p2;\n"
              f"MOVEL\n{SPACED}\n,v100,z10,{T}"),
    "options before the point and behind it": (
        P[1] + P[2], f"MoveJ \\Conc,p1\\ID:=5,v100\\T:=3,fine\\Inpos:=inpos50,{T}\n"
                     f"MoveL p2,v100,z10\\Z:=5,{T}"),
    "an arc": (P[1] + P[2] + P[3], f"MoveJ p1,v100,fine,{T}\nMoveC p2,p3,v100,z10,{T}"),
    "joint targets": (f"CONST jointtarget home:={joints(1)};\n",
                      f"MoveAbsJ home,v100,fine,torch;\nMoveAbsJ {joints(2)}\\NoEOffs,v100,fine,{T}"),
    "a routine that changes a copy of what it is given": (
        P[1], f"look p1;\nMoveJ p1,v100,fine,{T}\nENDPROC\nPROC see(robtarget q)\nENDPROC\n"
              "PROC show(PERS robtarget q)\nENDPROC\nPROC look(robtarget p)\np.trans.z:=0;"),
    "events on the way": (
        P[1] + P[2] + P[3], f"TriggJ p1,v100,io1,fine,{T}\nMoveLDO p2,v100,z10,{T[:-1]},do1,1;\n"
                            f"MoveLSync p3,v100,z10,{T[:-1]},\"sub\";\n"),
    "the other sign of a quaternion": (f"CONST robtarget p1:={target(1, sign=-1.0)};\n",
                                       f"MoveJ p1,v100,fine,{T}"),
    "external axes that are none, or at zero": (
        f"CONST robtarget p1:={target(1, outside='[9E9,9E9,9E9,9E9,9E9,9E9]')};\n"
        f"CONST robtarget p2:={target(2, outside='[9e+9,9E+9,9E9,9E+09,9E9,9.0E+09]')};\n",
        f"MoveJ p1,v100,fine,{T}\nMoveJ p2,v100,fine,{T}"),
    "loops, branches, routines": (
        P[1] + P[2] + P[3] + "VAR num n:=2;\n",
        f"FOR i FROM 1 TO 2 DO\nMoveJ p1,v100,fine,{T}\nsub;\nENDFOR\nIF n=2 THEN\nMoveL p3,v100,fine,{T}\n"
        f"ENDIF\n"
        f"TEST n\nCASE 1,3:\nMoveL p1,v100,fine,{T}\nDEFAULT:\nMoveL p2,v100,fine,{T}\nENDTEST\nENDPROC\n"
        f"PROC sub()\nMoveL p2,v100,fine,{T}"),
    "comments and strings that look like motions": (
        P[1] + f"! {P[2]}", f'TPWrite "MoveJ p3,v100,fine,tool0;!";\nMoveJ p1,v100,fine,{T} ! MoveJ p2;'),
    "a target that is a variable of its routine": (
        "", f"VAR robtarget here:={target(1)};\nMoveJ here,v100,fine,{T}"),
    "numbers in every form": ("", f"MoveJ {EXPONENT},v100,fine,{T}"),
}
NAMES = f"VAR confdata conf:=[0,0,0,0];\nVAR extjoint extj:={NONE};\n"
REFUSED = {
    "a configuration with a name that is looked at": (NAMES, f"MoveL {named(1)},v100,z10,{T}"),
    "external axes with a name that are in use": (
        NAMES.replace("9E+09", "100.0", 1), f"ConfL\\Off;\nMoveL {named(1)},v100,z10,{T}"),
    "external axes with a name that the program sets": (
        NAMES, f"ConfL\\Off;\nextj.eax_a:=100;\nMoveL {named(1)},v100,z10,{T}"),
    "external axes with a name that is not there": (
        NAMES.replace("extj", "ext"), f"ConfL\\Off;\nMoveL {named(1)},v100,z10,{T}"),
    "a tool that a routine changes which is given it": (
        P[1], f"change torch;\nMoveJ p1,v100,fine,{T}\nENDPROC\nPROC change(PERS tooldata t)\n"
              "t.tframe.trans.z:=300;"),
    "a target that a routine changes which is given it": (
        f"VAR robtarget p1:={target(1)};\n", f"raise p1;\nMoveJ p1,v100,fine,{T}\nENDPROC\n"
        "PROC raise(INOUT robtarget p)\np.trans.z:=p.trans.z+10;"),
    "a correction by a sensor": (P[1] + P[2], f"MoveJ p1,v100,fine,{T}\nMoveL p2,v100,fine,{T[:-1]}\\Corr;"),
    "a seam that is tracked": (
        P[1] + P[2], f"MoveJ p1,v100,fine,{T}\nArcL p2,v100,seam1,weld1\\Track:=track1,fine,{T}"),
    "a work object on a conveyor": (P[1], f"WaitWObj table\\RelDist:=10;\nMoveJ p1,v100,fine,{T}"),
    "an axis that stays": (P[1], f"SingArea\\LockAxis4;\nMoveJ p1,v100,fine,{T}"),
    "offsets of external axes": (P[1], f"EOffsSet [100,0,0,0,0,0];\nMoveJ p1,v100,fine,{T}"),
    "a tool without an orientation": (
        P[1] + f"PERS tooldata flat:=[TRUE,[[0,0,100],[0,0,0,0]],{LIGHT}];\n",
        "MoveJ p1,v100,fine,flat\\WObj:=table;"),
    "a work object without an orientation": (
        P[1] + f'PERS wobjdata flat:=[FALSE,TRUE,"",[[0,0,0],[0,0,0,0]],{frame((0,) * 6)}];\n',
        "MoveJ p1,v100,fine,torch\\WObj:=flat;"),
    "a load whose mass is a list": (
        P[1] + f"PERS tooldata flat:=[TRUE,{frame(TOOL)},[[1],[0,0,0]]];\n",
        "MoveJ p1,v100,fine,flat\\WObj:=table;"),
    "a load with two numbers of its centre": (
        P[1] + f"PERS tooldata flat:=[TRUE,{frame(TOOL)},[1,[0,0],[1,0,0,0],0,0,0]];\n",
        "MoveJ p1,v100,fine,flat\\WObj:=table;"),
    "a work object that a routine may be given": (
        P[1], "go\\w:=table;\nENDPROC\nPROC go(\\PERS wobjdata w)\nMoveJ p1,v100,fine,torch\\WObj?w;"),
    "a load that a routine may be given": (
        P[1], f"go\\l:=part;\nENDPROC\nPROC go(\\PERS loaddata l)\nMoveJ p1,v100,fine,{T[:-1]}\\TLoad?l;"),
    "a work object given by a routine of several names": (
        P[1], "go table;\nENDPROC\nPROC go(PERS wobjdata other)\nMoveJ p1,v100,fine,torch\\WObj:=other;"),
    "a component that one line of a condition sets": (
        f"VAR num n:=2;\nVAR robtarget p1:={target(1)};\n", f"IF n=2 p1.trans.z:=1;\nMoveJ p1,v100,fine,{T}"),
    "a tool that a case sets on its line": (
        "VAR num n:=2;\n" + P[1], f"TEST n\nCASE 2: torch:=hand;\nENDTEST\nMoveJ p1,v100,fine,{T}"),
    "targets of another module": (P[1].replace("p1", "p3"), f"MoveJ p1,v100,fine,{T}"),
    "an offset": (P[1], f"MoveJ Offs(p1,0,0,10),v100,fine,{T}"),
    "an offset beside the point itself": (P[1],
                                          f"MoveJ p1,v100,fine,{T}\nMoveL Offs(p1,0,0,10),v100,fine,{T}"),
    "an offset along the tool": (P[1], f"MoveL RelTool(p1,0,0,10\\Rz:=5),v100,fine,{T}"),
    "a component that the program sets": (
        f"PERS robtarget p1:={target(1)};\n", f"p1.trans.z:=p1.trans.z+10;\nMoveJ p1,v100,fine,{T}"),
    "a component that the program sets behind the motion, in a loop": (
        f"VAR robtarget p1:={target(1)};\n",
        f"FOR i FROM 1 TO 2 DO\nMoveJ p1,v100,fine,{T}\np1.trans.x:=p1.trans.x+10;\nENDFOR"),
    "a target that is assigned": (
        f"VAR robtarget p1:={target(1)};\n" + P[2], f"p1:=p2;\nMoveJ p1,v100,fine,{T}"),
    "a target that gets an offset": (
        f"VAR robtarget p1:={target(1)};\n", f"p1:=Offs(p1,0,0,10);\nMoveJ p1,v100,fine,{T}"),
    "a list of targets": (
        f"CONST robtarget way{{2}}:=[{target(1)},{target(2)}];\n",
        f"FOR i FROM 1 TO 2 DO\nMoveJ way{{i}},v100,fine,{T}\nENDFOR"),
    "an argument of a routine": (P[1], f"go p1;\nENDPROC\nPROC go(robtarget p)\nMoveJ p,v100,fine,{T}"),
    "an argument with the name of a target": (
        P[1] + P[2], f"go p2;\nENDPROC\nPROC go(robtarget p1)\nMoveJ p1,v100,fine,{T}"),
    "a tool as an argument": (
        P[1], "go torch;\nENDPROC\nPROC go(PERS tooldata hand)\nMoveJ p1,v100,fine,hand\\WObj:=table;"),
    "a displacement of the program": (
        P[1], f"PDispSet [[0,0,10],[1,0,0,0]];\nMoveJ p1,v100,fine,{T}"),
    "a tool that the program changes": (P[1], f"torch.tframe.trans.z:=250;\nMoveJ p1,v100,fine,{T}"),
    "a load that the program changes": (P[1], f"torch.tload.mass:=1;\nMoveJ p1,v100,fine,{T}"),
    "a work object that the program changes": (
        P[1], f"table.uframe.trans:=[1,2,3];\nMoveJ p1,v100,fine,{T}"),
    "a work object that the program replaces": (P[1], f"table:=other;\nMoveJ p1,v100,fine,{T}"),
    "one target with two tools": (
        P[1], f"MoveJ p1,v100,fine,{T}\nMoveL p1,v100,fine,Hand\\WObj:=table;"),
    "one target with two work objects": (
        P[1], f"MoveJ p1,v100,fine,{T}\nMoveL p1,v100,fine,torch\\WObj:=other;"),
    "a tool at rest": (
        f"PERS tooldata gun:=[FALSE,{frame(TOOL)},{HEAVY}];\n" + P[1],
        "MoveJ p1,v100,fine,gun\\WObj:=table;"),
    "a work object that the arm holds": (
        f'PERS wobjdata part:=[TRUE,TRUE,"",{frame(BASE)},{frame((0,) * 6)}];\n' + P[1],
        "MoveJ p1,v100,fine,torch\\WObj:=part;"),
    "a work object that moves": (
        f'PERS wobjdata turning:=[FALSE,FALSE,"STN1",{frame(BASE)},{frame((0,) * 6)}];\n' + P[1],
        "MoveJ p1,v100,fine,torch\\WObj:=turning;"),
    "external axes": (
        f"CONST robtarget p1:={target(1, outside='[100,9E9,9E9,9E9,9E9,9E9]')};\n",
        f"MoveJ p1,v100,fine,{T}"),
    "an unknown tool": (P[1], "MoveJ p1,v100,fine,grip\\WObj:=table;"),
    "a tool of its routine with the name of another": (
        P[1], f"PERS tooldata torch:=[TRUE,{frame(OTHER_TOOL)},{LIGHT}];\nMoveJ p1,v100,fine,{T}"),
    "a target of two routines": (
        P[1], f"VAR robtarget p1:={target(2)};\nMoveJ p1,v100,fine,{T}"),
    "a computed quaternion": ("", "MoveJ " + target(1).replace(
        target(1).split("],[")[1], "OrientZYX(1,2,3)").replace("[OrientZYX(1,2,3)]", "OrientZYX(1,2,3)")
        + f",v100,fine,{T}"),
    "sums in a target": ("", "MoveJ " + target(1).replace(",", "+1,", 1) + f",v100,fine,{T}"),
    "a target that is passed to a motion by a function": (P[1], f"MoveJ CRobT(\\Tool:=torch),v100,fine,{T}"),
    "a point that a search finds": (
        P[1] + f"VAR robtarget p2:={target(2)};\n",
        f"MoveJ p1,v100,fine,{T}\nSearchL di1,p2,p1,v100,{T}\nMoveL p2,v100,fine,{T}"),
}


def files(data, body):
    text = f"MODULE prog\n{DATA}{data}PROC main()\n{body}\nENDPROC\nENDMODULE\n"
    return {"prog.mod": "\n".join("  " + line for line in text.splitlines()).encode()}


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.slow
def test_every_motion_reaches_what_the_program_meant(tmp_path, name):
    corrected(tmp_path, ROBOT, execute, files(*RIGHT[name]))


def test_data_of_the_program_count_and_not_a_frame_of_the_command_line(tmp_path):
    seven = ",".join(map(str, (1, 2, 3, 1, 0, 0, 0)))
    program = files(P[1], f"MoveJ p1,v100,fine,{T}")
    corrected(tmp_path, ROBOT, execute, program, tool=[seven], base=[seven])
    refused(tmp_path, ROBOT, program, tool=[f"torch={seven}"])
    refused(tmp_path, ROBOT, program, base=[f"table={seven}"])


def test_a_frame_of_the_command_line_without_an_orientation_is_refused(tmp_path):
    program = files("", f"MoveJ {target(1)},v100,fine,mine;")
    with pytest.raises(InputError, match="frame 0,0,100,0,0,0,0: quaternion of norm 0; expected 1"):
        compensate(tmp_path, ROBOT, program, tool=["mine=0,0,100,0,0,0,0"])


def test_one_frame_without_a_name_does_not_stand_for_two(tmp_path):
    moves = f"MoveJ {target(1)},v100,fine,one\\WObj:=table;\nMoveL {target(2)},v100,fine,two\\WObj:=table;"
    seven = frame(TOOL).replace("[", "").replace("]", "")
    assert compensate(tmp_path, ROBOT, files("", moves), tool=[f"one={seven}", seven])
    with pytest.raises(InputError, match="--tool without a name, and the programs use several"):
        compensate(tmp_path, ROBOT, files("", moves), tool=[seven])


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.slow
def test_what_has_no_one_right_number_is_refused(tmp_path, name):
    refused(tmp_path, ROBOT, files(*REFUSED[name]))


def test_joint_angles_are_corrected_beside_an_external_axis_which_moves_the_arm_as_one_body(tmp_path):
    """On a track the flange is wrong by the same, seen from the arm's own base; a pose is refused there."""
    moves = lambda outside: files("", f"MoveAbsJ {joints(1, outside)},v100,fine,torch;")
    away, none = "[850,9E9,9E9,9E9,9E9,9E9]", "[9E9,9E9,9E9,9E9,9E9,9E9]"
    there, here = (compensate(tmp_path, ROBOT, moves(outside))["prog.mod"] for outside in (away, none))
    assert there.replace(away.encode(), none.encode()) == here != moves(none)["prog.mod"]


@pytest.mark.parametrize("off", ["ConfJ\\Off;\n", "ConfL \\Off;\n"])
def test_configurations_that_the_program_switches_off_choose_no_branch(tmp_path, off):
    """cf1 to cfx of such programs are often 0, whatever branch the arm is on; they are written anew."""
    move = "MoveJ" if "J" in off else "MoveL"
    words = target(2).split("],[")[2]
    written = [compensate(tmp_path, ROBOT, files("", f"{off}MoveJ {target(1)},v100,fine,{T}\n"
                                                     f"{move} {point},v100,fine,{T}"))["prog.mod"]
               for point in (target(2), target(2).replace(f"[{words}]", "[0,0,0,0]"))]
    assert words != "0,0,0,0" and written[0].replace(words.encode(), b"") == written[1].replace(
        (words[: words.rindex(",")] + ",0").encode(), b"")
    with pytest.raises(InputError, match="no branch of the arm has the configuration"):
        compensate(tmp_path, ROBOT, files("", f"MoveJ {target(1)},v100,fine,{T}\n{move} "
                                              f"{target(2).replace(words, '0,0,0,0')},v100,fine,{T}"))


def test_a_check_of_configurations_that_is_switched_on_and_off_is_refused(tmp_path):
    refused(tmp_path, ROBOT, files(P[1], f"ConfJ\\Off;\nMoveJ p1,v100,fine,{T}\nConfJ\\On;"))


def module(name, text):
    return {f"{name}.mod": f"MODULE {name}\n{text}\nENDMODULE\n".encode()}


def program(data, body, name="prog"):
    return module(name, f"{data}PROC main()\n{body}\nENDPROC")


GO = f"MoveJ p1,v100,fine,{T}\nMoveL p2,v100,z10,{T}"
APART = {
    "tools and targets in a module beside the program": (
        program("", GO), module("points", DATA + P[1] + P[2])),
    "tools in one module, targets in another": (
        program("", GO), module("points", P[1] + P[2]), module("cell", DATA)),
    "own data before those of another module": (
        program(P[1], GO), module("points", DATA + P[1].replace("CONST", "LOCAL CONST") + P[2])),
    "tools of a module, and a target of the same name in its routine": (
        program(P[1] + P[2], GO),
        module("cell", DATA + f"PROC other()\nVAR robtarget p1:={target(3)};\nENDPROC")),
}
HIDDEN = {
    "targets that another module keeps to itself": (
        program("", GO), module("points", DATA + "LOCAL " + P[1] + P[2])),
    "targets of a routine of another module": (
        program(P[2], GO), module("points", DATA + f"PROC other()\nVAR robtarget p1:={target(1)};\nENDPROC")),
    "targets of two other modules": (
        program("", GO), module("points", DATA + P[1] + P[2]), module("more", P[1])),
    "a target that another module sets": (
        program("", GO), module("points", DATA + P[2] + "VAR" + P[1].removeprefix("CONST")),
        module("setting", "PROC set()\np1:=p2;\nENDPROC")),
}


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("name", APART)
@pytest.mark.slow
def test_data_of_other_modules_are_read_when_they_are_given_too(tmp_path, name, order):
    parts = [part for files in APART[name] for part in files.items()]
    given = dict(parts[::order])
    written = compensate(tmp_path, ROBOT, given)
    same = lambda files: execute({name: files[name] for name, _ in parts[::-1]})
    same_motions(ROBOT, same, given, written)
    assert all(written[name] != content for name, content in given.items() if b"robtarget p2" in content)


@pytest.mark.parametrize("name", HIDDEN)
def test_data_that_the_program_does_not_see_in_other_modules_are_refused(tmp_path, name):
    refused(tmp_path, ROBOT, {name: content for part in HIDDEN[name] for name, content in part.items()})


def test_programs_that_share_their_tools_keep_points_of_the_same_name(tmp_path):
    """Two alternatives with a p1 each, one of which sets its own p2: as each with the tools alone."""
    tools = module("cell", DATA)
    one = program(P[1] + P[2], GO, "one")
    two = program(f"CONST robtarget p1:={target(3)};\nVAR robtarget p2:={target(5)};\n" + P[4],
                  f"MoveJ p1,v100,fine,{T}\nMoveL p4,v100,z10,{T}\np2:=p1;", "two")
    together = compensate(tmp_path, ROBOT, one | two | tools)
    for each in (one, two):
        alone = compensate(tmp_path, ROBOT, each | tools)
        assert together | alone == together and alone | each | tools != alone
