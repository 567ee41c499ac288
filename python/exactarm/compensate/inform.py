"""Yaskawa INFORM: `.jbi`. MOVJ, MOVL, MOVC, MOVS to the positions C of the job.

    ///POSTYPE PULSE                  C00000=pulses of each axis; needs [controller] pulses_per_rad of the
                                      robot file
    ///POSTYPE BASE, ROBOT, USER      C00001=X, Y, Z mm, Rx, Ry, Rz deg, R = Rz Ry Rx, under ///RCONF
Tools and user frames are not in the job: --tool n=X,Y,Z,Rx,Ry,Rz, --base n=...; the tool of ///TOOL 0 too,
for it may be in use. BASE and ROBOT are taken as the robot's base. What RCONF means for an arm is not
certain: poses follow the branch of the target before (--start for the first), and RCONF must stay the same.
Numbers have the decimals of their position, two at least: whether a controller reads more is not known.
Pulses are whole. Refused: position variables (P, BP), increments (IMOV), external axes (EC) and stations,
other groups.
"""

from __future__ import annotations

import re
from functools import cached_property, partial
from typing import Any

import numpy as np

from exactarm.compensate.angles import from_zyx, to_zyx
from exactarm.compensate.inform_points import SILENT, Places
from exactarm.compensate.program import Edit, Motion, Number, Program, SourceText, Target, in_range
from exactarm.compensate.setting import Setting
from exactarm.errors import InputError
from exactarm.robot import Placement

NAME, SUFFIXES = "INFORM", (".jbi",)
LARGEST_PULSES = 2**31
LEAST_DECIMALS = 2  # of the angles, as controllers write them
KINDS = {"MOVJ": "joint", "MOVL": "linear", "MOVC": "circular", "MOVS": "joint"}
_LINE = re.compile(r"(?m)^([^\r\n]*)")
_MOTION = re.compile(r"\s*(MOVJ|MOVL|MOVC|MOVS|IMOV)\b\s*(\S*)([^\r\n]*)")
_OTHER_MOTION = re.compile(r"\s*(\+?S?MOV[JLCS]|EIMOV[LC])\b")  # with a second arm; from where the arm is


def placement(numbers) -> Placement:
    """Of a frame: X, Y, Z in mm, Rx, Ry, Rz in deg."""
    x, y, z = np.radians(numbers[3:6])
    return Placement(from_zyx(z, y, x), 1e-3 * np.array(numbers[:3], float))


