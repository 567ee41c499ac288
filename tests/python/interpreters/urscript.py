"""An interpreter of URScript (Universal Robots, The URScript Programming Language, PolyScope 5).

m, rad, poses p[x, y, z, rx, ry, rz] with a rotation vector, in the base of the arm. The lines become
Python's, and Python's own parser and evaluation do the rest: expressions, loops, branches, routines. Lists
and poses are copied when they are assigned; a name that no outer scope has is its routine's own. Motions to a
pose are those of the tip (set_tcp), by the joint angles nearest to the ones before.
"""

from __future__ import annotations

import ast
import copy
import math
import re
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from .motion import Arm, Run, Unknown, matrix

SILENT = ("textmsg", "popup", "sleep", "sync", "set_digital_out", "set_standard_digital_out", "stopj",
          "stopl",
          "set_tool_digital_out", "set_analog_out", "set_gravity", "halt")


class Pose(list):
    pass


def to_matrix(pose) -> np.ndarray:
    if not isinstance(pose, Pose) or len(pose) != 6:
        raise Unknown(f"{pose} is no pose")
    return matrix(pose[:3], Rotation.from_rotvec(pose[3:]).as_matrix())


def to_pose(frame) -> Pose:
    return Pose([*frame[:3, 3].tolist(), *Rotation.from_matrix(frame[:3, :3]).as_rotvec().tolist()])


def python_of(text: str) -> str:
    """Lines of Python, one for each line, blocks by their indentation."""
    lines, depth = [], 0
    for line in text.splitlines():
        line = re.match(r'(?:[^#"]|"[^"]*"?)*', line).group().strip()
        line = re.sub(r"^(sec|thread)\b", "def", line)
        if line == "end":
            depth -= 1
            lines.append("")
            continue
        middle = re.match(r"(elif|else)\b", line)
        line = re.sub(r"^local\s+(?=\w+\s*=)", "", line)
        line = re.sub(r"^global\s+(\w+)\s*=", r"__global__.\1 =", line)
        line = poses_of(line)
        lines.append("    " * (depth - bool(middle)) + (line or "pass" if depth or line else ""))
        if line.endswith(":") and not middle:
            depth += 1
    return "\n".join(lines) + "\n"


def poses_of(line: str) -> str:
    while match := re.search(r"(?<![\w\"])p\s*\[", line):
        depth, at = 0, match.end() - 1
        while True:
            depth += {"[": 1, "]": -1}.get(line[at], 0)
            if depth == 0:
                break
            at += 1
        line = f"{line[:match.start()]}__pose__({line[match.end():at]}){line[at + 1:]}"
    return line


class Names(ast.NodeTransformer):
    """Every name is looked up in the scopes of URScript, not of Python."""

    def visit_Name(self, node):
        if node.id.startswith("__") or node.id in ("True", "False"):
            return node
        return ast.copy_location(ast.Attribute(ast.Name("__scope__", ast.Load()), node.id, node.ctx), node)

    def visit_FunctionDef(self, node):
        names, node.args = [arg.arg for arg in node.args.args], ast.arguments([], [], None, [], [], None, [])
        node.args.vararg = ast.arg("__given__")
        self.generic_visit(node)
        enter = ast.parse(f"__enter__({names!r}, __given__)").body
        body = ast.parse("try:\n    pass\nfinally:\n    __leave__()").body[0]
        body.body = node.body
        keep = ast.parse(f"__scope__.{node.name} = {node.name}").body
        node.body = [*enter, body]
        return [node, *keep]

    def visit_arg(self, node):
        return node


class Scope:
    def __init__(self, machine):
        object.__setattr__(self, "_machine", machine)

    def __getattr__(self, name):
        for scope in reversed(self._machine.scopes):
            if name in scope:
                return scope[name]
        found = self._machine.function(name)
        if found is None:
            raise Unknown(f"{name} is not known")
        return found

    def __setattr__(self, name, value):
        value = value if callable(value) else copy.deepcopy(value)
        for scope in reversed(self._machine.scopes):
            if name in scope:
                scope[name] = value
                return
        self._machine.scopes[-1][name] = value


