"""A virtual cell: a nominal arm, the identified one that is also the true one, and programs of it in every
dialect.

Numbers are written and read here by the standard library and scipy alone, so that no test asks the readers
about themselves.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from exactarm import _core
from exactarm.chain import Layout, predict_poses
from exactarm.compensate.law import CompensationModel
from exactarm.data.dataset import Dataset
from exactarm.effects.backlash import Backlash
from exactarm.effects.joint_compliance import JointCompliance
from exactarm.robot.mdh_frames import compose, relative
from exactarm.robot.robot import Placement, Robot
from exactarm.robot_file import load_robot

TOOL = (85.0, -30.0, 210.0, 20.0, 35.0, -15.0)  # mm, deg: x y z, a b c about z, y, x
BASE = (350.0, -120.0, 260.0, 12.0, -3.0, 4.0)
# fine, so that rounding to whole pulses stays below a micrometre
PULSES = (1e7, 1.1e7, -0.9e7, 1e7, -1e7, 0.8e7)
LOAD = (4.0, (0.02, -0.03, 0.11))


def identified(name: str = "racer-7-1.4", seed: int = 1, effects: bool = True, **controller) -> Robot:
    """An arm as a calibration hands it on: other frames and offsets than its controller has, gear tables,
    effects."""
    robot, rng = load_robot(name).with_controller_frames, np.random.default_rng(seed)
    joints = []
    for i, joint in enumerate(robot.joints):
        length, angle = lambda: 5e-4 * rng.normal(), lambda: 1e-3 * rng.normal()
        moved = {"d": joint.d + length()} if joint.beta is None else {"beta": joint.beta + angle()}
        moved |= {"a": joint.a + length(), "alpha": joint.alpha + angle(),
                  "q_offset": joint.q_offset + angle()}
        joints.append(replace(joint, controller_offset=float(robot.controller_offsets[i]), **moved))
    found = (JointCompliance(2, (4e-7, 0.0)), Backlash(3, (3e-4, 20.0))) if effects else ()
    return replace(robot, joints=tuple(joints), effects=found,
                   controller=replace(robot.controller, **controller))


def reachable(robot: Robot, count: int, seed: int = 2) -> np.ndarray:
    """(count, n) joint angles away from limits and singular poses."""
    rng, model = np.random.default_rng(seed), CompensationModel.of(robot)
    low, high = np.clip(model.controller.limits, -2.8, 2.8)
    q = low + (high - low) * rng.uniform(0.15, 0.85, (40 * count, robot.axes))
    good = model.commands(model.controller.poses(q), q).amplification < 20.0
    return q[good][:count]


def nearby(robot: Robot, count: int, seed: int = 2) -> np.ndarray:
    """(count, n) joint angles on one branch of the arm, so close together that no other branch is nearer."""
    middle = reachable(robot, 1, seed)
    return middle + np.random.default_rng(seed).uniform(-0.15, 0.15, (count, robot.axes))


def zyx(numbers) -> Placement:
    """x y z mm, a b c deg with R = Rz(a) Ry(b) Rx(c)."""
    return Placement(Rotation.from_euler("ZYX", numbers[3:6], degrees=True).as_matrix(),
                     1e-3 * np.array(numbers[:3]))


@dataclass(frozen=True)
class Cell:
    """The identified arm, the frames of the program, and what the arm does with a command."""

    robot: Robot
    tool: Placement = zyx(TOOL)
    base: Placement = zyx(BASE)

    @property
    def nominal(self) -> _core.Robot:
        return CompensationModel.of(self.robot).controller.core

    def tip(self, q: np.ndarray) -> list[Placement]:
        """What the controller takes for the pose of the tip in its base, at joint angles (N, n)."""
        position, rotation = _core.forward_kinematics(self.nominal, q)
        return [compose(relative(self.base, Placement(r, p)), self.tool) for p, r in zip(position, rotation)]

    def joints(self, tips: list[Placement], near: np.ndarray) -> np.ndarray:
        """The controller's joint angles of poses of the tip in its base."""
        found = []
        for tip, start in zip(tips, near):
            flange = compose(compose(self.base, tip), relative(self.tool, Placement()))
            q, report = _core.inverse_kinematics_path(self.nominal, flange.position[None],
                                                      flange.rotation.reshape(1, 9), start)
            assert report.status == _core.InverseKinematicsStatus.solved
            found.append(q[0])
        return np.array(found)

    def true_tip(self, q: np.ndarray, approach: np.ndarray, load=None) -> np.ndarray:
        """(N, 3) where the tip of the real arm is, in the base of the program, m."""
        robot = self.robot
        if load is not None:
            from exactarm.effects.payload import Payload

            robot = replace(robot, effects=(*robot.effects,
                                            Payload(None, (load[0], *(load[0] * np.array(load[1]))))))
        arm = replace(robot, base=Placement(), tool=self.tool)
        data = Dataset.of_arrays("poses", {"q": q, "approach": approach})
        there = predict_poses(arm, Layout.of(robot.effects, estimate=False), data, tangents=False).position
        return (there - self.base.position) @ self.base.rotation

    def approach(self, q: np.ndarray) -> np.ndarray:
        """Joint motions in the order of the rows; nothing is known of the first."""
        steps = np.vstack([np.zeros(q.shape[1]), np.sign(np.diff(q, axis=0))])
        return steps * np.sign(self.robot.ratios)


