"""Points in between of numbered programs (Fanuc TP, INFORM), and of none where the arm may come from
elsewhere: executed before and after by interpreters that know no reader."""

import re
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

import exactarm as ea
import test_programs_fanuc as fanuc
import test_programs_inform as inform
import test_programs_krl as krl
import test_programs_rapid as rapid
import test_programs_urscript as urscript
from exactarm.errors import InputError
from interpreters.motion import matrix
from interpreters.verdict import same_motions, true_flange
from test_compensate_fuzz import mutated

TOLERANCE_MM = 0.01
FANUC_HEAD = b'PROG_SIZE\t= 636;\r\nLINE_COUNT\t= 99;\r\nCOMMENT = "'
TP = (f"{fanuc.SET}J P[1] 100% FINE\nL P[2:Naht] 500mm/sec CNT20 ACC50\n  DO[1]=ON\n  !P[9] \u00fc\n"
      "L P[3] 20cm/min FINE")
JBI = ("MOVJ C00001 VJ=50.00\nMOVL C00002 V=100.0 PL=0 ACC=20\nDOUT OT#(1) ON\n'MOVL C00009 \u00fc\n"
       "MOVL C00003 V=9.0")


@dataclass(frozen=True)
class Case:
    """A program with straight motions, and the module of tests that knows its cell."""

    cell: ModuleType
    files: dict[str, bytes]


def tp(lines=TP, places=None):
    made = fanuc.files(lines, "".join(map(fanuc.place, (1, 2, 3))) if places is None else places)
    text = made["prog.ls"].decode().replace("\n", "\r\n").encode("cp1252")
    count = len(re.findall(rb"(?m)^ *\d+:", text))
    return Case(fanuc, {"prog.ls": text.replace(b'COMMENT = "', FANUC_HEAD.replace(b"99", b"%d" % count))})


def with_own_numbers(case):
    """A block whose lines are counted from 1, as some cells write what happens on the way."""
    text = case.files["prog.ls"].replace(b"  DO[1]=ON    ;", b"  DO[1]=ON    ;\r\n   1:  DO[2]=ON ;")
    return Case(fanuc, {"prog.ls": text})


def jbi(moves=JBI, places=None, count=3):
    if places is None:
        places = inform.ROBOT_FRAME + inform.pose(1) + inform.pose(2) + inform.pose(3)
    made = inform.files(places, moves)["prog.jbi"].decode().encode("cp1252")
    return Case(inform, {"prog.jbi": made.replace(b"NPOS 9", b"NPOS %d" % count)})


def dense(folder, case, tolerance=TOLERANCE_MM):
    """The new files and the result."""
    for name, content in case.files.items():
        (folder / name).write_bytes(content)
    given = {}
    for key in ("GIVEN", "OPTIONS", "START"):
        given |= getattr(case.cell, key, {})
    result = ea.compensate(case.cell.ROBOT, [folder / name for name in case.files], points="calculated",
                           threads=1, tolerance_mm=tolerance, **given)
    return {name: result.contents[name] for name in case.files}, result.json


def off_line(case, written):
    """Largest distance (m) of the real tip from the nearest of the lines that the old program meant, on the
    straight ways of the new one."""
    old, new = case.cell.execute(case.files), case.cell.execute(written)
    lines = [(a.tip[:3, 3], b.tip[:3, 3]) for a, b in zip(old, old[1:]) if b.kind == "line"]
    assert lines
    largest = 0.0
    for a, b in zip(new, new[1:]):
        if b.kind != "line":
            continue
        start, end = a.flange @ b.tool, b.tip
        turn = Slerp([0, 1], Rotation.from_matrix([start[:3, :3], end[:3, :3]]))
        for share in np.linspace(0.0, 1.0, 21):
            tip = matrix(start[:3, 3] + share * (end[:3, 3] - start[:3, 3]), turn(share).as_matrix())
            q = case.cell.ARM.joints(tip @ np.linalg.inv(b.tool), a.q)
            there = (true_flange(case.cell.ROBOT, q, b.load) @ b.tool)[:3, 3]
            largest = max(largest, min(distance(there, *line) for line in lines))
    return largest, len(new) - len(old)