class UrScript:
    def __init__(self, arm: Arm, start, file: str, tool=None):
        self.run, self.file, self.scopes = Run(arm, start), file, [{}]
        self.tool = np.eye(4) if tool is None else to_matrix(Pose(tool))

    def execute(self, text: str):
        tree = ast.fix_missing_locations(Names().visit(ast.parse(python_of(text))))
        scope, root = Scope(self), Scope(self)
        object.__setattr__(root, "__class__", Root)
        spaces = {"__scope__": scope, "__pose__": lambda *v: Pose(v), "__leave__": lambda: self.scopes.pop(),
                  "__enter__": self.enter, "__global__": root}
        exec(compile(tree, self.file, "exec"), spaces)
        routines = [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
        if routines and not self.run.motions:
            self.scopes[0][routines[-1]]()

    def enter(self, names, given):
        self.scopes.append({name: copy.deepcopy(value) for name, value in zip(names, given)})

    # -- what the controller knows -------------------------------------------------------------------
    def function(self, name):
        kinds = {"movej": "joint", "servoj": "joint", "movel": "line", "movep": "line", "servoc": "circle"}
        if name in kinds:
            return partial(self.move, kinds[name])
        if name in SILENT:
            return lambda *a, **k: None
        if name in ("sin", "cos", "tan", "sqrt", "asin", "acos", "atan", "atan2", "floor", "ceil", "pow"):
            return getattr(math, name)
        return getattr(self, f"do_{name}", None)

    def move(self, kind, target=None, *_, q=None, pose=None, **__):
        import sys

        target = next(given for given in (target, q, pose) if given is not None)
        frame = sys._getframe(1)
        while frame.f_code.co_filename != self.file:
            frame = frame.f_back
        where = f"{self.file}:{frame.f_lineno}"
        if isinstance(target, Pose):
            self.run.to_pose(kind, np.eye(4), to_matrix(target), self.tool, where)
        else:
            self.run.to_joints(kind, np.array(target, float), self.tool, where)

    def do_movec(self, via, to, *_, **__):
        self.move("circle", via)
        self.move("circle", to)

    def do_set_tcp(self, pose, *_):
        self.tool = to_matrix(pose)

    def do_set_payload(self, mass, centre=None, *_):
        self.run.load = (float(mass), tuple(centre if centre is not None else self.tool[:3, 3].tolist()))

    do_set_target_payload = do_set_payload

    def do_set_payload_mass(self, mass):
        self.run.load = (float(mass), self.run.load[1] if self.run.load else (0.0, 0.0, 0.0))

    def do_pose_trans(self, a, b):
        return to_pose(to_matrix(a) @ to_matrix(b))

    def do_pose_inv(self, a):
        return to_pose(np.linalg.inv(to_matrix(a)))

    def do_pose_add(self, a, b):
        one, two = to_matrix(a), to_matrix(b)
        return to_pose(matrix(one[:3, 3] + two[:3, 3], two[:3, :3] @ one[:3, :3]))

    def do_get_forward_kin(self, q=None, tcp=None):
        tool = self.tool if tcp is None else to_matrix(tcp)
        return to_pose(self.run.arm.pose(self.run.q if q is None else q) @ tool)

    do_get_actual_tcp_pose = do_get_target_tcp_pose = do_get_forward_kin

    def do_get_inverse_kin(self, pose, qnear=None, *_):
        flange = to_matrix(pose) @ np.linalg.inv(self.tool)
        return self.run.arm.joints(flange, self.run.q if qnear is None else qnear).tolist()

    def do_get_actual_joint_positions(self):
        return self.run.q.tolist()

    do_get_target_joint_positions = do_get_actual_joint_positions

    def do_d2r(self, angle):
        return math.radians(angle)

    def do_length(self, values):
        return len(values)


class Root(Scope):
    def __setattr__(self, name, value):
        self._machine.scopes[0][name] = copy.deepcopy(value)


def execute(files: dict[str, bytes], arm: Arm, start, tool=None) -> list:
    (name, content), = files.items()
    machine = UrScript(arm, start, name, tool)
    machine.execute(content.decode("latin-1"))
    return machine.run.motions
