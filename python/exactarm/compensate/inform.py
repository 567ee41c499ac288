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
from exactarm.compensate.flange_poses import Poses
from exactarm.compensate.inform_points import SILENT, Places
from exactarm.compensate.program import (
    HERE,
    THREES,
    Motion,
    Notation,
    Numbers,
    Program,
    SourceText,
    Target,
)
from exactarm.compensate.setting import Setting
from exactarm.errors import InputError
from exactarm.robot.robot import Placement

NAME, SUFFIXES = "INFORM", (".jbi",)
LARGEST_PULSES = 2**31
LEAST_DECIMALS = 2  # of the angles, as controllers write them
KINDS = {"MOVJ": "joint", "MOVL": "linear", "MOVC": "circular", "MOVS": "joint"}
_LINE = re.compile(r"(?m)^([^\r\n]*)")
_MOTION = re.compile(r"\s*(MOVJ|MOVL|MOVC|MOVS|IMOV)\b\s*(\S*)([^\r\n]*)")
_OWN = re.compile(r"C\d+")
_HEAD = re.compile(r"\s*///\s*(\w+)\s*(.*)")
_PLACE = re.compile(r"\s*([A-Z]+\d+)\s*=\s*(.*)")
_SECOND = re.compile(r"\b(EC|BC|C|BP|EX|P)\d+\b|\+MOV")
_TAG = re.compile(r"\b(TL|UF|BF|RF|TF|MTF)\b[ \t]*#?")
# with a second arm; from where the arm is; along a conveyor
_OTHER_MOTION = re.compile(r"\s*(\+?[A-Z]*MOV[A-Z]*|SYSTART|CNVSYNC)\b")


def placement(numbers) -> Placement:
    """Of a frame: X, Y, Z in mm, Rx, Ry, Rz in deg."""
    return Placement(from_zyx(np.radians(numbers[5:2:-1])), 1e-3 * np.array(numbers[:3], float))


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
            reader.position(text, match.start(), match.end())
        elif section == "INST" and word:
            reader.instruction(match[1], match.start())
    left = [name for name in reader.places if name not in reader.index]
    told = (f"no motion that is read goes to {', '.join(left)}: they stay as they are",) if left else ()
    numbered = None if reader.known is None else reader.known.numbered
    return Program(NAME, sources, tuple(reader.targets), tuple(reader.motions), reader.notation, told,
                   numbered=numbered)


def _notation(setting: Setting) -> Notation:
    scale = np.array(setting.robot.controller.pulses_per_rad)

    def shown(tips: Poses, old: np.ndarray) -> np.ndarray:
        angles = to_zyx(tips.rotation, np.radians(old[:, 5:2:-1]))
        return np.hstack([1e3 * tips.position, np.degrees(angles[:, ::-1])])

    return Notation(
        joints=lambda pulses: setting.joints(pulses / scale),
        reported=lambda q: np.round(setting.reported(q) * scale),
        poses=lambda numbers: Poses(1e-3 * numbers[:, :3], from_zyx(np.radians(numbers[:, 5:2:-1]))),
        shown=shown,
        alike=((), THREES),
    )