def distance(point, start, end):
    along = (end - start) / np.linalg.norm(end - start)
    return np.linalg.norm(np.cross(point - start, along))


def masked(content):
    """Lines without their numbers."""
    return re.sub(rb"[ \t]*[-+]?\d+\.?\d*", b"#", content).splitlines(keepends=True)


def without_new(old, new, is_new):
    return [line for line in new if not is_new(line)] == old


PULSES = inform.PULSE + inform.pulses(1) + inform.pulses(2) + inform.ROBOT_FRAME + inform.pose(3)
JOINTS = fanuc.place(1) + fanuc.joints(2) + fanuc.place(3)
TAKEN = {
    "TP": tp(), "TP, joint angles": tp(f"{fanuc.SET}J P[1] 100% FINE\nL P[2] 500mm/sec FINE", JOINTS),
    "TP, positions in another order": tp(places="".join(map(fanuc.place, (3, 1, 2)))),
    "INFORM": jbi(), "INFORM, pulses": jbi("MOVJ C00001 VJ=9\nMOVL C00002 V=9\nMOVJ C00003 VJ=9", PULSES),
    "INFORM, heads that change": jbi(places=inform.BASE_FRAME + inform.pose(1) + inform.pose(2)
                                     + inform.USER.format(1) + inform.pose(3, base=1)),
}


@pytest.mark.parametrize("name", TAKEN)
@pytest.mark.slow
def test_points_with_numbers_keep_the_real_tip_on_its_line(tmp_path, name):
    case = TAKEN[name]
    (tmp_path / "plain").mkdir()
    plain, _ = dense(tmp_path / "plain", case, 100.0)
    same_motions(case.cell.ROBOT, case.cell.execute, case.files, plain)
    written, result = dense(tmp_path, case)
    bent, none = off_line(case, plain)
    left, more = off_line(case, written)
    bends = result["programs"][0]["straight_motions"]
    assert none == 0 and bent > 1.5e-3 * TOLERANCE_MM and left < 1.02e-3 * TOLERANCE_MM
    assert more == sum(bend["points_in_between"] for bend in bends) > 0
    assert not any("leave their line" in word for word in result["warnings"])


def test_lines_and_positions_of_tp_stay_in_order(tmp_path):
    old = TAKEN["TP"].files["prog.ls"]
    written, result = dense(tmp_path, TAKEN["TP"])
    new = written["prog.ls"]
    more = sum(bend["points_in_between"] for bend in result["programs"][0]["straight_motions"])
    numbers = [int(word) for word in re.findall(rb"(?m)^ *(\d+):", new)]
    count = len(re.findall(rb"(?m)^ *\d+:", old)) + more
    assert numbers == list(range(1, count + 1)) and b"LINE_COUNT\t= %d;" % count in new
    assert sorted(map(int, re.findall(rb"(?m)^P\[(\d+)", new))) == list(range(1, 4 + more))
    assert b"P[2:Naht] 500mm/sec CNT20 ACC50" in new and b"500mm/sec CNT100 ACC50" in new
    assert b"!P[9] \xfc" in new and b"PROG_SIZE\t= 636;" in new and new.count(b"\n") == new.count(b"\r\n")
    stays = new[: new.index(b"P[4]{")] + b"/END\r\n"
    is_new = lambda line: b"CNT#" in line and b":Naht" not in line
    assert without_new(masked(old), masked(stays), is_new)
    again = ea.compensate(fanuc.ROBOT, [write(tmp_path, "again.ls", new)], points="taught", **fanuc.GIVEN)
    assert again.contents["again.ls"] == new


def write(folder, name, content):
    (folder / name).write_bytes(content)
    return folder / name


def test_positions_of_inform_are_counted(tmp_path):
    case = TAKEN["INFORM, heads that change"]
    written, result = dense(tmp_path, case)
    new = written["prog.jbi"]
    more = sum(bend["points_in_between"] for bend in result["programs"][0]["straight_motions"])
    names = [int(name) for name in re.findall(rb"(?m)^C(\d+)=", new)]
    assert names == list(range(1, 4 + more)) and b"///NPOS %d,0,0,0,0,0" % (3 + more) in new
    assert all(new.count(b"MOVL C%05d" % name) == 1 for name in names[3:])
    assert b"MOVL C00002 V=100.0 PL=0 ACC=20" in new and b"V=100.0 PL=1 ACC=20" in new and b" \xfc" in new


