"""A robot program as targets and motions, with the bytes of every number; and the writer that changes nothing
else.

A reader decodes the bytes one to one (Latin-1), so that a place in the text is a place in the file: comments,
line ends and letters of any 8-bit encoding, UTF-8 among them, stay byte for byte. Lengths in m, angles in rad
in a `Target`; files keep their units.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import repeat
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from exactarm.compensate.flange_poses import Poses
from exactarm.errors import InputError
from exactarm.file_bytes import file_bytes
from exactarm.robot import Placement

NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER = re.compile(rf"\s*({NUMBER})\s*")
MOST_LISTED = 16  # numbers with commas between that are read at once
LARGEST = (
    1e6  # no program has a length in mm or an angle in degrees beyond it; 9E9 marks an axis that is not there
)


class Edit(NamedTuple):
    """New bytes for those of file `file` (index in the program) from `start` to `end`."""

    file: int
    start: int
    end: int
    text: bytes


HERE = Placement()  # one for all targets of joint angles: a program may have some hundred thousand


class Target(NamedTuple):
    """A target of a program, as the controller means it.

    numbers  as they stand in the file: joint angles, or the pose of the tool's tip in its base, and behind
             it those of a configuration
    places   where each of them begins and ends in the file; none: the file is written as a whole
    digits   least number of decimals with which angles or pose are written; none: whole numbers
    tool     of the tip in the flange; `HERE` itself: not known, of joint angles alone
    base     in the controller's base frame; for poses
    load     kg and its centre (3,) m in the flange frame, where the program says so
    near     joint angles (n,) rad close to which a pose is meant, or None: close to the target before
    matches  whether joint angles belong to the configuration that the program names; None: it names none
    configuration  a word that must be that of the pose before, where its meaning for the arm is not certain
    refusal  why this target cannot be corrected; empty: it can
    """

    name: str
    file: int
    line: int
    numbers: Sequence[float]
    places: Sequence[tuple[int, int]] = ()
    digits: Sequence[int] = ()
    is_pose: bool = False
    tool: Placement = HERE
    base: Placement = HERE
    load: tuple[float, tuple[float, float, float]] | None = None
    near: np.ndarray | None = None
    matches: Callable[[np.ndarray], bool] | None = None
    configuration: str = ""
    refusal: str = ""

    @property
    def tip_known(self) -> bool:
        """Whether a straight motion to it can be followed."""
        return self.is_pose or self.tool is not HERE


    def as_written(self, edits: Sequence[Edit]) -> Target:
        """The same with the numbers that stand in the bytes of its edits (`Notation.edits`)."""
        count = len(self.digits) or len(self.places)
        numbers = [*[float(text) for _, _, _, text in edits[:count]], *self.numbers[count:]]
        return self._replace(numbers=numbers)


class Motion(NamedTuple):
    """One motion: "joint", "linear" or "circular" to a target (index), over another one where circular.

    target None: to a place that these files do not know. `time`: s, where the program is a time series.
    insert: (joint angles and tip of each point in between) -> the edit that puts them before this motion, or
    what `numbered` of the program makes edits of; None: not safe. In a time series its points are (time in
    s, joint angles, rates), with as many rates as `rates`: velocity and acceleration (n,) at the target,
    where the program has them.
    """

    kind: str
    target: int | None
    line: int
    via: int | None = None
    time: float | None = None
    approach: tuple[float, ...] | None = None
    insert: Callable[[list], Any] | None = None
    rates: tuple[np.ndarray, ...] = ()


@dataclass(frozen=True)
class Notation:
    """What the numbers of a dialect mean: (K, m) of K targets at once, against joint angles (K, n) in rad and
    poses of the tip, m.

    joints, reported  numbers -> joint angles, and back
    poses, shown      numbers -> poses; (poses, numbers before) -> numbers
    words   (targets, joint angles) -> (which of them, edit) of configurations that the new angles leave
    """

    joints: Callable[[np.ndarray], np.ndarray]
    reported: Callable[[np.ndarray], np.ndarray] | None = None
    poses: Callable[[np.ndarray], Poses] | None = None
    shown: Callable[[Poses, np.ndarray], np.ndarray] | None = None
    words: Callable[[Sequence[Target], np.ndarray], Iterable[tuple[int, Edit]]] | None = None

    def edits(self, sources: Sequence[SourceText], targets: Sequence[Target], q: np.ndarray,
              tips: Poses | None) -> list[list[Edit]]:
        """Those of each target, that write the commands q (K, n); tips: of the poses among them, in their
        bases."""
        posed = np.array([target.is_pose for target in targets], bool)
        found: list[list[Edit]] = [[] for _ in targets]
        for rows in (np.flatnonzero(~posed), np.flatnonzero(posed)):
            these = [targets[row] for row in rows.tolist()]
            if not these or not these[0].places:
                continue
            if these[0].is_pose:
                numbers = self.shown(tips, np.array([target.numbers for target in these]))
            else:
                numbers = self.reported(q[rows])
            for row, target, values in zip(rows.tolist(), these, numbers.tolist()):
                found[row] = _edits(sources[target.file], target, values)
        if self.words is not None and len(targets):
            for row, edit in self.words(targets, q):
                found[row].append(edit)
        return found

    def bodies(self, sources: Sequence[SourceText], target: Target, begin: int, end: int,
               points: list) -> list[str]:
        """The text of a target, from begin to end, with the numbers of points (joint angles, tip)."""
        tips = Poses(np.array([tip.position for _, tip in points]),
                     np.array([tip.rotation for _, tip in points]))
        found, text = [], sources[target.file].text
        angles = np.array([q for q, _ in points])
        for edits in self.edits(sources, [target] * len(points), angles, tips):
            body = text[begin:end]
            for edit in sorted(edits, reverse=True):
                body = body[: edit.start - begin] + edit.text.decode() + body[edit.end - begin :]
            found.append(body)
        return found


@dataclass(frozen=True)
class Program:
    """Files of one program (KRL has two), its targets and its motions in the order of the text.

    calculated: the format says that nobody has taught these points on the robot.
    notation: what the numbers of its targets mean.
    finish: (contents with edits, targets' commands (N, n) or NaN, what `insert` of the motions gave) ->
    contents, where a file gets more than edits.
    numbered: what `insert` of the motions gave, in their order -> edits, where lines and points are counted.
    """

    dialect: str
    files: tuple[SourceText, ...]
    targets: tuple[Target, ...]
    motions: tuple[Motion, ...]
    notation: Notation
    warnings: tuple[str, ...] = ()
    calculated: bool = False
    finish: Callable[[list[bytes], np.ndarray, list], list[bytes]] | None = None
    numbered: Callable[[list], list[Edit]] | None = None

    @cached_property
    def visits(self) -> list[int]:
        """Targets (index) in the order in which the arm comes to them."""
        return [i for motion in self.motions for i in (motion.via, motion.target) if i is not None]

    def rewritten(self, edits: Iterable[Edit]) -> list[bytes]:
        """The content of each file with the edits."""
        contents, all_edits = [], list(edits)
        for index, source in enumerate(self.files):
            parts, last, content = [], 0, source.content
            own = [edit for edit in all_edits if edit[0] == index]
            for _, start, end, text in sorted(own, key=itemgetter(1)):
                if start < last:
                    raise ValueError(f"edits of {source.path} overlap at byte {start}")
                parts += [content[last:start], text]
                last = end
            contents.append(b"".join([*parts, content[last:]]))
        return contents


@dataclass(frozen=True)
class SourceText:
    """The bytes of a file and the same as text, one letter a byte."""

    path: Path
    content: bytes

    @staticmethod
    def read(path: str | Path) -> SourceText:
        try:
            content = file_bytes(path)
        except FileNotFoundError:
            raise InputError("no such file; expected a robot program", file=path) from None
        except OSError as error:
            raise InputError(
                f"cannot be read ({error.strerror}); expected a robot program", file=path
            ) from None
        source = SourceText(Path(path), content)
        if (place := content.find(b"\0")) >= 0:
            raise source.refuse(place, "a byte 0; expected text of one byte a letter (ASCII, Latin-1, UTF-8)")
        return source

    @cached_property
    def text(self) -> str:
        return self.content.decode("latin-1")

    @cached_property
    def _starts(self) -> list[int]:
        return [0, *(match.end() for match in re.finditer(r"[\r\n](?:(?<=\r)\n)?", self.text))]

    def at_lines(self, pattern: re.Pattern[str], text: str) -> list[re.Match[str]]:
        """What a pattern that begins with ^ finds in `text`, which has the lines of the source: asked there
        alone, not at every letter."""
        return [match for match in map(pattern.match, repeat(text), self._starts) if match]

    def line(self, offset: int) -> int:
        """Line, from 1, of a place."""
        return bisect_right(self._starts, offset)

    def line_start(self, offset: int) -> int:
        """Place where the line of a place begins."""
        return self._starts[self.line(offset) - 1]

    def refuse(self, offset: int, message: str) -> InputError:
        return InputError(message, file=self.path, line=self.line(offset))

    def refuse_words(self, text: str, reasons: Mapping[str, str]) -> None:
        """Refuses the words (small letters; of `text`, in any) for which a reason is given."""
        small = text.lower()
        for word, why in reasons.items():
            if word in small and (match := re.search(rf"(?<![\w$]){re.escape(word)}(?!\w)", small)):
                raise self.refuse(match.start(), f"{text[match.start() : match.end()]}: {why}")

    def without(self, *patterns: str) -> str:
        """The text with what matches (comments, strings) as blanks; every other letter at its place."""
        return re.sub("|".join(patterns), lambda match: re.sub(r"[^\r\n]", " ", match[0]), self.text)


class Number(NamedTuple):
    """A number in a text: its value and its place."""

    value: float
    start: int
    end: int

    @staticmethod
    def read(source: SourceText, text: str, start: int) -> Number:
        """The number that `text`, at `start` of the source, is; anything else is refused."""
        match = _NUMBER.fullmatch(text)
        if match is None:
            raise source.refuse(
                start, f"found {text.strip()[:40]!r}; expected a number (computed targets cannot be "
                       f"corrected)"
            )
        value = float(match[1])
        if not math.isfinite(value):
            raise source.refuse(start, f"found {match[1][:40]}; expected a finite number")
        return Number(value, start + match.start(1), start + match.end(1))


def _edits(source: SourceText, target: Target, values: list[float]) -> list[Edit]:
    """Numbers with as many decimals as they have, at least `digits`; with a plus where they have one."""
    file, text = target.file, source.text
    if not target.digits:
        return [Edit(file, *place, b"%d" % value) for place, value in zip(target.places, values)]
    old = [text[start:end] for start, end in target.places]
    written = _format(tuple(map(max, map(decimals, old), target.digits))) % tuple(values)
    edits = []
    for place, before, new in zip(target.places, old, written.split()):
        if new[0] == "-" and float(new) == 0.0:
            new = new[1:]
        if before[0] == "+" and new[0] != "-":
            new = "+" + new
        edits.append(Edit(file, *place, new.encode()))
    return edits


@cache
def _format(each: tuple[int, ...]) -> str:
    """The format of numbers with so many decimals."""
    return " ".join(f"%.{count}f" for count in each)


def decimals(text: str) -> int:
    """How many a number has."""
    rest = text.partition(".")[2]
    if rest.isdigit():
        return len(rest)
    if text.isdigit():
        return 0
    mantissa, _, exponent = text.lower().partition("e")
    return max(len(mantissa.partition(".")[2]) - (int(exponent) if exponent else 0), 0)


class Numbers(NamedTuple):
    """Those of one target: their values, and where each begins and ends in the file."""

    values: Sequence[float]
    places: Sequence[tuple[int, int]]

    @staticmethod
    def of(numbers: Sequence[Number]) -> Numbers:
        return Numbers([number.value for number in numbers],
                       [(number.start, number.end) for number in numbers])

    @staticmethod
    def groups(match: re.Match[str], which: slice = slice(None)) -> Numbers:
        """Groups of a match that are numbers."""
        return Numbers(tuple(map(float, match.groups()[which])), match.regs[1:][which])

    @staticmethod
    def plain(text: str, start: int, end: int) -> Numbers | None:
        """Those between commas in a part of a text; None where anything else is there, or too many."""
        count = text.count(",", start, end) + 1
        match = _listed(count).fullmatch(text, start, end) if count <= MOST_LISTED else None
        found = None if match is None else Numbers.groups(match)
        return found if found is not None and max(map(abs, found.values)) < math.inf else None

    @staticmethod
    def listed(source: SourceText, text: str, start: int, end: int) -> Numbers:
        """The same; anything else is refused."""
        if found := Numbers.plain(text, start, end):
            return found
        numbers = []
        for part in text[start:end].split(","):
            numbers.append(Number.read(source, part, start))
            start += len(part) + 1
        return Numbers.of(numbers)

    @property
    def sound(self) -> bool:
        """Whether a program may mean them."""
        return max(map(abs, self.values), default=0.0) <= LARGEST

    def checked(self, source: SourceText) -> Numbers:
        """The same; refuses what no program means."""
        for value, (start, _) in () if self.sound else zip(self.values, self.places):
            if abs(value) > LARGEST:
                raise source.refuse(start, f"{value:g}; expected a number of at most {LARGEST:g} in size")
        return self


@cache
def _listed(count: int) -> re.Pattern[str]:
    return re.compile(",".join([rf"\s*({NUMBER})\s*"] * count))
