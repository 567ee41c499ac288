"""An interpreter of Fanuc TP programs as ASCII listings (.ls), after the operator's manuals of R-30iB.

/MN holds numbered lines that end with `;`, /POS the positions. mm, deg, R = Rz(R) Ry(P) Rx(W). A position of
UF and UT runs only where these are the active frames (UFRAME_NUM, UTOOL_NUM): the controller stops otherwise.
J3 may be counted from the horizon: `coupling` (n, n) makes joint angles of what is shown. Registers, jumps,
FOR and calls of programs in the same set are executed; a `!` or `//` line is none.
"""

from __future__ import annotations

import re

import numpy as np

from .motion import Arm, Run, Unknown, zyx

KINDS = {"J": "joint", "L": "line", "C": "circle", "A": "circle"}
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
POINT = re.compile(r"(PR|P)\s*\[\s*(R\[)?(\d+)(?:\])?(?:\s*:[^\]]*)?\]")
COMPARE = {"=": "__eq__", "<>": "__ne__", "<": "__lt__", ">": "__gt__", "<=": "__le__", ">=": "__ge__"}


class Program:
    def __init__(self, file: str, text: str):
        head, _, rest = text.partition("\n/MN")
        body, _, places = rest.partition("\n/POS")
        self.lines, self.places = [], {}
        start = head.count("\n") + 2
        for match in re.finditer(r"(?m)^\s*\d*\s*:([^;]*);", body):
            line = start + body.count("\n", 0, match.start(1))
            words = re.sub(r"\n\s*:", " ", match[1])
            self.lines.append((f"{file}:{line}", words.strip()))
        for match in re.finditer(r"P\[(\d+)[^\]]*\]\s*\{(.*?)\}\s*;", places, re.S):
            self.places[int(match[1])] = match[2]


class Tp:
    def __init__(self, programs, arm: Arm, start, tools, bases, coupling):
        self.programs, self.run, self.coupling = programs, Run(arm, start), coupling
        self.frames = {"UT": {int(k): zyx(*np.array(v)[[0, 1, 2, 5, 4, 3]]) for k,
                              v in tools.items()} | {0: np.eye(4)},
                       "UF": {int(k): zyx(*np.array(v)[[0, 1, 2, 5, 4, 3]]) for k,
                              v in bases.items()} | {0: np.eye(4)}}
        self.active, self.registers = {"UT": None, "UF": None}, {}

    def execute(self, program: Program):
        at, loops = 0, []
        labels = {int(m[1]): i for i, (_, line) in enumerate(program.lines) if (m := re.match(r"LBL\[(\d+)",
                                                                                              line))}
        for _ in range(10000):
            if at >= len(program.lines):
                return
            where, line = program.lines[at]
            at += 1
            if not line or line.startswith(("!", "//", "LBL", "WAIT", "DO[", "RO[", "OVERRIDE", "--",
                                            "MESSAGE")):
                continue
            if re.match(r"[JLCA]\s+P", line) or re.match(r"[JLCA]P", line):
                self.motion(program, where, line)
            elif match := re.match(r"(UTOOL|UFRAME)_NUM\s*=\s*(.+)", line):
                self.active["UT" if match[1] == "UTOOL" else "UF"] = int(self.value(match[2]))
            elif match := re.match(r"R\[(\d+)[^\]]*\]\s*=\s*(.+)", line):
                self.registers[int(match[1])] = self.value(match[2])
            elif match := re.match(r"JMP LBL\[(\d+)", line):
                at = labels[int(match[1])]
            elif match := re.match(r"IF\s+(.+?)\s*(=|<>|<=|>=|<|>)\s*(.+?)\s*,\s*(JMP LBL\[(\d+)|CALL (\w+))",
                                   line):
                if getattr(float(self.value(match[1])), COMPARE[match[2]])(float(self.value(match[3]))):
                    if match[5]:
                        at = labels[int(match[5])]
                    else:
                        self.call(match[6])
            elif match := re.match(r"FOR R\[(\d+)[^\]]*\]\s*=\s*(\S+) TO (\S+)", line):
                self.registers[int(match[1])] = self.value(match[2])
                loops.append((at, int(match[1]), self.value(match[3])))
            elif line.startswith("ENDFOR"):
                begin, number, last = loops[-1]
                self.registers[number] += 1
                if self.registers[number] <= last:
                    at = begin
                else:
                    loops.pop()
            elif match := re.match(r"CALL\s+(\w+)", line):
                self.call(match[1])
            elif line in ("END", "ABORT"):
                return
            else:
                raise Unknown(f"{where}: {line}")
        raise Unknown("no end")

    def call(self, name: str):
        if name not in self.programs:
            raise Unknown(f"program {name} is not here")
        self.execute(self.programs[name])

    def value(self, text: str):
        text = re.sub(r"R\[(\d+)[^\]]*\]", lambda match: str(self.registers[int(match[1])]), text.strip())
        if not re.fullmatch(r"[-+*/ .\d()]+", text):
            raise Unknown(f"value {text}")
        return eval(text)

    def motion(self, program, where, line):
        if re.search(r"\b(INC|Offset|Tool_Offset|COORD|RTCP|VOFFSET|Skip)\b", line, re.I):
            raise Unknown(f"{where}: {line}")
        for match in POINT.finditer(line):
            if match[1] == "PR":
                raise Unknown(f"{where}: a register")
            number = self.registers[int(match[3])] if match[2] else int(match[3])
            self.go(KINDS[line[0]], program.places[int(number)], where)

    def go(self, kind, body, where):
        group = re.search(r"GP1\s*:(.*?)(?=GP\d\s*:|\Z)", body, re.S)
        fields = re.sub(r"CONFIG\s*:\s*'[^']*'", "", group[1] if group else body)
        active = {key: int(match[1]) for key in ("UF", "UT") if (match := re.search(rf"{key}\s*:\s*(\d+)",
                                                                                    fields))}
        for key, number in active.items():
            if self.active[key] not in (None, number):
                raise Unknown(f"{where}: the position is of {key} {number}, {self.active[key]} is active")
        values = {name: float(value) for name, value in
                  re.findall(rf"\b([XYZWPR]|J\d|E\d)\s*=\s*({NUMBER})", fields)}
        if any(value for name, value in values.items() if name[0] == "E"):
            raise Unknown(f"{where}: an extended axis")
        if "UT" not in active or active["UT"] not in self.frames["UT"]:
            raise Unknown(f"{where}: tool {active.get('UT')}")
        tool = self.frames["UT"][active["UT"]]
        if "J1" in values:
            shown = np.radians([values[f"J{i}"] for i in range(1, 7)])
            return self.run.to_joints(kind, self.coupling @ shown, tool, where)
        if active["UF"] not in self.frames["UF"]:
            raise Unknown(f"{where}: frame {active['UF']}")
        pose = zyx(*(values[name] for name in "XYZRPW"))
        self.run.to_pose(kind, self.frames["UF"][active["UF"]], pose, tool, where)


def execute(files: dict[str, bytes], arm: Arm, start, tools, bases, coupling=np.eye(6)) -> list:
    programs = {re.search(rb"/PROG\s+(\w+)", text)[1].decode(): Program(name, text.decode("latin-1"))
                for name, text in files.items()}
    machine = Tp(programs, arm, start, tools, bases, coupling)
    machine.execute(next(iter(programs.values())))
    return machine.run.motions
