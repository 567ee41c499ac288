"""An interpreter of KUKA KRL: `.src` with its `.dat`, as the programming manuals of KSS 5 to 8 describe it.

R = Rz(A) Ry(B) Rx(C), mm, deg. $BASE counts from $ROBROOT = $WORLD. A component that the target of a motion
leaves out keeps its value of the position before; one that an assignment or a declaration leaves out is
not known. A pose with T must be reached with these signs of the axes.
"""

from __future__ import annotations

import copy
import operator
import re

import numpy as np

from .krl_syntax import Reader, without_comment
from .motion import Arm, Run, Unknown, numbers_zyx, zyx

POSE, AXES = tuple("XYZABC"), tuple(f"A{i}" for i in range(1, 7))
ARITHMETIC = {"+": operator.add, "-": operator.sub, "*": operator.mul, "==": operator.eq, "<>": operator.ne,
              "<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt,
              "AND": lambda a, b: a and b, "OR": lambda a, b: a or b, "EXOR": operator.xor}
OPEN = {"IF": "ENDIF", "FOR": "ENDFOR", "WHILE": "ENDWHILE", "LOOP": "ENDLOOP", "REPEAT": "UNTIL",
        "SWITCH": "ENDSWITCH", "SPLINE": "ENDSPLINE"}
BASIC = ("INT", "REAL", "BOOL", "CHAR", "FRAME", "POS", "E6POS", "AXIS", "E6AXIS")
MOTIONS = {"PTP": "joint", "SPTP": "joint", "LIN": "line", "SLIN": "line", "CIRC": "circle",
           "SCIRC": "circle",
           "SPL": "spline", "PTP_REL": "joint", "LIN_REL": "line", "SPTP_REL": "joint", "SLIN_REL": "line"}
NULL = dict.fromkeys(POSE, 0.0)
IGNORED = ("ENUM", "STRUC", "EXT", "SIGNAL", "GLOBAL", "INTERRUPT", "WAIT", "PULSE", "TRIGGER", "CONTINUE",
           "HALT",
           "DEFDAT", "ENDDAT", "EXTFCT", "ANOUT", "PUBLIC")


class Leave(Exception):
    pass


