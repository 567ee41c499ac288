"""What a program does not say of its cell: tools, bases, the load, joint angles at its start; and which
points are calculated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

import numpy as np

from exactarm.compensate.program import Program
from exactarm.errors import InputError
from exactarm.robot.robot import Robot

LARGEST = 1e6  # mm or degrees that a controller shows of a frame, or that its axes stand at


@dataclass(frozen=True)
class Setting:
    """robot: the identified one. tools, bases: name or number -> the numbers as its controller shows them; ""
    stands for any that is not named. start: joint angles (n,) rad before the first motion. load: kg and
    centre (3,) m of the tool. device: tables of poses are in the measuring device's frame, of the target that
    it measures. columns: names in tables -> ours."""

    robot: Robot
    tools: dict[str, tuple[float, ...]] = field(default_factory=dict)
    bases: dict[str, tuple[float, ...]] = field(default_factory=dict)
    start: np.ndarray | None = None
    load: tuple[float, tuple[float, float, float]] | None = None
    device: bool = False
    columns: Mapping[str, str] = field(default_factory=dict)
    unnamed: dict[str, set[str]] = field(default_factory=dict, compare=False)  # names that "" stood for

    def tool(self, name: str) -> tuple[float, ...] | None:
        return self._frame("tool", self.tools, name)

    def base(self, name: str) -> tuple[float, ...] | None:
        return self._frame("base", self.bases, name)

    def _frame(
        self, option: str, frames: Mapping[str, tuple[float, ...]], name: str
    ) -> tuple[float, ...] | None:
        """The frame of a name; the one without a name stands for one name, not for several."""
        folded = {key.lower(): numbers for key, numbers in frames.items()}
        if name.lower() in folded or "" not in folded:
            return folded.get(name.lower())
        names = self.unnamed.setdefault(option, set())
        names.add(name.lower())
        if len(names) > 1:
            shown = ", ".join(sorted(word or "(none set)" for word in names))
            raise InputError(f"--{option} without a name, and the programs use several ({shown}); expected "
                             f"--{option} NAME=NUMBERS for each")
        return folded[""]

    def joints(self, reported: np.ndarray) -> np.ndarray:
        """q (n,) of what a controller reports whose axes are coupled."""
        return self.robot.controller.joints(np.asarray(reported, float))

    def reported(self, q: np.ndarray) -> np.ndarray:
        """The inverse of `joints`."""
        return self.robot.controller.reported(np.asarray(q, float))


def read_frames(option: str, words: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """NAME=NUMBERS or NUMBERS alone, six of them or seven, as a controller shows a frame."""
    frames = {}
    for word in words:
        name, _, numbers = word.rpartition("=")
        frames[name.strip()] = read_numbers(option, numbers, (6, 7))
    return frames


def read_numbers(option: str, text: str, counts: tuple[int, ...] | None) -> tuple[float, ...]:
    """Numbers with commas between them."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    sound = all(abs(number) <= LARGEST for number in numbers)
    if not numbers or (counts and len(numbers) not in counts) or not sound:
        expected = " or ".join(map(str, counts or ()))
        raise InputError(
            f"{option} {text}: expected {expected} numbers with commas between them, none beyond "
            f"{LARGEST:g}".replace("  ", " ")
        )
    return numbers


def chosen_points(program: Program, points: str | None) -> np.ndarray:
    """(T,) bool: which targets are calculated. Refused where nobody has said so."""
    names = [target.name for target in program.targets]
    if points == "calculated" or (points is None and program.calculated):
        return np.ones(len(names), bool)
    if points == "taught":
        return np.zeros(len(names), bool)
    if points is None:
        known = [target.name for target in program.targets if target.numbers]
        raise InputError(
            f"a {program.dialect} program does not say which points were calculated: those taught on the "
            "robot are right already, and "
            "correcting them makes them wrong; say --points calculated, --points taught, or the names of the "
            "calculated ones: "
            f"--points {','.join(dict.fromkeys(known[:2])) or 'P1,P2'}",
            file=program.files[0].path,
        )
    patterns = words_of(points)
    matches = lambda name: any(fnmatchcase(name.lower(), pattern) for pattern in patterns)
    return np.array([matches(name) for name in names], bool)


def words_of(points: str) -> list[str]:
    """Names of --points, in small letters, as patterns in which a bracket is a letter (P[1] of Fanuc); empty
    where it holds none."""
    if points in ("calculated", "taught"):
        return []
    return [word.strip().lower().replace("[", "[[]") for word in points.split(",")]


def unmatched(programs: Sequence[Program], points: str) -> list[str]:
    """Names of --points, as they were given, that no point of any program has: a slip of the pen would leave
    one as it is."""
    names = {target.name.lower() for program in programs for target in program.targets}
    known = lambda word: any(fnmatchcase(name, word) for name in names)
    given = (word.strip() for word in points.split(","))
    return [name for name, word in zip(given, words_of(points)) if not known(word)]
