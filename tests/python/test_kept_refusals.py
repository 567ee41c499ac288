"""A motion whose place stands nowhere in numbers is refused by its line, and with `keep_refused` stays beside
others that are corrected."""

from dataclasses import replace

import numpy as np
import pytest

import compensation_cell as cells
import exactarm as ea
from compensation_cell import Cell, identified, nearby
from exactarm.compensate.approach import Approaches
from exactarm.compensate.law import CompensationModel
from exactarm.compensate.program import Motion
from exactarm.errors import InputError
from exactarm.robot.robot import Placement

FRAMES = {"krl": ("TOOL", "BASE", "1=", "2="), "fanuc": ("TOOL", "BASE", "4=", "3="),
          "inform": ("TOOL", "BASE", "5=", "2=")}
OFFSET = {
    "rapid": ("    MoveJ p3,", "    MoveL Offs(p1,0,0,50),v100,z10,torch\\WObj:=table;\n"),
    "krl": ("  PTP XP3 ", "  LIN_REL {Z 50.0}\r\n"),
    "krl, an operator": ("  PTP XP3 ", "  PTP XP1:XP2\r\n"),
    "urscript": ("  movel(p", "  movel(pose_add(get_actual_tcp_pose(), p[0,0,0.05,0,0,0]), a=1.2)\n"),
    "fanuc": ("   3:J P[3", "   8:L P[1] 100mm/sec FINE Offset,PR[1]    ;\n"),
    "fanuc, a register": ("   3:J P[3", "   8:J PR[7] 100% FINE    ;\n"),
    "inform": ("MOVJ C00002", "IMOV P00001 V=50.0\r\n"),
}


def arm(**controller):
    """Without gear tables and play: nothing hangs on the motion before."""
    robot = identified(effects=False, **controller)
    return replace(robot, joints=tuple(replace(joint, cw=None, ccw=None) for joint in robot.joints))


@pytest.mark.parametrize("name", OFFSET)
@pytest.mark.slow
def test_an_offset_motion_is_refused_or_stays_and_the_others_are_corrected(name, tmp_path):
    dialect = name.partition(",")[0]
    chain = "calibrated" if dialect == "urscript" else "nominal"
    robot = arm(chain=chain, coupling=((3, 2, 1.0),) if dialect == "fanuc" else (),
                pulses_per_rad=cells.PULSES)
    cell, q = Cell(robot, base=Placement()) if dialect == "urscript" else Cell(robot), nearby(robot, 4)
    files = getattr(cells, dialect)(cell, q)
    numbers = lambda values: ",".join(map(str, values))
    options = {"points": "calculated", "threads": 1}
    if dialect in FRAMES:
        swapped = (0, 1, 2, 3, 4, 5) if dialect == "krl" else (0, 1, 2, 5, 4, 3)
        order = lambda values: numbers(values[i] for i in swapped)
        options |= {"tool": [FRAMES[dialect][2] + order(cells.TOOL)],
                    "base": [FRAMES[dialect][3] + order(cells.BASE)]}
    first, (anchor, line) = next(iter(files)), OFFSET[name]
    at = files[first].index(anchor.encode())
    more = files | {first: files[first][:at] + line.encode() + files[first][at:]}

    def written(contents, **others):
        for each, content in contents.items():
            (tmp_path / each).write_bytes(content)
        return ea.compensate(robot, [tmp_path / each for each in files], **options, **others).contents

    plain = written(files)
    assert plain[first] != files[first] or dialect == "krl"
    with pytest.raises(InputError, match=rf"{first}, line \d+: .*--keep-refused"):
        written(more)
    kept = written(more, keep_refused=True)
    assert kept[first].replace(line.encode(), b"", 1) == plain[first] and line.encode() in kept[first]
    assert all(kept[each] == plain[each] for each in files if each != first)


def test_nothing_is_known_of_the_side_from_which_axes_come_behind_a_place_that_is_not_known():
    model = CompensationModel.of(identified())
    q = nearby(model.actual, 4)
    q[1] = np.nan
    motions = [Motion(kind, i, i) for i, kind in enumerate(("joint", "linear", "linear", "linear"))]
    sides = Approaches(model, motions).of(q)
    assert not sides[1].any() and not sides[2].any() and np.all(sides[3] != 0.0)