def read(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    (source,) = sources
    text = source.without(r"(?m)^[ \t]*'[^\r\n]*")
    reader = _Reader(source, setting)
    section = ""
    for match in _LINE.finditer(text):
        word = match[1].strip()
        if word.startswith("//") and not word.startswith("///"):
            section = word[2:].split()[0].upper() if word[2:].strip() else ""
        elif section == "POS" and word:
            reader.position(match[1], match.start())
        elif section == "INST" and word:
            reader.instruction(match[1], match.start())
    left = [name for name in reader.places if name not in reader.index]
    told = (f"no motion that is read goes to {', '.join(left)}: they stay as they are",) if left else ()
    numbered = None if reader.known is None else reader.known.numbered
    return Program(NAME, sources, tuple(reader.targets), tuple(reader.motions), told, numbered=numbered)


class _Reader:
    def __init__(self, source: SourceText, setting: Setting):
        self.source, self.setting = source, setting
        self.state = {"TOOL": "", "USER": "", "POSTYPE": "", "RCONF": ""}
        self.places: dict[str, tuple[dict, list[Number], int]] = {}
        self.targets: list[Target] = []
        self.motions: list[Motion] = []
        self.index: dict[str, int] = {}
        self.arcs = 0  # points of the circle that is under way
        self.others = False  # whether there are positions of external axes or variables
        self.stands = False  # at the end of the motion above, when the next instruction begins

    def position(self, text: str, place: int) -> None:
        """One line of the section //POS."""
        head = re.match(r"\s*///\s*(\w+)\s*(.*)", text)
        if head:
            key = head[1].upper()
            if key in self.state:
                self.state[key] = head[2].strip().upper()
            if key == "POSTYPE":
                self.state["RCONF"] = ""
            return
        match = re.match(r"\s*([A-Z]+\d+)\s*=\s*(.*)", text)
        if match is None:
            raise self.source.refuse(place, f"found {text.strip()[:40]!r}; expected a position as C00000=...")
        if not re.fullmatch(r"C\d+", match[1]):
            self.others = True
            return  # external axes and variables stay; a motion to them is refused
        if match[1] in self.places:
            raise self.source.refuse(place, f"{match[1]} is given twice")
        numbers, at = [], place + match.start(2)
        for part in match[2].split(","):
            numbers.append(Number.read(self.source, part, at))
            at += len(part) + 1
        self.places[match[1]] = (dict(self.state), numbers, place)

    def instruction(self, text: str, place: int) -> None:
        group = re.match(r"\s*///\s*GROUP\d*\s+(.*)", text)
        if group and group[1].strip().upper() != "RB1":
            raise self.source.refuse(place, f"control group {group[1].strip()}; expected RB1 alone")
        if re.match(r"\s*SFTON\b", text):
            raise self.source.refuse(
                place, "SFTON moves all positions that follow; expected positions as they are"
            )
        if match := re.match(r"\s*(MFRAME|SETTOOL|GETTOOL)\b", text):
            raise self.source.refuse(place, f"{match[1]}: a frame that the job sets; expected frames that "
                                            f"stay")
        match = _MOTION.match(text)
        if match is None and (other := _OTHER_MOTION.match(text)):
            raise self.source.refuse(place, f"motion {other[1]} is not read; expected MOVJ, MOVL, MOVC, MOVS")
        if match is None:
            self.stands = self.stands and bool(SILENT.match(text))
            return
        line = self.source.line(place)
        if match[1] == "IMOV" or not re.fullmatch(r"C\d+", match[2]):
            raise self.source.refuse(
                place, f"{match[1]} {match[2]}: an increment or a variable; expected a position C of this job"
            )
        if re.search(r"\b(EC|BC|C|BP|EX|P)\d+\b|\+MOV", match[3]):
            raise self.source.refuse(
                place, "a second position in one motion: external axes or a second arm; expected one"
            )
        if tag := re.search(r"\b(TL|UF|BF|RF|TF|MTF)\b[ \t]*#?", match[3]):
            raise self.source.refuse(place, f"{tag[0].strip()}: a tool or frame of this motion alone; "
                                            f"expected "
                                            "those of its position")
        kind = KINDS[match[1]]
        target = self.target(match[2], place)
        self.arcs = self.arcs + 1 if kind == "circular" else 0
        before = self.motions[-1].target if self.motions else None
        insert = None
        if match[1] == "MOVL" and self.stands and self.same_branch(before, target):
            insert = partial(self.points_before, text, place, match[2], target)
        self.stands = "UNTIL" not in match[3]
        if kind == "circular" and self.arcs >= 3:
            self.motions.append(Motion("circular", target, line, before))
        else:
            self.motions.append(
                Motion("joint" if kind == "joint" else "linear", target, line, insert=insert))

    @cached_property
    def known(self) -> Places | None:
        """The positions, when all of them are read."""
        return Places.of(self.source, self.places, self.others)

    def points_before(self, line: str, place: int, name: str, target: int, points: list) -> Any:
        return self.known.before(line, place, self.places[name], self.targets[target], points)

    def same_branch(self, before: int | None, target: int) -> bool:
        """Whether what RCONF says of a target holds on the way to it; pulses need none."""
        end = self.targets[target]
        return end.joints is not None or (
            before is not None and self.targets[before].configuration == end.configuration)

    def target(self, name: str, place: int) -> int:
        if name not in self.places:
            raise self.source.refuse(place, f"{name} is not in //POS; expected it there")
        if name not in self.index:
            state, numbers, where = self.places[name]
            make = self.pulses if state["POSTYPE"] == "PULSE" else self.pose
            self.targets.append(make(name, state, numbers, where))
            self.index[name] = len(self.targets) - 1
        return self.index[name]

    def pulses(self, name: str, state: dict, numbers: list[Number], place: int) -> Target:
        robot = self.setting.robot
        scale = np.array(robot.controller.pulses_per_rad)
        if not scale.size:
            raise InputError(
                "positions in pulses; expected the pulses per rad of each axis in the robot file: "
                "[controller] pulses_per_rad",
                file=self.source.path,
                line=self.source.line(place),
            )
        if len(numbers) != robot.axes or any(abs(number.value) > LARGEST_PULSES for number in numbers):
            raise self.source.refuse(
                place, f"{len(numbers)} pulses; expected {robot.axes} whole numbers below {LARGEST_PULSES}"
            )
        source = self.source

        def encode(q, _):
            counts = np.round(self.setting.reported(q) * scale).astype(int)
            return [
                Edit(0, number.start, number.end, str(count).encode())
                for number, count in zip(numbers, counts)
            ]

        q = self.setting.joints(np.array([number.value for number in numbers]) / scale)
        tool = self.setting.tool(state["TOOL"].split(",")[0])  # of a straight motion to it
        known = {"tool": placement(tool)} if tool is not None and len(tool) == 6 else {}
        return Target(name, 0, source.line(place), encode, joints=q, **known)

    def pose(self, name: str, state: dict, numbers: list[Number], place: int) -> Target:
        source = self.source
        if state["POSTYPE"] not in ("BASE", "ROBOT", "USER"):
            raise source.refuse(
                place,
                f"positions of the type {state['POSTYPE'] or '(none)'}; expected PULSE, BASE, ROBOT or USER",
            )
        if len(numbers) != 6:
            raise source.refuse(place, f"{len(numbers)} numbers; expected X, Y, Z, Rx, Ry, Rz")
        in_range(source, numbers)
        old = np.radians([number.value for number in numbers[3:]])
        digits = [
            max(LEAST_DECIMALS, *(number.decimals(source) for number in part))
            for part in (numbers[:3], numbers[3:])
        ]

        def encode(_, tip):
            z, y, x = to_zyx(tip.rotation, old[::-1])
            values = [*(1e3 * tip.position), *np.degrees([x, y, z])]
            return [
                number.edit(source, 0, value, digits[i // 3])
                for i, (number, value) in enumerate(zip(numbers, values))
            ]

        why, tool, base = [], self.setting.tool(state["TOOL"].split(",")[0]), Placement()
        if tool is None or len(tool) != 6:
            why.append(
                f"unknown tool {state['TOOL'] or '(none)'}: give --tool {state['TOOL']}=X,Y,Z,Rx,Ry,Rz (mm, "
                "deg)"
            )
        if state["POSTYPE"] == "USER":
            given = self.setting.base(state["USER"])
            if given is None or len(given) != 6:
                why.append(
                    f"unknown user frame {state['USER'] or '(none)'}: give --base "
                    f"{state['USER']}=X,Y,Z,Rx,Ry,Rz (mm, deg)"
                )
            else:
                base = placement(given)
        return Target(
            name,
            0,
            source.line(place),
            encode,
            pose=placement([number.value for number in numbers]),
            tool=Placement() if tool is None else placement(tool),
            base=base,
            configuration=state["RCONF"] or "none",
            refusal=" and ".join(why),
        )
