"""What a program sets on its ways: known, or refused; points that no motion reaches are told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import compensation_cell as cells
import exactarm as ea
from compensation_cell import Cell, identified, nearby
from exactarm.compensate import fanuc_tp, krl, rapid, urscript
from exactarm.compensate.program import SourceText
from exactarm.compensate.setting import Setting
from exactarm.compensate.ways import UNCERTAIN, Step, walk
from exactarm.errors import InputError
from exactarm.robot.robot import Placement


def seen(*words):
    """State of the tool at each motion of a program of one statement a word."""
    steps = []
    for place, word in enumerate(words):
        what, _, data = word.partition(" ")
        steps.append(Step(place, what, {"set": ("tool", data), "branch": data == "else"}.get(what, data)))
    return [state["tool"] for _, state in walk(steps, {"tool": None})]


def test_a_setting_that_all_ways_agree_on_is_known_behind_them():
    assert seen("move", "set a", "open", "set b", "move", "close", "move") == [None, "b", UNCERTAIN]
    assert seen("open", "set b", "branch else", "set b", "close", "move") == ["b"]
    assert seen("set a", "open", "set b", "branch", "set b", "close", "move") == [UNCERTAIN]
    assert seen("set a", "open", "set b", "move", "branch else", "move", "close") == ["b", "a"]


def test_a_loop_is_seen_from_its_second_turn_on():
    assert seen("set a", "loop", "move", "set b", "move", "close", "move") == [UNCERTAIN, "b", UNCERTAIN]
    assert seen("set a", "loop", "set a", "move", "close", "move") == ["a", "a"]


def test_a_routine_knows_what_the_whole_file_agrees_on():
    main = ("routine main", "set a", "move", "call sub", "move", "end")
    assert seen(*main, "routine sub", "move", "end") == ["a", "a", "a"]
    assert seen(*main, "routine sub", "move", "set b", "end") == ["a", UNCERTAIN, UNCERTAIN]
    assert seen(*main, "routine sub", "call deep", "end", "routine deep", "set b", "end")[1] == UNCERTAIN



def read(dialect, change, where=None):
    """The program of a dialect with one damage: (old, new)."""
    chain = "calibrated" if dialect is urscript else "nominal"
    robot = identified(chain=chain, coupling=((3, 2, 1.0),) if dialect is fanuc_tp else None)
    cell = Cell(robot, base=Placement()) if dialect is urscript else Cell(robot)
    maker = {krl: cells.krl, rapid: cells.rapid, urscript: cells.urscript, fanuc_tp: cells.fanuc}[dialect]
    files = {name: content.decode("latin-1") for name, content in maker(cell, nearby(robot, 4)).items()}
    old, new = change
    name = where or next(iter(files))
    assert old in files[name]
    files[name] = files[name].replace(old, new, 1)
    sources = tuple(SourceText(Path(name), text.encode("latin-1")) for name, text in files.items())
    frame = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    frames = {} if dialect in (rapid, urscript) else dict.fromkeys("12345", frame)
    return dialect.read(sources, Setting(robot, frames, frames))


@pytest.mark.parametrize("dialect, change, reason", [
    (rapid, ("\\WObj:=table", "\\WObj:=table\\TLoad:=heavy"), "TLoad"),
    (rapid, ("PROC main()\n", "PROC main()\n    GripLoad part;\n"), "GripLoad"),
    (rapid, ("PROC main()", "PROC main(robtarget p1)"), "an argument"),
    (krl, ("  PTP XP1 ", "  SPTP XP1 WITH $TOOL=TOOL_DATA[3] "), "of this motion alone"),
    (krl, ("  PTP XP1 ", "  SPLINE WITH $BASE=BASE_DATA[3]\r\n  PTP XP1 "), "spline block"),
    (fanuc_tp, ("   1:J P[1", "   1:  UTOOL[4]=PR[1] ;\n   1:J P[1"), "the program sets UTOOL[4]"),
])
def test_what_changes_a_target_behind_its_numbers_is_refused(dialect, change, reason):
    with pytest.raises(InputError) as error:
        read(dialect, change)
    assert reason in str(error.value)


@pytest.mark.parametrize("dialect, change, reason", [
    (urscript, ("  movej(start,", "  start[0] = 0.3\n  movej(start,"), "is set 2 times"),
    (urscript, ("def prog():", "def prog(start):"), "is set 2 times"),
    (urscript, ("  movej(start", "  if x:\n    set_tcp(p[0,0,0,0,0,0])\n  end\n  movej(start"), UNCERTAIN),
    (urscript, ("  movej(start", "  if x:\n    set_payload(1, [0,0,0])\n  end\n  movej(start"), UNCERTAIN),
    (krl, ("  PTP XP1 ", "  $TOOL=TOOL_DATA[2]\r\n  $BASE=$NULLFRAME\r\n  PTP XP1 "), "FP1 says another"),
    (krl, ("  PTP XP1 ", "  IF a THEN\r\n  BAS(#TOOL,2)\r\n  ENDIF\r\n  PTP XP1 "), "FP1 says another"),
    (krl, ("  PTP XP1 ", "  LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}\r\n  PTP XP1 "), "nothing sets $TOOL"),
])
def test_a_target_whose_tool_or_load_hangs_on_the_way_is_refused(dialect, change, reason):
    assert any(reason in target.refusal for target in read(dialect, change).targets)


def test_an_inline_form_leaves_its_tool_behind():
    more = "  FDAT_ACT=FP1\r\n  PTP XP1\r\n  LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}\r\n"
    program = read(krl, ("  PTP XP2 ", f"{more}  PTP XP2 "))
    between = next(target for target in program.targets if target.name.startswith("line"))
    assert not between.refusal and between.tool == program.targets[0].tool != Placement()


@pytest.mark.parametrize("dialect, change, said", [
    (rapid, ("    MoveJ p1,", "    Pick p1;\n    MoveJ p3,"), ("goes to p1", "p1 (line 9)")),
    (rapid, ("    MoveJ p1,", "    PaintL [[1,2,3],[1,0,0,0]],v1;\n    MoveJ p1,"), ("PaintL is not read",)),
    (krl, ("  PTP XP2 ", "  ;PTP XP2 "), ("goes to XP2",)),
    (krl, ("  PTP XP2 ", "  calc(XP2:OUT)\r\n  PTP XP2 "), ("XP2 (line 4)",)),
    (urscript, ("movel(p", "servoc(p"), ("servoc is not read",)),
    (urscript, ("  movej(start", "  pick(start)\n  movej(start"), ("start (line 6)",)),
    (fanuc_tp, ("   2:J P[2", "   2:  !P[2"), ("goes to P[2]",)),
])
@pytest.mark.slow
def test_points_that_no_motion_reaches_are_told(dialect, change, said):
    warnings = " ".join(read(dialect, change).warnings)
    assert all(words in warnings for words in said)
    undamaged = " ".join(read(dialect, (change[0], change[0])).warnings)
    assert not any(words in undamaged for words in said)


def test_a_weld_along_a_line_is_a_straight_motion():
    program = read(rapid, ("    MoveJ p1,v100\\V:=50,fine,torch", "    ArcL p1,v100,seam,weld,fine,torch"))
    assert program.motions[1].kind == "linear" and not program.targets[1].refusal and not program.warnings


@pytest.mark.parametrize("effects", [True, False])
def test_a_point_that_is_reached_from_both_sides_is_told_where_that_matters(tmp_path, effects):
    """It was told of arms without gear tables and backlash, too."""
    robot = identified(effects=effects)
    if not effects:
        robot = replace(robot, joints=tuple(replace(joint, cw=None, ccw=None) for joint in robot.joints))
    axes = ["{" + ",".join(f"A{k} {angle:.6f}" for k, angle in enumerate(row, start=1)) + "}"
            for row in np.degrees(nearby(robot, 3))]
    moves = "".join(f"PTP {name}\n" for name in (axes[0], "XP1", axes[1], "XP1"))
    (tmp_path / "p.src").write_text(f"DEF p()\n{moves}END\n")
    (tmp_path / "p.dat").write_text(f"DEFDAT p\nDECL E6AXIS XP1={axes[2]}\nENDDAT\n")
    paths = [tmp_path / "p.src", tmp_path / "p.dat"]
    told = " ".join(ea.compensate(robot, paths, points="calculated", threads=1).warnings)
    assert ("XP1 (line 2) is approached from different sides" in told) == effects
