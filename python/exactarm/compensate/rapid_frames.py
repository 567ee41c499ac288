"""Tools and work objects of RAPID modules: where they are, from tooldata and wobjdata of these files or from
the command line, or why that is not known."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from exactarm.compensate.angles import from_quaternion
from exactarm.compensate.program import SourceText
from exactarm.compensate.rapid_data import Datum, Declarations, Literal
from exactarm.compensate.setting import Setting
from exactarm.errors import InputError
from exactarm.robot.mdh_frames import compose
from exactarm.robot.robot import Placement

NORM_TOLERANCE = 1e-2  # of a quaternion typed with three decimals


def placement(numbers) -> Placement:
    """Of a frame: x, y, z in mm and a quaternion, w first; refused where that is none."""
    if (off := no_turn(numbers[3:7])):
        raise InputError(f"frame {','.join(f'{number:g}' for number in numbers)}: {off}")
    return Placement(from_quaternion(np.array(numbers[3:7])), 1e-3 * np.array(numbers[:3], float))


class Frames(Declarations):
    def __init__(self, sources: tuple[SourceText, ...], setting: Setting):
        super().__init__(sources)
        self.setting = setting
        self.frames: dict[tuple[str, str, int], tuple] = {}

    def once(self, read: Callable[[str, int, int], tuple], name: str, index: int, place: int) -> tuple:
        """What `read` finds of a frame: the same for all motions with it."""
        key = read.__name__, name, index
        if key not in self.frames:
            self.frames[key] = read(name, index, place)
        return self.frames[key]

    def tool(self, name: str, index: int, place: int):
        """Placement and, where it is not known, why; load."""
        if name.lower() == "tool0":
            return Placement(), "", None
        if not self.seen(index, name):
            return *self.given("tool", name), None
        datum = self.datum(index, name, place, ("tooldata",))
        parts = datum.literal.parts
        if len(parts) != 3 or not isinstance(parts[0], tuple) or parts[0][0].strip().upper() != "TRUE":
            return Placement(), f"{name} is not held by the robot; expected tooldata with TRUE", None
        frame = self.frame(datum, parts[1])
        load = self.load(datum, parts[2])
        return frame, self.otherwise("tool", name, frame), load

    def work_object(self, name: str, index: int, place: int):
        """Placement of user frame and object frame, and, where they are not known, why."""
        if name.lower() == "wobj0":
            return Placement(), ""
        if not self.seen(index, name):
            return self.given("base", name)
        datum = self.datum(index, name, place, ("wobjdata",))
        parts = datum.literal.parts
        flags = [part[0].strip().upper() for part in parts[:2] if isinstance(part, tuple)]
        if flags != ["FALSE", "TRUE"] or len(parts) != 5:
            return Placement(), f"{name} is held or moved; expected wobjdata with FALSE, TRUE"
        frame = compose(self.frame(datum, parts[3]), self.frame(datum, parts[4]))
        return frame, self.otherwise("base", name, frame)

    def given(self, option: str, name: str) -> tuple[Placement, str]:
        """A frame of the command line, and why it is not known."""
        numbers = (self.setting.tool if option == "tool" else self.setting.base)(name)
        if numbers is not None and len(numbers) == 7:
            return placement(numbers), ""
        what = "tool" if option == "tool" else "work object"
        return Placement(), f"unknown {what} {name or '(none in the motion)'}: {_expected(option, name)}"

    def otherwise(self, option: str, name: str, frame: Placement) -> str:
        """What is wrong where the command line has other numbers for a frame than the file."""
        named = self.setting.tools if option == "tool" else self.setting.bases
        numbers = {key.lower(): numbers for key, numbers in named.items()}.get(name.lower())
        same = numbers is None or (len(numbers) == 7 and placement(numbers) == frame)
        return "" if same else f"{name} has other numbers in these files than by --{option}"

    def frame(self, datum: Datum, parts) -> Placement:
        literal = Literal(datum.literal.start, datum.literal.end, parts if isinstance(parts, list) else [])
        numbers = self.numbers(datum.file, literal, 0, 3, "the position") + self.numbers(
            datum.file, literal, 1, 4, "the orientation"
        )
        if off := no_turn([number.value for number in numbers[3:]]):
            raise self.sources[datum.file].refuse(numbers[3].start, off)
        return placement([number.value for number in numbers])


def no_turn(wxyz: Sequence[float]) -> str:
    """Why four numbers are no orientation; empty: they are."""
    norm = math.hypot(*wxyz)
    return "" if abs(norm - 1.0) <= NORM_TOLERANCE else f"quaternion of norm {norm:.4g}; expected 1"


def _expected(option: str, name: str) -> str:
    return f"expected --{option} {name}=x,y,z,q1,q2,q3,q4 (mm), or its data in these files"