NOT_TAKEN = {
    "TP, a time": tp(TP.replace("500mm/sec", "2.0sec").replace("20cm/min", "1sec")),
    "TP, what happens on the way": tp(TP.replace("ACC50", "TA .2sec,DO[1]=ON")
                                      .replace("FINE", "FINE Skip,LBL[1]")),
    "TP, lines with numbers of their own": with_own_numbers(tp()),
    "TP, a label": tp(f"{fanuc.SET}J P[1] 100% FINE\n  LBL[1]\nL P[2] 9mm/sec FINE\n  CALL SUB\n"
                      "L P[3] 9mm/sec FINE"),
    "TP, another program in one line": tp(TP.replace("\nL", "\n  GRIP_OPEN\nL")),
    "TP, a second arm": tp(places=fanuc.place(1) + fanuc.place(2, more=fanuc.GROUP2)
                           + fanuc.place(3, more=fanuc.GROUP2)),
    "TP, joint angles before a pose": tp(f"{fanuc.SET}J P[2] 100% FINE\nL P[1] 9mm/sec FINE", JOINTS),
    "INFORM, a condition": jbi(JBI.replace("PL=0", "UNTIL IN#(1)=ON")),
    "INFORM, a label": jbi("MOVJ C00001 VJ=50.00\n*AGAIN\nMOVL C00002 V=100.0\nCALL JOB:SUB\n"
                           "MOVL C00003 V=9.0"),
    "INFORM, a count that is wrong": jbi(count=9),
    "INFORM, positions of another axis": jbi(places=inform.ROBOT_FRAME + inform.pose(1) + inform.pose(2)
                                             + inform.pose(3) + "EC00001=0\n"),
}


@pytest.mark.parametrize("name", NOT_TAKEN)
@pytest.mark.slow
def test_where_no_points_can_be_put_it_is_told_by_line(tmp_path, name):
    case = NOT_TAKEN[name]
    written, result = dense(tmp_path, case)
    (old,), (new,) = case.files.values(), written.values()
    assert masked(old) == masked(new)
    told = [word for word in result["warnings"] if "where no points in between can be put" in word]
    assert re.search(r"\(line \d+, 0\.\d+ mm\)", told[0])


# -- ways that come from elsewhere -------------------------------------------------------------------------
def krl_of(between, behind=""):
    frames = "$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[1]\n"
    line = f"LIN {krl.pose(2, turn=False)}\n"
    return Case(krl, krl.files(f"{frames}PTP {krl.pose(1)}\n{between}{line}{behind}"))


def rapid_of(between, behind=""):
    data = f"CONST robtarget p1:={rapid.target(1)};\nCONST robtarget p2:={rapid.target(2)};\n"
    moves = f"MoveJ p1,v100,fine,{rapid.T}\n{between}MoveL p2,v100,fine,{rapid.T}\n{behind}"
    return Case(rapid, rapid.files(data, moves))


def urscript_of(between, behind=""):
    moves = (f"{urscript.SET}movej({urscript.pose(1)})\n{between}movel({urscript.pose(2)}, a=1.2, v=0.1)\n"
             f"{behind}")
    return Case(urscript, urscript.files(moves))


def changed(case, name, old, new):
    assert old in case.files[name]
    return Case(case.cell, case.files | {name: case.files[name].replace(old, new)})


