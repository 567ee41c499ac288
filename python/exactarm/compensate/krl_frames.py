"""What $TOOL and $BASE are at a motion of KRL: by its inline form, by name, by number or by numbers, from
these files or from the command line; or why that is not known."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from exactarm.compensate.angles import from_zyx
from exactarm.compensate.krl_data import CARTESIAN, Aggregate, Declarations
from exactarm.compensate.program import SourceText, Target
from exactarm.compensate.setting import Setting
from exactarm.robot.robot import Placement

START = {"$TOOL": None, "$BASE": None, "$IPO_MODE": "#BASE"}
_FRAME = re.compile(r"\$?\w+(\[\d*\])?")


@dataclass(frozen=True)
class ToolAndBase:
    """What $TOOL and $BASE are at some line: placements, or why they are not known."""

    tool: Placement | str
    base: Placement | str

    @cached_property
    def refusal(self) -> str:
        return " and ".join(part for part in (self.tool, self.base) if isinstance(part, str))

    def agree(self, target: Target) -> bool:
        """Whether those that are known are those of a target."""
        pairs = ((self.tool, target.tool), (self.base, target.base))
        return all(isinstance(mine, str) or mine == its for mine, its in pairs)


class Frames(Declarations):
    def __init__(self, sources: tuple[SourceText, ...], setting: Setting):
        super().__init__(sources)
        self.setting = setting
        self.known: dict[tuple[str, str | None], Placement | str] = {}
        self.seen: dict[tuple, ToolAndBase] = {}
        self.latest: tuple[dict | None, ToolAndBase] = (None, ToolAndBase("", ""))

    def frames(self, index: int, name: str, state: dict, inline: str | None) -> ToolAndBase:
        """Those of a motion: of its inline form, else of $TOOL and $BASE. One object for the same frames: a
        program has few, and compares them at every motion."""
        own = name if name[:1].upper() == "X" else ""
        if state is self.latest[0] and inline is None and not own:  # most motions
            return self.latest[1]
        key = (index, inline, *(state[name] for name in START), own)
        if key not in self.seen:
            self.seen[key] = self.frames_of(index, name, state, inline)
        if inline is None and not own:
            self.latest = (state, self.seen[key])
        return self.seen[key]

    def frames_of(self, index: int, name: str, state: dict, inline: str | None) -> ToolAndBase:
        own = "F" + name[1:].upper() if name[:1].upper() == "X" else ""
        if inline is None and own in self.values:
            said, here = self.frames(index, "", state, own), self.frames(index, "", state, None)
            if state["$TOOL"] is None and state["$BASE"] is None or said == here:
                return said
            return ToolAndBase(f"{own} says another tool or base than $TOOL and $BASE at this motion",
                               said.base)
        if inline is not None:
            known = self.values.get(inline, [])
            if len(known) != 1 or known[0][2] is None:
                return ToolAndBase(f"unknown tool: {inline} is not given once in the data list", Placement())
            fields = known[0][2].fields
            if "IPO_FRAME" in fields and fields["IPO_FRAME"][0].strip().upper() != "#BASE":
                return ToolAndBase("the tool stands still and the arm holds the part (#TCP)", Placement())
            tool, base = (
                str(int(self.number(known[0][2], key).value)) if key in fields else ""
                for key in ("TOOL_NO", "BASE_NO")
            )
            return ToolAndBase(self.frame("TOOL", f"TOOL_DATA[{tool}]"),
                               self.frame("BASE", f"BASE_DATA[{base}]"))
        if str(state["$IPO_MODE"]).upper() != "#BASE":
            return ToolAndBase("the tool stands still and the arm holds the part (#TCP)", Placement())
        return ToolAndBase(self.frame("TOOL", state["$TOOL"]), self.frame("BASE", state["$BASE"]))

    def frame(self, which: str, value: str | Aggregate | None) -> Placement | str:
        """`placed` of a name once for all motions: they compare their frames, and one object is quick."""
        if isinstance(value, Aggregate):
            return self.placed(which, value)
        if (which, value) not in self.known:
            self.known[which, value] = self.placed(which, value)
        return self.known[which, value]

    def placed(self, which: str, value: str | Aggregate | None) -> Placement | str:
        """The placement of a frame: literal, by number or by name; else why it is not known."""
        given = self.setting.tool if which == "TOOL" else self.setting.base
        key = value.upper() if isinstance(value, str) else ""
        if key in self.parts:
            return f"a component of {value} is set by the program; expected numbers alone"
        if value is not None and not isinstance(value, Aggregate) and not _FRAME.fullmatch(value):
            return f"${which} is {value}; expected one frame by its name, its number or its numbers"
        if isinstance(value, Aggregate):
            self.complete(value, CARTESIAN)
            return placement([self.number(value, key).value for key in CARTESIAN])
        number = (re.fullmatch(rf"{which}_DATA\[(\d+)\]", value or "") or [None, None])[1]
        if value in ("$NULLFRAME", "$WORLD") or number == "0":
            return Placement()
        numbers = given(number or (value or ""))
        known = self.values.get(key, [])
        if numbers is not None and len(numbers) == 6:
            if any(frame is None or self.placed(which, frame) != placement(numbers) for _, _, frame in known):
                return f"{value} is set in these files otherwise than by --{which.lower()}"
            return placement(numbers)
        if len(known) == 1 and known[0][2] is not None:
            return self.frame(which, known[0][2])
        word = which.lower()
        told = f"{word} {number or value}" if value else f"{word} (nothing sets ${which})"
        return (
            f"unknown {told}: give --{word} {number or ''}{'=' if number else ''}X,Y,Z,A,B,C (mm, deg) as "
            "the controller shows it"
        )


def placement(numbers) -> Placement:
    """Of a frame as the controller shows it."""
    return Placement(from_zyx(np.radians(numbers[3:6])), 1e-3 * np.array(numbers[:3], float))
