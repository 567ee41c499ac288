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
from functools import cache, cached_property, partial
from itertools import chain, repeat
from operator import itemgetter, lt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from exactarm.compensate.flange_poses import Poses
from exactarm.errors import InputError
from exactarm.files.file_bytes import file_bytes
from exactarm.files.memory_table import MemoryTable
from exactarm.robot.robot import Placement

NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER = re.compile(rf"\s*({NUMBER})\s*")
THREES = (slice(0, 3), slice(3, 6))  # place and orientation of a pose
MOST_LISTED = 16  # numbers with commas between that are read at once
MOST_SHOWN = 40  # letters of a formula, in a message
LARGEST = 1e6  # mm, deg: none in a program is beyond it; 9E9 marks an axis that is not there


class Edit(NamedTuple):
    """New bytes for those of file `file` (index in the program) from `start` to `end`."""

    file: int
    start: int
    end: int
    text: bytes


_EDIT = partial(tuple.__new__, Edit)  # as Edit._make, in half the time
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

    @staticmethod
    def unread(name: str, file: int, line: int, why: str) -> Target:
        """Of a motion whose place stands nowhere in numbers of its own: an offset, a register, a formula."""
        return Target(" ".join(name.split())[:MOST_SHOWN], file, line, (), is_pose=True, refusal=why)

    @property
    def tip_known(self) -> bool:
        """Whether a straight motion to it can be followed."""
        return self.is_pose or self.tool is not HERE


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
    words   (targets, joint angles) -> edits of configurations that the new angles leave
    alike   of joint targets, of poses: numbers that get as many decimals as the most exact of them has
    """

    joints: Callable[[np.ndarray], np.ndarray]
    reported: Callable[[np.ndarray], np.ndarray] | None = None
    poses: Callable[[np.ndarray], Poses] | None = None
    shown: Callable[[Poses, np.ndarray], np.ndarray] | None = None
    words: Callable[[Sequence[Target], np.ndarray], Iterable[Edit]] | None = None
    alike: tuple[Sequence[slice], Sequence[slice]] = ((), ())

    def edits(self, sources: Sequence[SourceText], targets: Sequence[Target], q: np.ndarray,
              tips: Poses | None) -> tuple[list[Edit], tuple[np.ndarray | None, np.ndarray | None]]:
        """Those that write the commands q (K, n); tips: of the poses among them, in their bases. And the
        numbers (K, m) that then stand there: of the joint targets, of the poses."""
        posed = np.array([target.is_pose for target in targets], bool)
        edits: list[Edit] = []
        written: list[np.ndarray | None] = []
        for rows, alike in zip((np.flatnonzero(~posed), np.flatnonzero(posed)), self.alike):
            these = [targets[row] for row in rows.tolist()]
            if not these or not these[0].places:
                written.append(None)
            elif these[0].is_pose:
                written.append(_write(sources, these, self.shown(tips, numbers_of(these)), alike, edits))
            else:
                written.append(_write(sources, these, self.reported(q[rows]), alike, edits))
        if self.words is not None and len(targets):
            edits += self.words(targets, q)
        return edits, (written[0], written[1])

    def bodies(self, sources: Sequence[SourceText], target: Target, begin: int, end: int,
               points: list) -> list[str]:
        """The text of a target, from begin to end, with the numbers of points (joint angles, tip)."""
        tips = Poses(np.array([tip.position for _, tip in points]),
                     np.array([tip.rotation for _, tip in points]))
        found, text = [], sources[target.file].text
        for k, (q, _) in enumerate(points):
            body = text[begin:end]
            edits, _ = self.edits(sources, [target], q[None], tips.rows([k]))
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
        contents, all_edits = [], sorted(edits, key=itemgetter(1))
        for index, source in enumerate(self.files):
            own = all_edits if len(self.files) == 1 else [edit for edit in all_edits if edit[0] == index]
            _, starts, ends, texts = zip(*own) if own else ((),) * 4
            if any(map(lt, starts[1:], ends)):
                raise ValueError(f"edits of {source.path} overlap")
            kept = map(source.content.__getitem__, map(slice, [0, *ends], [*starts, None]))
            contents.append(b"".join(chain.from_iterable(zip(kept, [*texts, b""]))))
        return contents


@dataclass(frozen=True)
class SourceText:
    """The bytes of a file and the same as text, one letter a byte."""
    path: Path | MemoryTable
    content: bytes

    @staticmethod
    def read(path: str | Path) -> SourceText:
        try:
            content = file_bytes(path)
        except FileNotFoundError:
            raise InputError("no such file; expected a robot program", file=path) from None
        except OSError as error:
            raise InputError(f"cannot be read ({error.strerror}); expected a robot program",
                             file=path) from None
        source = SourceText(Path(path), content)
        if (place := content.find(b"\0")) >= 0:
            raise source.refuse(place, "a byte 0; expected text of one byte a letter (ASCII, Latin-1, UTF-8)")
        return source

    @cached_property
    def text(self) -> str:
        return self.content.decode("latin-1")

    @cached_property
    def _starts(self) -> list[int]:
        letters = np.frombuffer(self.content + b" ", np.uint8)
        ends = (letters == 10) | (letters == 13) & (np.append(letters[1:], 0) != 10)
        return [0, *(np.flatnonzero(ends) + 1).tolist()]

    @cached_property
    def _marks(self) -> tuple[np.ndarray, np.ndarray]:
        """Places of the dots, and of the letters that may begin an exponent."""
        letters = np.frombuffer(self.content, np.uint8)
        return np.flatnonzero(letters == ord(".")), np.flatnonzero((letters | 0x20) == ord("e"))

    def decimals(self, places: np.ndarray) -> np.ndarray:
        """How many the numbers at places (K, 2) have."""
        (dots, powers), (start, end) = self._marks, places.T
        each = np.append(dots, len(self.content))[np.searchsorted(dots, start)]
        each = np.maximum(end - each - 1, 0)
        for k in np.flatnonzero(np.searchsorted(powers, start) < np.searchsorted(powers, end)).tolist():
            each[k] = decimals(self.text[start[k] : end[k]])
        return each

    def numbers(self, starts: np.ndarray, digits: np.ndarray, values: np.ndarray) -> list[bytes]:
        """New ones (K,) with so many decimals; with a plus where one stands at their place."""
        texts = np.empty(len(values), object)
        for count in np.unique(digits).tolist():
            rows, form = np.flatnonzero(digits == count), b"%%.%df" % count
            texts[rows] = [form % value for value in values[rows].tolist()]
        plus = np.frombuffer(self.content, np.uint8)[starts] == ord("+")
        for k in np.flatnonzero(plus | (np.abs(values) < 10.0**-digits)).tolist():
            text = texts[k][1:] if texts[k][:1] == b"-" and float(texts[k]) == 0.0 else texts[k]
            texts[k] = b"+" + text if plus[k] and text[:1] != b"-" else text
        return texts.tolist()

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
            raise source.refuse(start, f"found {text.strip()[:40]!r}; expected a number (computed targets "
                                       "cannot be corrected)")
        value = float(match[1])
        if not math.isfinite(value):
            raise source.refuse(start, f"found {match[1][:40]}; expected a finite number")
        return Number(value, start + match.start(1), start + match.end(1))


def numbers_of(targets: Sequence[Target]) -> np.ndarray:
    """(K, m) of targets of one kind."""
    found = np.fromiter(chain.from_iterable(target.numbers for target in targets), float)
    return found.reshape(len(targets), -1)


def _write(sources: Sequence[SourceText], targets: Sequence[Target], values: np.ndarray,
           alike: Sequence[slice], edits: list[Edit]) -> np.ndarray:
    """The numbers (K, m) that stand in the files when `values` are written, with the decimals that they have
    and at least `digits` of their targets; puts their edits to `edits`."""
    count, written = values.shape[1], np.empty(values.shape)
    files = np.array([target.file for target in targets])
    for file in np.unique(files).tolist():
        rows = np.flatnonzero(files == file)
        own = [targets[row] for row in rows.tolist()]
        flat = chain.from_iterable(chain.from_iterable(target.places[:count] for target in own))
        places = np.fromiter(flat, int).reshape(-1, 2)
        digits = np.fromiter(chain.from_iterable(target.digits for target in own), int)
        new = values[rows].ravel()
        if digits.size:
            each = np.maximum(sources[file].decimals(places), digits).reshape(-1, count)
            for part in alike:
                each[:, part] = each[:, part].max(axis=1, keepdims=True)
            texts = sources[file].numbers(places[:, 0], each.ravel(), new)
        else:
            texts = [b"%d" % value for value in new.tolist()]
        edits += map(_EDIT, zip(repeat(file), *places.T.tolist(), texts))
        written[rows] = np.fromiter(map(float, texts), float).reshape(-1, count)
    return written


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