# -- programs -------------------------------------------------------------------------------------------
def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?", text)]


def sign_bits(q: np.ndarray) -> int:
    return sum(1 << i for i, angle in enumerate(q) if angle < 0.0)


def krl(cell: Cell, q: np.ndarray, linear: bool = False) -> dict[str, bytes]:
    """A pair with CRLF, Latin-1 comments and a literal of axis angles at its end."""
    data = ["&ACCESS RVP", "DEFDAT prog PUBLIC", ";FOLD Pr\u00fcfling {X 1}"]
    source = ["DEF prog()", "  PTP XHOME"]
    for i, (tip, angles) in enumerate(zip(cell.tip(q), q), start=1):
        a, b, c = Rotation.from_matrix(tip.rotation).as_euler("ZYX", degrees=True)
        x, y, z = 1e3 * tip.position
        status = 4 * int(angles[4] < 0)
        data.append(f"DECL E6POS XP{i}={{X {x:.6f},Y {y:.6f},Z {z:.6f},A {a:.7f},B {b:.7f},C {c:.7f},"
                    f"S {status},T {sign_bits(angles)},E1 0.0}} ; point {i}")
        data.append(f'DECL FDAT FP{i}={{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " "}}')
        source.append(f"  {'LIN' if linear and i > 1 else 'PTP'} XP{i} ; move {i}")
    source.append("PTP {" + ",".join(f"A{k} {angle:.7f}" for k, angle in enumerate(np.degrees(q[0]), start=1))
                  + "} C_PTP")
    encode = lambda lines: ("\r\n".join(lines) + "\r\n").encode("latin-1")
    return {"prog.src": encode([*source, "END"]), "prog.dat": encode([*data, "ENDDAT"])}


def read_krl(files: dict[str, bytes]) -> list[Placement]:
    text = files["prog.dat"].decode("latin-1")
    return [zyx(numbers(re.sub(r"[A-Z]\d? ", "", match))[:6])
            for match in re.findall(r"E6POS XP\d+=\{([^}]*)\}", text)]


def urscript(cell: Cell, q: np.ndarray) -> dict[str, bytes]:
    lines = ["def prog():", "  # caf\u00e9 movej([1,2,3])"]
    tool = [*cell.tool.position, *Rotation.from_matrix(cell.tool.rotation).as_rotvec()]
    lines.append("  set_tcp(p[" + ", ".join(f"{value:.12f}" for value in tool) + "])")
    lines.append(f"  set_payload({LOAD[0]}, [{', '.join(map(str, LOAD[1]))}])")
    lines.append("  start = [" + ",".join(f"{angle:.9f}" for angle in q[0]) + "]")
    lines.append("  movej(start, a=1.4, v=1.05)")
    for i, tip in enumerate(cell.tip(q)[1:], start=2):
        pose = [*tip.position, *Rotation.from_matrix(tip.rotation).as_rotvec()]
        lines.append(f"  move{'jl'[i % 2]}(p[" + ", ".join(f"{value:.9f}" for value in pose)
                     + "], a=1.2, v=0.25, r=0.01)")
    return {"prog.script": "\n".join([*lines, "end"]).encode()}


