"""Fanuc TP: points in between, with lines and positions of their own.

A point before `L P[n]` is a line with the same words but CNT100, a new position behind the last one of /POS
(a copy of P[n] with other numbers; the next numbers that are free), and one more in LINE_COUNT; the lines
behind it get other numbers. Labels, registers and the numbers of the positions stay. CNT100: the arm does not
stop; the corner that it cuts lies within half of both neighbours, where the way of the points in between
leaves the line by no more than their chords do. PROG_SIZE and MEMORY_SIZE stay: the controller counts its own
bytes when it loads the text (not confirmed).
"""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property

from exactarm.compensate.program import Edit, Notation, SourceText, Target
from exactarm.compensate.ways import goes_on

FLY_BY = "CNT100"
# of a motion whose other words hold for each part of its way; a speed as a time (sec) would not
_PLAIN = re.compile(
    r"([ \t]*)(\d*)([ \t]*:[ \t]*L[ \t]+)P\[[^\]]*\]"
    r"([ \t]+(?:(?:[\d.]+|R\[\d+[^\]]*\])[ \t]*(?:mm/sec|cm/min|inch/min|deg/sec)|WELD_SPEED|max_speed)"
    r"[ \t]+)"
    r"(?:FINE|CNT[ \t]*\d+)((?:[ \t]+(?:ACC[ \t]*\d+|Wjnt|PTH))*[ \t]*;[ \t]*)(?=[\r\n])")
_SILENT = re.compile(  # lines that neither move the arm nor lead elsewhere
    r"[ \t]*\d*[ \t]*:[ \t]*(?:;|$|(?:R|DO|RO|GO|AO|F|SR|TIMER|PAYLOAD|MESSAGE)\[|WAIT\b|OVERRIDE\b"
    r"|(?:UFRAME|UTOOL)_NUM\b|\$)")
_NUMBERED = re.compile(r"(?m)^([ \t]*)(\d+)[ \t]*:")
_LINE_COUNT = re.compile(r"(?m)^[ \t]*LINE_COUNT[ \t]*=[ \t]*(\d+)")


@dataclass(frozen=True)
class _Points:
    """Points before one motion: where its line begins, the words of theirs before and behind the position,
    bodies of their positions."""

    place: int
    number: tuple[str, str]
    words: tuple[str, str]
    bodies: list[str]


@dataclass(frozen=True)
class Listing:
    """text: of `source`, comments as blanks. lines, places: where /MN and /POS begin; last: the end of the
    last position."""

    source: SourceText
    text: str
    lines: int
    places: int
    last: int
    notation: Notation

    def before(self, motion: re.Match, above: re.Match | None, entry: re.Match, target: Target,
               points: list) -> _Points | None:
        """Points before `motion`, to the position `entry`, that follows the motion `above`."""
        start = self.source.line_start(motion.start(1))
        whole = _PLAIN.match(self.text, start)
        if (
            whole is None or above is None or not self.counted
            or "Skip" in above[4]  # what it finds decides where it ends
            or not goes_on(self.text, above.span(), start, _SILENT)
            or re.search(r"\bGP[2-9]\s*:", entry[2])  # where another arm is on the way is not known
        ):
            return None
        bodies = self.notation.bodies((self.source,), target, *entry.span(2), points)
        return _Points(start, (whole[1], whole[2]), (whole[3], whole[4] + FLY_BY + whole[5] + self.newline),
                       bodies)

    @cached_property
    def counted(self) -> bool:
        """Whether the lines are numbered one behind the other, or not at all."""
        numbers = [int(match[2]) for match in _NUMBERED.finditer(self.source.text, self.lines, self.places)]
        return numbers == list(range(numbers[0], numbers[0] + len(numbers))) if numbers else True

    def numbered(self, found: list[_Points]) -> list[Edit]:
        """The edits of all points of the program, in the order of its lines."""
        free = 1 + max(int(number) for number in re.findall(r"\bP\[\s*(\d+)", self.text))
        edits, entries, places, above = [], [], [], [0]
        for points in found:
            lines = []
            for k, body in enumerate(points.bodies, start=above[-1]):
                number = f"P[{free + k}]"
                lines.append(_written(*points.number, k) + points.words[0] + number + points.words[1])
                entries.append(f"{self.newline}{number}{{{body}}};")
            edits.append(Edit(0, points.place, points.place, "".join(lines).encode("latin-1")))
            places.append(points.place)
            above.append(above[-1] + len(lines))
        for match in _NUMBERED.finditer(self.source.text, self.lines, self.places):
            if shift := above[bisect_right(places, match.start())]:
                number = _written(match[1], match[2], shift)
                edits.append(Edit(0, match.start(), match.end(2), number.encode()))
        if entries:
            edits.append(Edit(0, self.last, self.last, "".join(entries).encode("latin-1")))
        if entries and (count := _LINE_COUNT.search(self.text, 0, self.lines)):
            edits.append(Edit(0, *count.span(1), str(int(count[1]) + above[-1]).encode()))
        return edits

    @cached_property
    def newline(self) -> str:
        return re.search(r"\r\n|\n|\r|$", self.source.text)[0]


def _written(blanks: str, digits: str, shift: int) -> str:
    """The number of a line that is `shift` further down, as wide as it was where that is possible."""
    if not digits:
        return blanks
    number = str(int(digits) + shift)
    return blanks[: max(len(blanks) + len(digits) - len(number), 0)] + number
