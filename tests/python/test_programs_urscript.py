"""URScript programs with traps: executed before and after `compensate` by an interpreter that knows no
reader."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensation_cell import nearby
from interpreters import urscript
from interpreters.urscript import Pose, to_matrix, to_pose
from interpreters.verdict import arm_of, corrected, refused, robot_of

TOOL = [0.085, -0.03, 0.21, 0.3, -0.2, 0.5]
OTHER_TOOL = [0.09, -0.02, 0.2, 0.32, -0.22, 0.5]
ROBOT = robot_of(chain="calibrated")
ARM = arm_of(ROBOT)
Q = nearby(ROBOT, 6)
START = {"start": ",".join(f"{angle:.9f}" for angle in np.degrees(Q[0]))}


def execute(files):
    return urscript.execute(files, ARM, Q[0])


def row(values):
    return ", ".join(f"{float(value):.9f}" for value in values)


def pose(i, tool=TOOL, turns=0):
    tip = ARM.pose(Q[i]) @ to_matrix(Pose(tool))
    turn = Rotation.from_matrix(tip[:3, :3]).as_rotvec()
    turn *= 1.0 + turns * 2.0 * np.pi / np.linalg.norm(turn)
    return f"p[{row([*tip[:3, 3], *turn])}]"


def joints(i):
    return f"[{row(Q[i])}]"


FRAMES = ("p[0.35, -0.12, 0.26, 0.0, 0.0, 0.2]", "p[0.1, 0.2, -0.05, 0.1, 0.0, -0.3]")


def framed(i, k):
    """The pose of point i in a frame."""
    frame = to_matrix(Pose(eval(FRAMES[k][1:])))
    return f"p[{row(to_pose(np.linalg.inv(frame) @ ARM.pose(Q[i]) @ to_matrix(Pose(TOOL))))}]"


SET = f"set_tcp(p[{row(TOOL)}])\n"
OTHER = f"set_tcp(p[{row(OTHER_TOOL)}])\n"
RIGHT = {
    "joint angles and poses": f"{SET}movej({joints(0)})\nmovej({pose(1)}, a=1.2, v=0.3)\n"
                              f"movel({pose(2)}, r=0.01)",
    "tools change between motions": f"{SET}movej({pose(1)})\n{OTHER}movel({pose(2, OTHER_TOOL)})\n"
                                    f"{SET}movel({pose(3)})",
    "loads change between motions":
        f"{SET}set_payload(1.0, [0,0,0.1])\nmovej({pose(1)})\nset_payload(4.5, [0.02, 0.0, 0.15])\n"
        f"movej({pose(2)})\n"
        f"set_target_payload(2.5, [0.0, 0.03, 0.1], [0, 0, 0, 0, 0, 0])\nmovel({pose(3)})",
    "blanks, comments, strings":
        f'# movej({joints(5)})\n{SET}textmsg("movej([1,2,3,4,5,6])")\n'
        f'movej( {joints(1)} ) # movel({pose(2)})\n'
        f"movel ({pose(2).replace(', ', ' ,').replace('[', ' [ ')} , v = 0.1)",
    "a variable that is set once": f"{SET}here = {pose(1)}\nthere={joints(2)}\nmovej(here)\nmovej(there)\n"
                                   f"movel(here)",
    "a global variable": f"{SET}global here = {pose(1)}\nlocal there = {pose(2)}\nmovej(here)\nmovel(there)",
    "poses as its own editor writes them": (
        f"{SET}global w_1_p={pose(1)}\nglobal w_1_q={joints(1)}\nglobal w_2_p={pose(2)}\n"
        f"movej(get_inverse_kin(w_1_p, qnear=w_1_q), a=1.4, v=1.05)\nmovel(w_2_p, a=1.2, v=0.25)\n"
        f"movej(get_inverse_kin({pose(3)}, qnear={joints(3)}), a=1.4)\n"
        f"movej(get_inverse_kin(w_2_p,{joints(2)}))"),
    "names of arguments": f"{SET}movej(q={joints(1)}, a=1.4)\nmovel(pose={pose(2)}, v=0.1)",
    "an arc": f"{SET}movej({pose(1)})\nmovec({pose(2)}, {pose(3)}, a=1.2, v=0.2)",
    "an arc of the usual mode": f"{SET}movej({pose(1)})\n"
                                f"movec({pose(2)}, {pose(3)}, a=1.2, v=0.2, r=0, mode=0)",
    "a loop": f"{SET}i = 0\nwhile i < 2:\nmovej({pose(1)})\nmovel({pose(2)})\ni = i + 1\nend",
    "a branch": f"{SET}if 1 < 2:\nmovej({pose(1)})\nelse:\nmovej({pose(2)})\nend\nmovel({pose(3)})",
    "a routine": f"{SET}def sub():\nmovel({pose(2)})\nend\nmovej({pose(1)})\nsub()\nsub()",
    "a thread of joint targets": f"{SET}servoj({joints(1)}, 0, 0, 0.008, 0.1, 300)\n"
                                 f"servoj({joints(2)}, t=0.008)",
    "a rotation vector of more than a turn": f"{SET}movej({pose(1, turns=1)})\nmovel({pose(2, turns=-1)})",
    "poses in a frame": f"{SET}a = {pose(1)}\nb = p[0,0,0.01,0,0.1,0]\nmovej(pose_trans(a, b))\n"
                        f"movel(pose_trans(a, p[0.02,0,-0.01,0,0,0.1]), a=1.2, v=0.25)\n"
                        f"movej(get_inverse_kin(pose_trans(a, p[0.01,0,0,0,0,0]), qnear={joints(1)}))\n"
                        f"movel(pose_trans(pose_trans(a, p[0,0,0.01,0,0,0]), p[0,0.03,0,0,0,0]))",
    "a frame that is set again, as offline programs have it": (
        f"global frame = p[0,0,0,0,0,0]\n{SET}movej({joints(0)},1.2,0.7,0,0.0)\n"
        f"frame = {FRAMES[0]}\nmovel(pose_trans(frame,{framed(1, 0)}),1.2,0.25,0,0.001)\n"
        f"frame = {FRAMES[1]}\nmovel(pose_trans(frame,{framed(2, 1)}),1.2,0.25,0,0.001)\n"
        f"movel(pose_trans(frame,{framed(3, 1)}))"),
    "numbers in every form": f"{SET}movej([{', '.join(f'{v:+.10e}' for v in Q[1])}])",
    "a name that looks like a pose": f"{SET}stop = {joints(1)}\nmovej(stop)\nmovep({pose(2)}, r=0.02)",
}
REFUSED = {
    "another base": f"{SET}set_base(p[0.1,0,0,0,0,0])\nmovej({pose(1)})",
    "a base that is set on one line with its condition":
        f"{SET}movej({pose(1)})\nif 1 > 2: set_tcp(p[{row(OTHER_TOOL)}]) end\nmovel({pose(2)})",
    "an offset of the path":
        f"{SET}path_offset_enable()\npath_offset_set(p[0,0,0.01,0,0,0], 1)\nmovel({pose(1)})",
    "a conveyor":
        f"{SET}track_conveyor_linear(p[1,0,0,0,0,0], 500.0)\nmovel({pose(1)})\nstop_conveyor_tracking()",
    "a round conveyor": f"{SET}track_conveyor_circular(p[0.5,0,0,0,0,0], 500.0)\nmovel({pose(1)})",
    "an arc that turns with its tangent":
        f"{SET}movej({pose(1)})\nmovec({pose(2)}, {pose(3)}, a=1.2, v=0.2, mode=1)",
    "an arc that turns with its tangent, by place":
        f"{SET}movej({pose(1)})\nmovec({pose(2)}, {pose(3)}, 1.2, 0.2, 0.0, 1)",
    "a variable that is set on the line of its condition":
        f"{SET}a = {pose(1)}\nif 1 < 2: a = {pose(2)} end\nmovej(a)",
    "a tool with a name": f'a = 0.2\nset_tcp(p[0,0,a,0,0,0], "grip")\nmovej({pose(1)})',
    "a variable that another routine sets": f"{SET}a = {pose(1)}\ndef sub():\nglobal a = {pose(2)}\nend\n"
                                            f"movej(a)\nsub()\nmovej(a)",
    "a variable that changes": f"{SET}q = {joints(1)}\nmovej(q)\nq = {joints(2)}\nmovej(q)",
    "an element that changes": f"{SET}q = {joints(1)}\nq[0] = q[0] + 0.05\nmovej(q)",
    "an element that changes behind the motion, in a loop":
        f"{SET}q = {joints(1)}\ni = 0\nwhile i < 2:\nmovej(q)\nq[0] = q[0] + 0.05\ni = i + 1\nend",
    "a pose in a frame that is a target, too": f"{SET}a = {pose(1)}\nmovej(a)\n"
                                               f"movej(pose_trans(a, p[0,0,0.01,0,0,0]))",
    "a pose in a frame that changes": f"{SET}a = {pose(1)}\na[2] = 0.3\n"
                                      f"movej(pose_trans(a, p[0,0,0.01,0,0,0]))",
    "a frame that hangs on a branch":
        f"{SET}f = {FRAMES[0]}\nif 1 > 2:\nf = {FRAMES[1]}\nend\nmovej(pose_trans(f, {framed(1, 0)}))",
    "a frame that a routine sets":
        f"{SET}global f = {FRAMES[1]}\ndef sub():\nglobal f = {FRAMES[0]}\nend\nsub()\n"
        f"movej(pose_trans(f, {framed(1, 0)}))",
    "a frame that a loop sets further down":
        f"{SET}f = {FRAMES[0]}\ni = 0\nwhile i < 2:\nmovej(pose_trans(f, {framed(1, 0)}))\n"
        f"f = {FRAMES[1]}\ni = i + 1\nend",
    "one pose in a frame that is set again":
        f"{SET}b = {framed(1, 0)}\nf = {FRAMES[0]}\nmovej(pose_trans(f, b))\n"
        f"f = p[0.36, -0.12, 0.26, 0, 0, 0.2]\nmovej(pose_trans(f, b))",
    "a frame that is set before it has numbers": f"{SET}f = pose_inv({FRAMES[0]})\nf[2] = 0.3\n"
                                                 f"movej(pose_trans(f, {framed(1, 0)}))",
    "a tool that a thread sets": f"{SET}thread hand():\nwhile True:\n{OTHER}sleep(1)\nend\nend\n"
                                 f"x = run hand()\n{SET}movej({pose(1)})",
    "a pose in two frames": f"{SET}a = {pose(1)}\nb = p[0,0,0.01,0,0,0]\nmovej(pose_trans(a, b))\n"
                            f"movej(pose_trans({pose(2)}, b))",
    "a pose that is computed from another": f"{SET}a = {pose(1)}\nb = pose_add(a, p[0,0,0.01,0,0,0])\n"
                                            f"movej(b)",
    "a sum in a pose": f"{SET}x = 0.01\nmovej({pose(1).replace(',', ' + x,', 1)})",
    "arithmetic in joint angles": f"{SET}movej({joints(1)[:-1]} + 0.1])",
    "degrees": f"{SET}movej([{', '.join(f'd2r({np.degrees(v):.8f})' for v in Q[1])}])",
    "an argument of a routine": f"{SET}def go(t):\nmovej(t)\nend\ngo({pose(1)})\ngo({pose(2)})",
    "a tool from a variable": f"tool = p[{row(TOOL)}]\ntool[2] = 0.3\nset_tcp(tool)\nmovej({pose(1)})",
    "a tool that hangs on a branch": f"{SET}if 1 > 2:\n{OTHER}end\nmovej({pose(1)})",
    "a tool that a routine sets": f"{SET}def hand():\n{OTHER}end\nhand()\nmovej({pose(1, OTHER_TOOL)})",
    "a loop that calls what sets a tool":
        f"{SET}def hand():\n{OTHER}end\ni = 0\nwhile i < 2:\nmovej({pose(1)})\nhand()\ni = i + 1\nend",
    "one variable with two tools": f"{SET}a = {pose(1)}\nmovej(a)\n{OTHER}movej(a)",
    "one variable with two loads": f"{SET}set_payload(1.0, [0,0,0.1])\na = {pose(1)}\nmovej(a)\n"
                                   f"set_payload(5.0, [0,0,0.1])\nmovej(a)",
    "a load from a variable": f"{SET}m = 4.0\nset_payload(m, [0,0,0.1])\nmovej({pose(1)})",
    "a mass alone": f"{SET}set_payload_mass(4.0)\nmovej({pose(1)})",
    "the inverse by the controller": f"{SET}movej(get_inverse_kin({pose(1)}))",
    "a straight motion to where the arm is": f"{SET}movej({pose(1)})\n"
                                             f"movel(pose_trans(get_target_tcp_pose(), p[0,0,0.01,0,0,0]))",
    "a variable of a routine with the name of an outer one":
        f"{SET}a = {pose(1)}\ndef sub():\nlocal a = {pose(2)}\nmovej(a)\nend\nsub()\nmovej(a)",
    "an array that is multiplied": f"{SET}q = {joints(1)} * 1.01\nmovej(q)",
    "an array that is multiplied in the call": f"{SET}movej({joints(1)} * 1.01)",
    "a list of targets": f"{SET}way = [{pose(1)}, {pose(2)}]\nmovej(way[0])\nmovej(way[1])",
}


def files(body):
    lines = ["def prog():", *(f"  {line}" for line in body.splitlines()), "end", ""]
    return {"prog.script": "\n".join(lines).encode()}


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.slow
def test_every_motion_reaches_what_the_program_meant(tmp_path, name):
    corrected(tmp_path, ROBOT, execute, files(RIGHT[name]), **START)


def test_the_tool_of_the_program_counts_and_not_that_of_the_command_line(tmp_path):
    program = files(f"movej({pose(1, OTHER_TOOL)})\n{SET}movel({pose(2)})")
    given = ",".join(map(str, OTHER_TOOL))
    with_tool = lambda it: urscript.execute(it, ARM, Q[0], OTHER_TOOL)
    corrected(tmp_path, ROBOT, with_tool, program, tool=[given], **START)


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_one_right_number_is_refused(tmp_path, name):
    refused(tmp_path, ROBOT, files(REFUSED[name]), **START)
