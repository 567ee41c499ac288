"""An interpreter of Yaskawa INFORM jobs (.jbi), after the manuals of INFORM II, III and of the job data
format.

//POS holds positions, each under what the lines `///TOOL`, `///USER`, `///POSTYPE`, `///RCONF` before it
said; //INST holds instructions. Pulses count by pulses_per_rad; BASE, ROBOT, USER poses are in mm, deg with R
= Rz(Rz) Ry(Ry) Rx(Rx). An instruction moves to a position or a position variable of its job; SFTON and IMOV
shift, TL# and UF# choose: those are not known here.
"""

from __future__ import annotations

import re

import numpy as np

from .motion import Arm, Run, Unknown, zyx

KINDS = {"MOVJ": "joint", "MOVL": "line", "MOVC": "circle", "MOVS": "spline"}
SILENT = ("NOP", "DOUT", "TIMER", "WAIT", "MSG", "CLEAR", "PULSE", "'", "*", "ARCON", "ARCOF", "SPEED")


class Job:
    def __init__(self, file: str, text: str):
        self.name = re.search(r"//NAME\s+(\S+)", text)[1]
        self.places, self.lines, state, part = {}, [], {}, ""
        for number, line in enumerate(text.splitlines(), start=1):
            line = line.strip()
            if line.startswith("//") and not line.startswith("///"):
                part = line[2:].split()[0]
            elif line.startswith("///"):
                words = line[3:].split(None, 1)
                if words[0] in ("PULSE", "RECTAN"):
                    state["UNIT"] = words[0]
                else:
                    state[words[0]] = words[1] if len(words) > 1 else ""
            elif part == "POS" and "=" in line:
                name, values = line.split("=")
                self.places[name.strip()] = (dict(state), [float(value) for value in values.split(",")])
            elif part == "INST" and line:
                self.lines.append((f"{file}:{number}", line))


class Inform:
    def __init__(self, jobs, arm: Arm, start, tools, bases, pulses):
        self.jobs, self.run, self.pulses = jobs, Run(arm, start), np.array(pulses, float)
        self.tools = {int(k): zyx(*np.array(v)[[0, 1, 2, 5, 4, 3]]) for k, v in tools.items()}
        self.bases = {int(k): zyx(*np.array(v)[[0, 1, 2, 5, 4, 3]]) for k, v in bases.items()}
        self.variables: dict[str, int] = {}

    def execute(self, job: Job):
        labels = {line.split()[0]: i for i, (_, line) in enumerate(job.lines) if line.startswith("*")}
        at = 0
        for _ in range(10000):
            if at >= len(job.lines) or job.lines[at][1] == "END":
                return
            where, line = job.lines[at]
            at += 1
            word = line.split()[0]
            if word in KINDS:
                self.motion(job, KINDS[word], line, where)
            elif match := re.match(r"SET ([BID]\d+) (-?\d+)$", line):
                self.variables[match[1]] = int(match[2])
            elif match := re.match(r"INC ([BID]\d+)", line):
                self.variables[match[1]] += 1
            elif match := re.match(r"JUMP (\*\w+)(?: IF ([BID]\d+)(=|<>|<=|>=|<|>)(\d+))?$", line):
                left, right = self.variables.get(match[2], 0), int(match[4] or 0)
                met = {"=": left == right, "<>": left != right, "<": left < right, ">": left > right,
                       "<=": left <= right, ">=": left >= right, None: True}[match[3]]
                at = labels[match[1]] if met else at
            elif match := re.match(r"CALL JOB:(\S+)$", line):
                if match[1] not in self.jobs:
                    raise Unknown(f"{where}: job {match[1]} is not here")
                self.execute(self.jobs[match[1]])
            elif not line.startswith(SILENT):
                raise Unknown(f"{where}: {line}")
        raise Unknown("no end")

    def motion(self, job, kind, line, where):
        words = line.split()
        if re.search(r"\b(TL|UF|BF|RF|TF|CF)#|\+MOV|P\d+ P\d+", line):
            raise Unknown(f"{where}: {line}")
        state, values = job.places[words[1]]
        tool = self.tools.get(int(state.get("TOOL", "0").split(",")[0]))
        if tool is None:
            raise Unknown(f"{where}: tool {state.get('TOOL')}")
        if state["POSTYPE"] == "PULSE":
            return self.run.to_joints(kind, np.array(values) / self.pulses, tool, where)
        base = np.eye(4)
        if state["POSTYPE"] == "USER":
            base = self.bases[int(state["USER"])]
        elif state["POSTYPE"] not in ("BASE", "ROBOT"):
            raise Unknown(f"{where}: {state['POSTYPE']}")
        x, y, z, a, b, c = values
        self.run.to_pose(kind, base, zyx(x, y, z, c, b, a), tool, where)


def execute(files: dict[str, bytes], arm: Arm, start, tools, bases, pulses) -> list:
    jobs = {job.name: job for job in (Job(name, text.decode("latin-1")) for name, text in files.items())}
    machine = Inform(jobs, arm, start, tools, bases, pulses)
    machine.execute(next(iter(jobs.values())))
    return machine.run.motions
