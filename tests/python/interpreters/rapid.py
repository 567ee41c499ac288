"""An interpreter of ABB RAPID, as the technical reference manual describes it (instructions, functions, data
types).

mm, deg, quaternions with w first. A robtarget is of the TCP in the object frame: uframe * oframe * program
displacement; Offs moves it along that frame, RelTool along its own (Rx, then Ry, then Rz). A jointtarget
knows neither work object nor displacement. Records are lists; a component is a place in them. In a MoveJ,
cf1, cf4 and cf6 must be the quarter turns of their axes. The load is that of the tool, in the wrist frame.
"""

from __future__ import annotations

import copy
import math
import operator

import numpy as np
from scipy.spatial.transform import Rotation

from .motion import Arm, Run, Unknown, matrix
from .rapid_syntax import modules

PLACES = {"trans": 0, "rot": 1, "robconf": 2, "extax": 3, "x": 0, "y": 1, "z": 2, "q1": 0, "q2": 1, "q3": 2,
          "q4": 3, "robhold": 0, "tframe": 1, "tload": 2, "uframe": 3, "oframe": 4, "robax": 0, "mass": 0,
          "cog": 1}
PLACES |= {f"rax_{i}": i - 1 for i in range(1, 7)} | {"cf1": 0, "cf4": 1, "cf6": 2, "cfx": 3}
# instruction: kind, places of its points and of its tool among the positional arguments
MOTIONS = {"movel": ("line", (0,), 3), "movej": ("joint", (0,), 3), "movec": ("circle", (0, 1), 4),
           "moveabsj": ("joint", (0,), 3), "triggl": ("line", (0,), 4), "triggj": ("joint", (0,), 4),
           "triggc": ("circle", (0, 1), 5), "moveldo": ("line", (0,), 3), "movejdo": ("joint", (0,), 3),
           "movelsync": ("line", (0,), 3), "movejsync": ("joint", (0,), 3), "arcl": ("line", (0,), 5),
           "searchl": ("line", (2,), 4)}
SILENT = ("confl", "confj", "singarea", "velset", "accset", "waittime", "set", "reset", "setdo", "tpwrite",
          "waituntil",
          "tperase", "triggio", "waitdi", "stop", "pulsedo", "eoffsoff")
FRAME0 = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
BUILT_IN = {"tool0": [True, FRAME0, [0.001, [0, 0, 0.001], [1, 0, 0, 0], 0, 0, 0]],
            "wobj0": [False, True, "", FRAME0, FRAME0], "true": True, "false": False, "pi": math.pi}
OPERATORS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "=": operator.eq,
             "<>": operator.ne, "<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge,
             "and": lambda a, b: a and b, "or": lambda a, b: a or b, "xor": operator.xor,
             "div": operator.floordiv, "mod": operator.mod}


class Return(Exception):
    pass


def to_matrix(pose) -> np.ndarray:
    w, x, y, z = pose[1]
    return matrix(1e-3 * np.array(pose[0], float), Rotation.from_quat([x, y, z, w]).as_matrix())


def to_pose(frame) -> list:
    x, y, z, w = Rotation.from_matrix(frame[:3, :3]).as_quat()
    return [(1e3 * frame[:3, 3]).tolist(), [float(w), float(x), float(y), float(z)]]