def read_urscript(files: dict[str, bytes]) -> list[Placement]:
    text = files["prog.script"].decode()
    poses = [numbers(match) for match in re.findall(r"move.\(p\[([^\]]*)\]", text)]
    return [Placement(Rotation.from_rotvec(pose[3:]).as_matrix(), np.array(pose[:3])) for pose in poses]


def rapid(cell: Cell, q: np.ndarray) -> dict[str, bytes]:
    quaternion = lambda placement: np.roll(Rotation.from_matrix(placement.rotation).as_quat(), 1)
    row = lambda values, digits: "[" + ",".join(f"{value:.{digits}f}" for value in values) + "]"
    frame = lambda placement: f"[{row(1e3 * placement.position, 6)},{row(quaternion(placement), 10)}]"
    nowhere = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"
    lines = ["MODULE prog", "  ! MoveL [[1,2,3]] caf\u00e9"]
    load = f"[{LOAD[0]},{row(1e3 * np.array(LOAD[1]), 3)},[1,0,0,0],0,0,0]"
    lines.append(f"  PERS tooldata torch:=[TRUE,{frame(cell.tool)},{load}];")
    lines.append(f'  TASK PERS wobjdata table:=[FALSE,TRUE,"",{frame(cell.base)},[[0,0,0],[1,0,0,0]]];')
    first = ",".join(f"{angle:.7f}" for angle in np.degrees(q[0]))
    moves = [f"    MoveAbsJ [[{first}],{nowhere}]\\NoEOffs,v200,fine,torch;"]
    for i, (tip, angles) in enumerate(zip(cell.tip(q), q), start=1):
        word = [int(np.floor(angle / (np.pi / 2))) for angle in angles[[0, 3, 5]]] + [int(angles[4] < 0)]
        target = (
            f"[{row(1e3 * tip.position, 5)},{row(quaternion(tip), 9)},[{','.join(map(str, word))}],{nowhere}]"
        )
        if i % 2:
            lines.append(f"  CONST robtarget p{i}:={target};")
            moves.append(f"    MoveJ p{i},v100\\V:=50,fine,torch\\WObj:=table; ! p{i}")
        else:
            moves.append(f"    MoveJ {target},v100,z10,torch\\WObj:=table;")
    return {"prog.mod": "\n".join([*lines, "  PROC main()", *moves, "  ENDPROC", "ENDMODULE", ""]).encode()}


def read_rapid(files: dict[str, bytes]) -> list[Placement]:
    text = re.sub(r"!.*", "", files["prog.mod"].decode())
    named = dict(re.findall(r"robtarget (\w+):=(\[\[.*?\]\]);", text))
    targets = [named.get(word, word) for word in re.findall(r"MoveJ (\w+|\[\[.*?\],\[9E)", text)]
    poses = [numbers(target)[:7] for target in targets]
    turned = lambda wxyz: Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
    return [Placement(turned(pose[3:]), 1e-3 * np.array(pose[:3])) for pose in poses]


