"""INFORM: points in between, with instructions and positions of their own.

A point before `MOVL C..` is an instruction with the same words but PL=1, and a new position behind the last
one of //POS, with the next number that is free, under heads (///TOOL, ///POSTYPE, ...) that say what those of
its end say; the first number of ///NPOS counts it. All other numbers stay. PL=1 is the closest of the levels
at which the arm does not stop (0 stops). Controllers write positions in the order of the instructions; that
they take another order is not confirmed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from exactarm.compensate.program import Edit, Notation, SourceText, Target
from exactarm.files.whole_number import whole_number

FLY_BY = "PL=1"
# of a motion whose other words hold for each part of its way
_PLAIN = re.compile(
    r"([ \t]*MOVL[ \t]+)C\d+((?:[ \t]+VR?=[^ \t\r\n]+)?)(?:[ \t]+PL=\d+)?((?:[ \t]+(?:ACC|DEC)=\d+)*)[ \t]*")
SILENT = re.compile(  # instructions that neither move the arm nor lead elsewhere
    r"[ \t]*(?:NOP|DOUT|AOUT|PULSE|TIMER|WAIT|SET|INC|DEC|ADD|SUB|CLEAR|MSG|SPEED|ARCON|ARCOF|DIN)\b")
_COUNTS = re.compile(r"(?m)^[ \t]*///NPOS[ \t]+(\d+)")
_HEADS = ("USER", "TOOL", "POSTYPE", "RCONF")


@dataclass(frozen=True)
class _Points:
    """Points before one motion: where its line begins, the words of theirs before and behind the position,
    numbers of their positions, and what the heads say of them."""

    place: int
    words: tuple[str, str]
    numbers: list[str]
    state: Mapping[str, str]


@dataclass(frozen=True)
class Places:
    """The positions of the job: how many there are, the name of the last, where its line ends and what the
    heads say there. plain: all are of the robot, and ///NPOS counts them."""

    source: SourceText
    count: int
    name: str
    end: int
    state: Mapping[str, str]
    plain: bool
    notation: Notation

    @staticmethod
    def of(
        source: SourceText, places: Mapping[str, tuple], others: bool, notation: Notation
    ) -> Places | None:
        """places: name -> heads, numbers, place; others: whether there are positions of external axes or
        variables."""
        if not places:
            return None
        name = max(places, key=lambda name: places[name][2])
        state, numbers, _ = places[name]
        counts = _COUNTS.search(source.text)
        plain = counts is not None and whole_number(counts[1]) == len(places) and not others
        return Places(source, len(places), name, numbers.places[-1][1], state, plain, notation)

    def before(self, line: str, place: int, entry: tuple, target: Target, points: list) -> _Points | None:
        """Points before the motion in `line`, to the position `entry`."""
        whole = _PLAIN.fullmatch(line)
        state, numbers, _ = entry
        if whole is None or not self.plain or not (state["TOOL"] or not self.state["TOOL"]):
            return None
        begin, end = numbers.places[0][0], numbers.places[-1][1]
        bodies = self.notation.bodies((self.source,), target, begin, end, points)
        newline = re.search(r"\r\n|\n|\r", self.source.text)[0]
        return _Points(place, (whole[1], f"{whole[2]} {FLY_BY}{whole[3]}{newline}"), bodies, state)

    def numbered(self, found: list[_Points]) -> list[Edit]:
        """The edits of all points of the job."""
        newline = re.search(r"\r\n|\n|\r|$", self.source.text)[0]
        number, width, state = int(self.name[1:]), len(self.name) - 1, self.state
        edits, entries = [], []
        for points in found:
            lines = []
            for body in points.numbers:
                number += 1
                name = f"C{number:0{width}d}"
                lines.append(points.words[0] + name + points.words[1])
                entries += [*_heads(state, points.state), f"{name}={body}"]
                state = points.state
            edits.append(Edit(0, points.place, points.place, "".join(lines).encode("latin-1")))
        if entries:
            text = "".join(newline + entry for entry in entries)
            counts = _COUNTS.search(self.source.text)
            more = sum(len(points.numbers) for points in found)
            edits.append(Edit(0, self.end, self.end, text.encode("latin-1")))
            edits.append(Edit(0, *counts.span(1), str(self.count + more).encode()))
        return edits


def _heads(before: Mapping[str, str], state: Mapping[str, str]) -> list[str]:
    """The lines that make what the heads say that of `state`."""
    if before == state:
        return []
    said = [f"///{key} {state[key]}" for key in _HEADS if state[key] and key != "RCONF"]
    said.append("///PULSE" if state["POSTYPE"] == "PULSE" else "///RECTAN")
    return [*said, *([f"///RCONF {state['RCONF']}"] if state["RCONF"] else [])]