STRAIGHT_ON = {
    "krl": krl_of("$OUT[1]=TRUE\nBAS(#VEL_CP,0.2)\n; LOOP\nWAIT SEC 0.1\n"),
    "rapid": rapid_of("SetDO do1,1;\nWaitTime\\InPos,0.1;\n! WHILE TRUE DO\nn:=n+1;\n"),
    "urscript": urscript_of("sleep(0.1)\nset_digital_out(1, True)\n# while True:\n"),
}
ELSEWHERE = {
    "krl, loop": krl_of("LOOP\n", "ENDLOOP"), "krl, call": krl_of("SUB()\n"),
    "krl, label": krl_of("AGAIN:\n"),
    "krl, branch": krl_of("IF $IN[1] THEN\nPTP XHOME\nENDIF\n"),
    "krl, routine": krl_of("END\nDEF other()\n"),
    "rapid, loop": rapid_of("WHILE TRUE DO\n", "ENDWHILE"), "rapid, call": rapid_of("sub;\n"),
    "rapid, label": rapid_of("again:\n"), "rapid, routine": rapid_of("ENDPROC\nPROC other()\n"),
    "rapid, branch": rapid_of("IF di1=1 THEN\nWaitTime 1;\nELSE\n", "ENDIF"),
    "rapid, branch in one line": rapid_of(f"IF n=1 MoveL p2,v100,fine,{rapid.T}\n"),
    "urscript, loop": urscript_of("while True:\n", "end"), "urscript, call": urscript_of("sub()\n"),
    "urscript, branch": urscript_of(f"if n == 1:\nmovej({urscript.pose(3)})\nend\n"),
    "urscript, routine": urscript_of("end\ndef other():\n"),
}


TIMED = {  # what is said of the whole way does not hold for each part of it
    "rapid, a time": changed(rapid_of(""), "prog.mod", b"MoveL p2,v100", b"MoveL p2,v100\\T:=5"),
    "rapid, a number": changed(rapid_of(""), "prog.mod", b"MoveL p2,", b"MoveL p2\\ID:=10,"),
    "urscript, a time": changed(urscript_of(""), "prog.script", b"v=0.1", b"t=5"),
}


@pytest.mark.parametrize("name", TIMED)
def test_no_points_are_put_into_a_motion_whose_time_is_given(tmp_path, name):
    written, result = dense(tmp_path, TIMED[name])
    assert any("where no points in between can be put" in word for word in result["warnings"])
    (old,), (new,) = TIMED[name].files.values(), written.values()
    assert old.count(b"\n") == new.count(b"\n")


def test_a_program_without_lines_says_that_none_was_looked_at(tmp_path):
    joints = "\n".join(f"MOVJ C0000{i} VJ=50.00" for i in (1, 2, 3))
    _, result = dense(tmp_path, jbi(joints))
    assert any("no line or path whose tolerance" in word for word in result["warnings"])


@pytest.mark.parametrize("name", STRAIGHT_ON)
def test_statements_that_move_nothing_do_not_keep_points_out(tmp_path, name):
    written, result = dense(tmp_path, STRAIGHT_ON[name])
    (bend,) = result["programs"][0]["straight_motions"]
    assert bend["points_in_between"] > 0 and not any("can be put" in word for word in result["warnings"])
    (old, *_), (new, *_) = STRAIGHT_ON[name].files.values(), written.values()
    assert new.count(b"\n") == old.count(b"\n") + bend["points_in_between"]


@pytest.mark.parametrize("name", ELSEWHERE)
@pytest.mark.slow
def test_no_points_are_put_where_the_arm_may_come_from_elsewhere(tmp_path, name):
    """They lie on the line from the motion above: an arm that comes another way would be sent there first."""
    written, result = dense(tmp_path, ELSEWHERE[name])
    assert {k: v.count(b"\n") for k, v in written.items()} == {
        k: v.count(b"\n") for k, v in ELSEWHERE[name].files.items()}
    if result["programs"][0]["straight_motions"]:
        assert any("where no points in between can be put" in word for word in result["warnings"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["TP", "TP, joint angles", "INFORM", "INFORM, heads that change"])
def test_damaged_programs_with_points_in_between_are_refused_or_can_be_read_again(tmp_path, name, count=40):
    case, random, grown = TAKEN[name], np.random.default_rng(3), 0
    (file, content), = case.files.items()
    for _ in range(count):
        case = Case(case.cell, {file: mutated(content, random)})
        try:
            written, result = dense(tmp_path, case, 0.02)
        except InputError as error:
            assert file in str(error)
            continue
        more = sum(bend["points_in_between"] for bend in result["programs"][0]["straight_motions"])
        again = ea.compensate(case.cell.ROBOT, write(tmp_path, file, written[file]), points="taught",
                              keep_refused=True, **case.cell.GIVEN)
        assert again.contents[file] == written[file]
        assert again.json["programs"][0]["targets"] == result["programs"][0]["targets"] + more
        grown += more > 0
    assert grown