def fanuc(cell: Cell, q: np.ndarray) -> dict[str, bytes]:
    """The first position in joint angles, J3 counted from the horizon; comments and a second group stay."""
    moves, places = [], []
    for i, (tip, angles) in enumerate(zip(cell.tip(q), q), start=1):
        r, p, w = Rotation.from_matrix(tip.rotation).as_euler("ZYX", degrees=True)
        x, y, z = 1e3 * tip.position
        moves.append(f"{i:4d}:J P[{i}:at {i}] 100% CNT100    ;\n   {i}:  !P[9] {i} ;")
        if i == 1:
            shown = np.degrees(angles - np.array([0, 0, angles[1], 0, 0, 0]))
            body = ",\n\t".join(f"J{k}= {angle:10.7f} deg" for k, angle in enumerate(shown, start=1))
        else:
            body = (f"CONFIG : 'N U T, 0, 0, 0',\n\tX = {x:12.6f}  mm,\tY = {y:12.6f}  mm,\tZ = {z:12.6f}  "
                    "mm,\n"
                    f"\tW = {w:12.7f} deg,\tP = {p:12.7f} deg,\tR = {r:12.7f} deg")
        places.append(
            f'P[{i}:"at {i}"]{{\n   GP1:\n\tUF : 3, UT : 4,\t\t{body}\n   '
            f'GP2:\n\tUF : 0, UT : 1,\n\tJ1= 0.000 deg\n}};'
        )
    return {"prog.ls": "\n".join(["/PROG  PROG", "/ATTR", "/MN", *moves, "/POS", *places, "/END",
                                  ""]).encode()}


def read_fanuc(files: dict[str, bytes]) -> list[Placement]:
    poses = []
    for body in re.findall(r"CONFIG(.*?)GP2", files["prog.ls"].decode(), re.S):
        x, y, z, w, p, r = numbers(re.sub(r"'[^']*'", "", body))
        poses.append(zyx([x, y, z, r, p, w]))
    return poses


def inform(cell: Cell, q: np.ndarray) -> dict[str, bytes]:
    """The first position in pulses, the others in the user frame."""
    places = ["///TOOL 5", "///POSTYPE PULSE", "///PULSE"]
    places.append("C00000=" + ",".join(str(round(angle * scale)) for angle, scale in zip(q[0], PULSES)))
    places += ["///USER 2", "///POSTYPE USER", "///RECTAN", "///RCONF 0,0,0,0,0,0,0,0"]
    for i, tip in enumerate(cell.tip(q)[1:], start=1):
        c, b, a = Rotation.from_matrix(tip.rotation).as_euler("ZYX", degrees=True)
        values = [*(1e3 * tip.position), a, b, c]
        places.append(f"C{i:05d}=" + ",".join(f"{value:.7f}" for value in values))
    moves = ["NOP", "'MOVJ C00009 VJ=1"] + [f"MOVJ C{i:05d} VJ=50.00" for i in range(len(q))]
    lines = ["/JOB", "//NAME PROG", "//POS", "///NPOS 8,0,0,0,0,0", *places, "//INST", "///GROUP1 RB1",
             *moves, "END", ""]
    return {"prog.jbi": "\r\n".join(lines).encode()}


def read_inform(files: dict[str, bytes]) -> list[Placement]:
    poses = []
    for body in re.findall(r"C\d{5}=(.*)", files["prog.jbi"].decode())[1:]:
        x, y, z, a, b, c = numbers(body)
        poses.append(zyx([x, y, z, c, b, a]))
    return poses


def trajectory(q: np.ndarray, step_s: float = 0.1) -> dict[str, bytes]:
    """Names in the order of the alphabet, as some drivers give them."""
    order = [2, 1, 0, 3, 4, 5]
    lines = ["# \u00e9", "joint_names: [" + ", ".join(f"axis_{i + 1}" for i in order) + "]", "points:"]
    for k, row in enumerate(q):
        nanoseconds = round(1e9 * step_s * k)
        lines += ["- positions: [" + ", ".join(repr(float(row[i])) for i in order) + "]  # " + str(k),
                  f"  time_from_start: {{sec: {nanoseconds // 10**9}, nanosec: {nanoseconds % 10**9}}}"]
    return {"prog.yaml": ("\n".join(lines) + "\n").encode()}


def read_trajectory(files: dict[str, bytes]) -> np.ndarray:
    rows = [numbers(match) for match in re.findall(r"positions: \[([^\]]*)\]", files["prog.yaml"].decode())]
    return np.array(rows)[:, [2, 1, 0, 3, 4, 5]]