class Rapid:
    def __init__(self, arm: Arm, start):
        self.run, self.scopes, self.routines = Run(arm, start), [copy.deepcopy(BUILT_IN)], {}
        self.displacement = np.eye(4)

    def load(self, name: str, text: str):
        data, routines = modules(name, text)
        self.routines |= routines
        for statement in data:
            self.execute(statement)

    # -- statements ----------------------------------------------------------------------------------
    def call(self, name: str, arguments: list, options: dict):
        parameters, body = self.routines[name]
        self.scopes.append(dict(zip(parameters, copy.deepcopy(arguments))) | copy.deepcopy(options))
        result = None
        try:
            self.block(body)
        except Return as end:
            result = end.args[0]
        self.scopes.pop()
        return result

    def block(self, statements):
        for statement in statements:
            self.execute(statement)

    def execute(self, statement):
        what, where, *rest = statement
        try:
            getattr(self, f"do_{what}")(where, *rest)
        except Unknown as error:
            raise Unknown(f"{where}: {error}") from None

    def do_declare(self, where, name, value):
        self.scopes[-1][name] = None if value is None else copy.deepcopy(self.value(value))

    def do_assign(self, where, path, value):
        name, *steps = path
        scope = next((scope for scope in (self.scopes[-1], self.scopes[0]) if name in scope), self.scopes[-1])
        value = copy.deepcopy(self.value(value))
        if not steps:
            scope[name] = value
            return
        holder = scope[name]
        for step in steps[:-1]:
            holder = holder[self.place(step)]
        holder[self.place(steps[-1])] = value

    def do_if(self, where, branches):
        for condition, body in branches:
            if condition is None or self.value(condition):
                return self.block(body)

    def do_for(self, where, name, first, last, step, body):
        count, stop = self.value(first), self.value(last)
        step = self.value(step) if step is not None else (1 if stop >= count else -1)
        while (count <= stop) if step > 0 else (count >= stop):
            self.scopes[-1][name] = count
            self.block(body)
            count += step

    def do_while(self, where, condition, body):
        while self.value(condition):
            self.block(body)

    def do_test(self, where, chosen, cases):
        chosen = self.value(chosen)
        for values, body in cases:
            if values is None or chosen in [self.value(value) for value in values]:
                return self.block(body)

    def do_return(self, where, value):
        raise Return(None if value is None else self.value(value))

    def do_call(self, where, name, arguments):
        if name in MOTIONS:
            return self.motion(where, name, arguments)
        if name in SILENT:
            return None
        values = [self.value(node) for option, node in arguments if option is None]
        options = {option: True if node is None else self.value(node) for option, node in arguments if option}
        if name == "pdispset":
            self.displacement = to_matrix(values[0])
        elif name == "pdispoff":
            self.displacement = np.eye(4)
        elif name in self.routines:
            self.call(name, values, options)
        else:
            raise Unknown(f"{name} is not known")

    # -- values --------------------------------------------------------------------------------------
    def place(self, step) -> int:
        kind, what = step
        if kind == "{":
            return int(self.value(what)) - 1
        return PLACES[what]

    def value(self, node):
        kind = node[0]
        if kind == "value":
            return node[1]
        if kind == "list":
            return [self.value(item) for item in node[1]]
        if kind == "name":
            name, *steps = node[1]
            for scope in (self.scopes[-1], self.scopes[0]):
                if name in scope:
                    found = scope[name]
                    break
            else:
                raise Unknown(f"{name} is not known")
            for step in steps:
                found = found[self.place(step)]
            return found
        if kind == "not":
            return not self.value(node[1])
        if kind == "minus":
            return -self.value(node[1])
        if kind == "function":
            return self.function(node[1], node[2])
        left, right = self.value(node[1]), self.value(node[2])
        if kind in "+-" and isinstance(left, list):
            return [OPERATORS[kind](a, b) for a, b in zip(left, right)]
        if kind == "*" and isinstance(left, list):
            return [a * right for a in left]
        return OPERATORS[kind](left, right)

    def function(self, name, arguments):
        values = [self.value(node) for option, node in arguments if option is None]
        options = {option: self.value(node) for option, node in arguments if option}
        if name == "offs":
            target = copy.deepcopy(values[0])
            target[0] = [a + b for a, b in zip(target[0], values[1:4])]
            return target
        if name == "reltool":
            turn = Rotation.from_euler("XYZ", [options.get(key, 0.0) for key in ("rx", "ry", "rz")],
                                       degrees=True)
            moved = to_matrix(values[0]) @ matrix(1e-3 * np.array(values[1:4], float), turn.as_matrix())
            return [*to_pose(moved), *copy.deepcopy(values[0][2:])]
        if name == "posemult":
            return to_pose(to_matrix(values[0]) @ to_matrix(values[1]))
        if name == "poseinv":
            return to_pose(np.linalg.inv(to_matrix(values[0])))
        if name == "orientzyx":
            return to_pose(matrix(np.zeros(3), Rotation.from_euler("ZYX", values,
                                                                   degrees=True).as_matrix()))[1]
        if name == "crobt":
            tool, base = options.get("tool", BUILT_IN["tool0"]), options.get("wobj", BUILT_IN["wobj0"])
            return [*to_pose(self.run.tip(self.base(base), to_matrix(tool[1]))), [0, 0, 0, 0], [9e9] * 6]
        if name == "cjointt":
            return [np.degrees(self.run.q).tolist(), [9e9] * 6]
        if name in ("sin", "cos"):
            return float(getattr(np, name)(np.radians(values[0])))
        if name in self.routines:
            return self.call(name, values, options)
        raise Unknown(f"function {name}")

    # -- motions -------------------------------------------------------------------------------------
    def base(self, wobj) -> np.ndarray:
        return to_matrix(wobj[3]) @ to_matrix(wobj[4]) @ self.displacement

    def motion(self, where, name, arguments):
        kind, points, tool_place = MOTIONS[name]
        values = [node for option, node in arguments if option is None]
        options = {option: self.value(node) for option, node in arguments if option in ("wobj", "tload")}
        tool, wobj = self.value(values[tool_place]), options.get("wobj", BUILT_IN["wobj0"])
        if not tool[0] or wobj[0]:
            raise Unknown("the tool is at rest")
        if "tload" in options:
            raise Unknown("a load of its own")
        mass, centre = tool[2][0], 1e-3 * np.array(tool[2][1], float)
        self.run.load = (float(mass), tuple(centre.tolist())) if mass > 0.01 else None
        for place in points:
            target = self.value(values[place])
            axes = target[-1]
            if any(0.0 < abs(value) < 9e9 for value in axes):
                raise Unknown("external axes")
            if len(target) == 2:
                self.run.to_joints(kind, np.radians(np.array(target[0], float)), to_matrix(tool[1]), where)
                continue
            self.run.to_pose(kind, self.base(wobj), to_matrix(target), to_matrix(tool[1]), where)
            quarters = [math.floor(self.run.q[i] / (np.pi / 2)) for i in (0, 3, 5)]
            if kind == "joint" and quarters != [int(value) for value in target[2][:3]]:
                raise AssertionError(f"{where}: {target[2]} are not the quarter turns {quarters}")


def execute(files: dict[str, bytes], arm: Arm, start) -> list:
    machine = Rapid(arm, start)
    for name, content in files.items():
        machine.load(name, content.decode("latin-1"))
    machine.call("main" if "main" in machine.routines else next(iter(machine.routines)), [], {})
    return machine.run.motions