class Krl:
    def __init__(self, arm: Arm, start, tools: dict, bases: dict):
        self.run, self.depth = Run(arm, start), 0
        self.system = {"$TOOL": None, "$BASE": None, "$NULLFRAME": NULL, "$WORLD": NULL, "$ROBROOT": NULL,
                       "$IPO_MODE": "#BASE", "TOOL_DATA": {int(k): dict(zip(POSE, v)) for k,
                                                           v in tools.items()},
                       "BASE_DATA": {int(k): dict(zip(POSE, v)) for k, v in bases.items()} | {0: NULL}}
        self.data, self.scopes, self.routines = {}, [], {}

    # -- text ----------------------------------------------------------------------------------------
    def load(self, name: str, text: str):
        lines = [(f"{name}:{i}", without_comment(line)) for i, line in enumerate(text.splitlines(), start=1)]
        lines = [(where, line) for where, line in lines if line and not line.startswith("&")]
        if name.lower().endswith(".dat"):
            for where, line in lines:
                self.statement(where, line)
            return
        routine = None
        for where, line in lines:
            head = re.match(r"(?i)(?:GLOBAL\s+)?DEF(?:FCT\s+\w+)?\s+(\w+)\s*\((.*)\)", line)
            if head:
                routine = self.routines.setdefault(head[1].upper(), (head[2], []))
                self.first = getattr(self, "first", head[1].upper())
            elif re.match(r"(?i)END(FCT)?\s*$", line):
                routine = None
            elif routine is not None:
                routine[1].append((where, line))

    def call(self, name: str, arguments):
        header, lines = self.routines[name]
        names = [(part.split(":")[0].strip().upper(), part.split(":")[-1].strip().upper())
                 for part in header.split(",") if part.strip()]
        scope = {n: copy.deepcopy(self.value(a)) for (n, _), a in zip(names, arguments)}
        self.scopes.append(scope)
        try:
            self.block(lines, 0, len(lines))
        except Return:
            pass
        self.scopes.pop()
        for (n, way), argument in zip(names, arguments):
            if way == "OUT" and argument[0] == "name":
                self.assign(argument[1], scope[n])

    # -- control -------------------------------------------------------------------------------------
    def end_of(self, lines, at, inner=()):
        """The places of the parts of a block that begins at a line, its end last."""
        depth, parts = 0, []
        for i in range(at, len(lines)):
            word = lines[i][1].split("(")[0].split()[0].upper()
            depth += word in OPEN
            if depth == 1 and word in inner:
                parts.append(i)
            if word in OPEN.values():
                depth -= 1
                if depth == 0:
                    return [*parts, i]
        raise Unknown("a block without its end")

    def block(self, lines, at, end):
        while at < end:
            where, line = lines[at]
            word = line.split("(")[0].split()[0].upper()
            if word not in OPEN:
                self.statement(where, line)
                at += 1
                continue
            *parts, last = self.end_of(lines, at, {"IF": ("ELSE",), "SWITCH": ("CASE", "DEFAULT")}.get(word,
                                                                                                       ()))
            rest = line[len(word):].strip()
            try:
                self.structure(word, rest, lines, at, parts, last)
            except Leave:
                if word not in ("LOOP", "FOR", "WHILE", "REPEAT"):
                    raise
            at = last + 1

    def structure(self, word, rest, lines, at, parts, last):
        truth = lambda text: self.value(Reader(text).expression())
        body = lambda: self.block(lines, at + 1, last)
        if word == "IF":
            middle = parts[0] if parts else last
            if truth(re.sub(r"(?i)\s*THEN\s*$", "", rest)):
                self.block(lines, at + 1, middle)
            elif parts:
                self.block(lines, middle + 1, last)
        elif word == "FOR":
            head = re.match(r"(?i)(\w+)\s*=\s*(.+?)\s+TO\s+(.+?)(?:\s+STEP\s+(.+))?$", rest)
            count, stop, step = truth(head[2]), truth(head[3]), truth(head[4] or "1")
            while (count <= stop) if step > 0 else (count >= stop):
                self.assign([head[1].upper()], count)
                body()
                count += step
        elif word == "WHILE":
            while truth(rest):
                body()
        elif word == "REPEAT":
            while True:
                body()
                if truth(lines[last][1][len("UNTIL"):]):
                    break
        elif word == "LOOP":
            while True:
                body()
        elif word == "SWITCH":
            chosen = truth(rest)
            for part, stop in zip(parts, [*parts[1:], last]):
                head = lines[part][1]
                default = head.upper().startswith("DEFAULT")
                if default or chosen in [truth(item) for item in head[4:].split(",")]:
                    return self.block(lines, part + 1, stop)
        else:
            self.spline = True
            kept = dict(self.system)
            self.with_(Reader(rest)) if rest else None
            body()
            self.system = kept

    # -- statements ----------------------------------------------------------------------------------
    def statement(self, where, line):
        words = line.split("(")[0].split()
        first = words[0].upper()
        try:
            if first in MOTIONS:
                return self.motion(first, line[len(first):], where)
            if first == "RETURN":
                raise Return
            if first == "EXIT":
                raise Leave
            if first in ("DECL", "CONST") or first in BASIC:
                return self.declaration(line)
            if first in IGNORED:
                return None
            reader = Reader(line)
            path = reader.path_or_call()
            if path[0] == "call":
                return self.instruction(path[1], path[2])
            reader.take("=")
            self.assign(path[1], self.value(reader.expression()), partial=True)
        except Unknown as error:
            raise Unknown(f"{where}: {error}") from None

    def declaration(self, line):
        line = re.sub(r"(?i)^\s*(DECL\s+)?(GLOBAL\s+)?(CONST\s+)?", "", line)
        kind, rest = line.split(None, 1)
        if kind.upper() in ("STRUC", "ENUM", "SIGNAL", "INTERRUPT"):
            return
        reader = Reader(rest)
        while reader.ahead():
            path = reader.path(reader.take())
            scope = self.scopes[-1] if self.scopes else self.data
            if reader.accept("="):
                scope.setdefault(path[0], {} if len(path) > 1 else None)
                self.assign(path, self.value(reader.expression()))
            else:
                scope.setdefault(path[0], {})
            reader.accept(",")

    def instruction(self, name, arguments):
        if name == "BAS":
            what, number = arguments[0][1], self.value(arguments[1]) if len(arguments) > 1 else 0
            if what == "#TOOL":
                self.system["$TOOL"] = self.system["TOOL_DATA"].get(int(number))
            elif what == "#BASE":
                self.system["$BASE"] = self.system["BASE_DATA"].get(int(number))
            elif what in ("#PTP_PARAMS", "#CP_PARAMS"):
                form = self.value(("name", ["FDAT_ACT"]))
                self.system["$TOOL"] = self.system["TOOL_DATA"].get(int(form["TOOL_NO"]))
                self.system["$BASE"] = self.system["BASE_DATA"].get(int(form["BASE_NO"]))
                self.system["$IPO_MODE"] = form.get("IPO_FRAME", "#BASE")
        elif name in self.routines:
            self.call(name, arguments)
        else:
            raise Unknown(f"{name} is not known")

    # -- values --------------------------------------------------------------------------------------
    def scope_of(self, name):
        for scope in (self.scopes[-1] if self.scopes else {}, self.data, self.system):
            if name in scope:
                return scope
        return self.system if name.startswith("$") or not self.scopes else self.data

    def assign(self, path, value, partial=False):
        value = copy.deepcopy(value)
        holder, key = self.scope_of(path[0]), path[0]
        for sign, step in path[1:]:
            if holder.get(key) is None:
                holder[key] = {}
            elif sign == "." and holder is self.system:  # a system frame is not the list it came from
                holder[key] = copy.deepcopy(holder[key])
            holder, key = holder[key], (int(self.value(step)) if sign == "[" and step else step)
        old = holder.get(key)
        if partial and isinstance(old, dict) and isinstance(value, dict):
            value |= dict.fromkeys(set(old) - set(value))  # what becomes of the others is not documented
        holder[key] = value

    def value(self, node):
        kind = node[0]
        if kind in ("number", "text", "enum"):
            return node[1]
        if kind == "aggregate":
            return {name: self.value(field) for name, field in node[1].items()}
        if kind == "name":
            path = node[1]
            found = self.scope_of(path[0]).get(path[0])
            for sign, step in path[1:]:
                if not isinstance(found, dict):
                    raise Unknown(f"{path[0]} has no value")
                found = found.get(int(self.value(step)) if sign == "[" and step else step)
            if found is None:
                raise Unknown(f"{path[0]} has no value")
            return found
        if kind == "unary":
            value = self.value(node[2])
            return not value if node[1] == "NOT" else -value if node[1] == "-" else value
        if kind == "call":
            return self.function(node[1], [self.value(argument) for argument in node[2]])
        left, right = self.value(node[1]), self.value(node[2])
        if kind == ":":
            return (left | dict(zip(POSE, numbers_zyx(frame(left) @ frame(right)))) |
                    {name: right[name] for name in ("S", "T") if name in right})
        if kind == "/":
            return left // right if isinstance(left, int) and isinstance(right, int) else left / right
        return ARITHMETIC[kind](left, right)

    def function(self, name, values):
        degrees = {"SIN": np.sin, "COS": np.cos, "TAN": np.tan}
        if name in degrees:
            return float(degrees[name](np.radians(values[0])))
        if name in ("SQRT", "ABS"):
            return float(getattr(np, name.lower())(values[0]))
        if name == "INV_POS":
            return dict(zip(POSE, numbers_zyx(np.linalg.inv(frame(values[0])))))
        if name in ("STOOL2", "STOOL"):
            return self.system["TOOL_DATA"][int(values[0]["TOOL_NO"])]
        if name == "SBASE":
            return self.system["BASE_DATA"][int(values[0])]
        if name.startswith("S"):  # SVEL_JOINT(100), SIPO_MODE(..), SLOAD(..): the value that stands in it
            return values[0]
        raise Unknown(f"function {name}")

    # -- motions -------------------------------------------------------------------------------------
    def with_(self, reader):
        reader.take("WITH")
        while reader.ahead():
            path = reader.path(reader.take())
            reader.take("=")
            if path[0] in ("$TOOL", "$BASE", "$IPO_MODE"):
                self.assign(path, self.value(reader.expression()))
            else:
                reader.expression()
            reader.accept(",")

    def motion(self, word, text, where):
        reader = Reader(text)
        targets = [reader.expression()]
        while reader.accept(","):
            if reader.ahead() in ("CA", "C_DIS"):
                break
            targets.append(reader.expression())
        kept = dict(self.system)
        while reader.ahead() and reader.ahead() != "WITH":
            reader.take()
        if reader.ahead():
            self.with_(reader)
        for target in targets:
            self.go(MOTIONS[word], self.value(target), word.endswith("_REL"), where)
        self.system = kept

    def go(self, kind, target, relative, where):
        if self.system["$IPO_MODE"] == "#TCP":
            raise Unknown("the tool is at rest")
        if any(target.get(f"E{i}") for i in range(1, 7)):
            raise Unknown("external axes")
        if set(AXES) & set(target):
            now = dict(zip(AXES, np.degrees(self.run.q)))
            angles = [now[a] + target.get(a, 0.0) if relative else target.get(a, now[a]) for a in AXES]
            tool = self.system["$TOOL"] or NULL
            return self.run.to_joints(kind, np.radians(known(angles)), frame(tool), where)
        if self.system["$TOOL"] is None or self.system["$BASE"] is None:
            raise Unknown("no tool or no base")
        tool, base = frame(self.system["$TOOL"]), frame(self.system["$BASE"])
        now = dict(zip(POSE, numbers_zyx(self.run.tip(base, tool))))
        pose = [now[a] + target.get(a, 0.0) if relative else target.get(a, now[a]) for a in POSE]
        self.run.to_pose(kind, base, zyx(*known(pose)), tool, where)
        turn = target.get("T")
        if kind == "joint" and turn is not None and not relative:
            signs = sum(1 << i for i, angle in enumerate(self.run.q) if angle < 0.0)
            if signs != int(turn) & 63:
                raise AssertionError(f"{where}: T {turn} says other signs than the axes have ({signs})")


class Return(Exception):
    pass


def known(values):
    if any(value is None for value in values):
        raise Unknown("a component has no value")
    return values


def frame(fields: dict) -> np.ndarray:
    return zyx(*known([fields.get(name) for name in POSE]))


def execute(files: dict[str, bytes], arm: Arm, start, tools, bases) -> list:
    machine = Krl(arm, start, tools, bases)
    for name in sorted(files, key=lambda name: not name.lower().endswith(".dat")):
        machine.load(name, files[name].decode("latin-1"))
    machine.call(machine.first, [])
    return machine.run.motions
