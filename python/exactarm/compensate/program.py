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
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from exactarm.errors import InputError
from exactarm.file_bytes import file_bytes
from exactarm.robot import Placement

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER = re.compile(rf"\s*({NUMBER})\s*")
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


@dataclass(frozen=True)
class Target:
    """A target of a program, as the controller means it.

    joints   (n,) rad as reported, or None       pose   of the tool's tip in its base, or None
    tool     of the tip in the flange; `HERE` itself: not known, of joint angles alone
    base     in the controller's base frame; for poses
    load     kg and its centre (3,) m in the flange frame, where the program says so
    encode   (q (n,), pose or None) -> the edits that write this command
    near     joint angles (n,) rad close to which a pose is meant, or None: close to the target before
    matches  whether joint angles belong to the configuration that the program names; None: it names none
    configuration  a word that must be that of the pose before, where its meaning for the arm is not certain
    refusal  why this target cannot be corrected; empty: it can
    """

    name: str
    file: int
    line: int
    encode: Callable[[np.ndarray, Placement | None], list[Edit]]
    joints: np.ndarray | None = None
    pose: Placement | None = None
    tool: Placement = field(default_factory=lambda: HERE)
    base: Placement = field(default_factory=lambda: HERE)
    load: tuple[float, tuple[float, float, float]] | None = None
    near: np.ndarray | None = None
    matches: Callable[[np.ndarray], bool] | None = None
    configuration: str = ""
    refusal: str = ""

    @property
    def tip_known(self) -> bool:
        """Whether a straight motion to it can be followed."""
        return self.pose is not None or self.tool is not HERE


@dataclass(frozen=True)
class Motion:
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
class Program:
    """Files of one program (KRL has two), its targets and its motions in the order of the text.

    calculated: the format says that nobody has taught these points on the robot.
    finish: (contents with edits, targets' commands (N, n) or NaN, what `insert` of the motions gave) ->
    contents, where a file gets more than edits.
    numbered: what `insert` of the motions gave, in their order -> edits, where lines and points are counted.
    """

    dialect: str
    files: tuple[SourceText, ...]
    targets: tuple[Target, ...]
    motions: tuple[Motion, ...]
    warnings: tuple[str, ...] = ()
    calculated: bool = False
    finish: Callable[[list[bytes], np.ndarray, list], list[bytes]] | None = None
    numbered: Callable[[list], list[Edit]] | None = None

    def rewritten(self, edits: Iterable[Edit]) -> list[bytes]:
        """The content of each file with the edits."""
        contents = []
        for index, source in enumerate(self.files):
            parts, last = [], 0
            for edit in sorted((e for e in edits if e.file == index), key=lambda edit: edit.start):
                if edit.start < last:
                    raise ValueError(f"edits of {source.path} overlap at byte {edit.start}")
                parts += [source.content[last : edit.start], edit.text]
                last = edit.end
            contents.append(b"".join([*parts, source.content[last:]]))
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
        return [0, *(match.end() for match in re.finditer(r"\r\n|\n|\r", self.text))]

    def line(self, offset: int) -> int:
        """Line, from 1, of a place."""
        return bisect_right(self._starts, offset)

    def line_start(self, offset: int) -> int:
        """Place where the line of a place begins."""
        return self._starts[self.line(offset) - 1]

    def refuse(self, offset: int, message: str) -> InputError:
        return InputError(message, file=self.path, line=self.line(offset))

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

    def edit(self, source: SourceText, file: int, value: float, least_decimals: int) -> Edit:
        """With as many decimals as it has, at least `least_decimals`."""
        decimals = max(self.decimals(source), least_decimals)
        text = f"{value:.{decimals}f}"
        if float(text) == 0.0:
            text = text.removeprefix("-")
        plus = "+" if source.text[self.start] == "+" and not text.startswith("-") else ""
        return Edit(file, self.start, self.end, (plus + text).encode())

    def decimals(self, source: SourceText) -> int:
        """How many it has."""
        text = source.text[self.start : self.end]
        if text.isdigit():
            return 0
        mantissa, _, exponent = text.lower().partition("e")
        return max(len(mantissa.partition(".")[2]) - (int(exponent) if exponent else 0), 0)


def in_range(source: SourceText, numbers: Sequence[Number]) -> None:
    """Refuses what no program means."""
    for number in numbers:
        if abs(number.value) > LARGEST:
            raise source.refuse(
                number.start, f"{number.value:g}; expected a number of at most {LARGEST:g} in size"
            )