class _Reader:
    def __init__(self, source: SourceText, setting: Setting):
        self.source, self.setting, self.notation = source, setting, _notation(setting)
        self.state = {"TOOL": "", "USER": "", "POSTYPE": "", "RCONF": ""}
        self.places: dict[str, tuple[dict, Numbers, int]] = {}
        self.targets: list[Target] = []
        self.motions: list[Motion] = []
        self.index: dict[str, int] = {}
        self.cells: dict[tuple[str, str, str], tuple[Placement, Placement, str]] = {}
        self.arcs = 0  # points of the circle that is under way
        self.others = False  # whether there are positions of external axes or variables
        self.stands = False  # at the end of the motion above, when the next instruction begins

    def position(self, text: str, place: int, end: int) -> None:
        """One line of the section //POS."""
        if head := _HEAD.match(text, place, end):
            self.state = dict(self.state)  # one for all positions under the same heads
            key = head[1].upper()
            if key in self.state:
                self.state[key] = head[2].strip().upper()
            if key == "POSTYPE":
                self.state["RCONF"] = ""
            return
        match = _PLACE.match(text, place, end)
        if match is None:
            raise self.source.refuse(
                place, f"found {text[place:end].strip()[:40]!r}; expected a position as C00000=...")
        if not _OWN.fullmatch(match[1]):
            self.others = True
            return  # external axes and variables stay; a motion to them is refused
        if match[1] in self.places:
            raise self.source.refuse(place, f"{match[1]} is given twice")
        numbers = Numbers.listed(self.source, text, *match.span(2))
        self.places[match[1]] = (self.state, numbers, place)

    def instruction(self, text: str, place: int) -> None:
        match = _MOTION.match(text)
        if match is None:
            self.other_instruction(text, place)
            return
        line = self.source.line(place)
        if match[1] == "IMOV" or not _OWN.fullmatch(match[2]):
            self.targets.append(Target.unread(
                f"{match[1]} {match[2]}", 0, line,
                "an increment or a variable; expected a position C of this job"))
            self.motions.append(Motion("joint", len(self.targets) - 1, line))
            self.arcs, self.stands = 0, False
            return
        if _SECOND.search(match[3]):
            raise self.source.refuse(
                place, "a second position in one motion: external axes or a second arm; expected one"
            )
        if tag := _TAG.search(match[3]):
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

    def other_instruction(self, text: str, place: int) -> None:
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
        if other := _OTHER_MOTION.match(text):
            raise self.source.refuse(place, f"motion {other[1]} is not read; expected MOVJ, MOVL, MOVC, MOVS")
        self.stands = self.stands and bool(SILENT.match(text))

    @cached_property
    def known(self) -> Places | None:
        """The positions, when all of them are read."""
        return Places.of(self.source, self.places, self.others, self.notation)

    def points_before(self, line: str, place: int, name: str, target: int, points: list) -> Any:
        return self.known.before(line, place, self.places[name], self.targets[target], points)

    def same_branch(self, before: int | None, target: int) -> bool:
        """Whether what RCONF says of a target holds on the way to it; pulses need none."""
        end = self.targets[target]
        return not end.is_pose or (
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

    def pulses(self, name: str, state: dict, numbers: Numbers, place: int) -> Target:
        robot = self.setting.robot
        if not robot.controller.pulses_per_rad:
            raise InputError(
                "positions in pulses; expected the pulses per rad of each axis in the robot file: "
                "[controller] pulses_per_rad",
                file=self.source.path,
                line=self.source.line(place),
            )
        count = len(numbers.values)
        if count != robot.axes or any(abs(value) > LARGEST_PULSES for value in numbers.values):
            raise self.source.refuse(
                place, f"{count} pulses; expected {robot.axes} whole numbers below {LARGEST_PULSES}"
            )
        return Target(name, 0, self.source.line(place), *numbers, tool=self.frames(state)[0])

    def pose(self, name: str, state: dict, numbers: Numbers, place: int) -> Target:
        source = self.source
        if state["POSTYPE"] not in ("BASE", "ROBOT", "USER"):
            raise source.refuse(
                place,
                f"positions of the type {state['POSTYPE'] or '(none)'}; expected PULSE, BASE, ROBOT or USER",
            )
        if len(numbers.values) != 6:
            raise source.refuse(place, f"{len(numbers.values)} numbers; expected X, Y, Z, Rx, Ry, Rz")
        tool, base, why = self.frames(state)
        return Target(
            name,
            0,
            source.line(place),
            *numbers.checked(source),
            (LEAST_DECIMALS,) * 6,
            is_pose=True,
            tool=tool,
            base=base,
            configuration=state["RCONF"] or "none",
            refusal=why,
        )

    def frames(self, state: dict) -> tuple[Placement, Placement, str]:
        """Tool and base of positions under these heads, `HERE` where not known, and why; asked once for all
        of them."""
        key = (state["TOOL"], state["USER"], state["POSTYPE"])
        if key not in self.cells:
            self.cells[key] = self.frames_of(state)
        return self.cells[key]

    def frames_of(self, state: dict) -> tuple[Placement, Placement, str]:
        why, tool, base = [], self.setting.tool(state["TOOL"].split(",")[0]), None
        if tool is None or len(tool) != 6:
            why.append(
                f"unknown tool {state['TOOL'] or '(none)'}: give --tool {state['TOOL']}=X,Y,Z,Rx,Ry,Rz (mm, "
                "deg)"
            )
        if state["POSTYPE"] == "USER":
            base = self.setting.base(state["USER"])
            if base is None or len(base) != 6:
                why.append(
                    f"unknown user frame {state['USER'] or '(none)'}: give --base "
                    f"{state['USER']}=X,Y,Z,Rx,Ry,Rz (mm, deg)"
                )
        known = lambda frame: placement(frame) if frame is not None and len(frame) == 6 else HERE
        return known(tool), known(base), " and ".join(why)
