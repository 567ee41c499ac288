"""ABB RAPID: `.mod`, `.sys`. MoveL, MoveJ, MoveC, MoveAbsJ and their kin, to robtarget and jointtarget data
or literals.

    robtarget    [[x, y, z] mm, [q1, q2, q3, q4] w first, [cf1, cf4, cf6, cfx], [external axes]]
    jointtarget  [[axes deg], [external axes]]
Tool and work object are arguments of the motion; their numbers stand in these files (tooldata, wobjdata), in
another module beside the program too, or come by --tool, --base; tool0 and wobj0 are none. Mass and centre of
tooldata are the load. cf1, cf4, cf6 are the quadrants of the axes 1, 4, 6: they choose the branch and are
written anew; the last bit of cfx is the sign of axis 5 and stays, as all of cfx. Refused: Offs and RelTool,
computed targets, arguments of routines, GripLoad and TLoad without --payload, moving or held work objects,
tools at rest, external axes beside poses, and what moves targets (REASONS of rapid_data.py).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from exactarm.compensate.angles import from_quaternion, to_quaternion
from exactarm.compensate.configuration import EDGE_RAD, in_quadrant, quadrants
from exactarm.compensate.flange_poses import Poses
from exactarm.compensate.program import (
    LARGEST,
    Edit,
    Motion,
    Notation,
    Number,
    Numbers,
    Program,
    SourceText,
    Target,
)
from exactarm.compensate.rapid_data import (
    REASONS,
    ROBTARGET,
    SENSED,
    Given,
    Literal,
    tool_of,
)
from exactarm.compensate.rapid_frames import Frames, no_turn
from exactarm.compensate.rapid_frames import placement as placement  # what the dialect shows of a frame
from exactarm.compensate.setting import Setting
from exactarm.compensate.ways import goes_on, unread

NAME, SUFFIXES = "RAPID", (".mod", ".modx", ".sys", ".sysx")
MM_DECIMALS, DEG_DECIMALS, QUATERNION_DECIMALS = 5, 7, 9
DIGITS = (MM_DECIMALS,) * 3 + (QUATERNION_DECIMALS,) * 4
PARTS = ((3, "the position"), (4, "the orientation"), (4, "the configuration"), (6, "the external axes"))
SHARED = {2: "confdata", 3: "extjoint"}  # parts that may be names
NOWHERE = (0, 0)  # of a number that is not written
FIXED = ("its configuration is a name, which others may share; expected numbers, or ConfJ\\Off and "
         "ConfL\\Off for the module")
NOT_IN_USE = {9e9, 0.0}  # of an external axis
FRAME_NUMBERS = 7
SPREAD = {"v", "wobj", "tload"}  # switches that hold for each part of a way; a time, a number does not
FLY_BY = "z1"  # the zone at points in between: the arm does not stop there

_MOVE = re.compile(  # letters first and the edge of the word behind them: so the search is quick
    r"([MmTtSsAa](?<!\w.)(?i:(?<=M)ove(?:L|J|C|AbsJ)|(?<=T)rigg[LJC]|(?<=S)earchL|(?<=A)rc[LC]))"
    r"(?i:(DO|Sync|AO|GO|Start|End)?)\b\s*(?![\w:=(])"
)
_ELSEWHERE = re.compile(  # a literal behind another word
    rf";\s*(?!{_MOVE.pattern})(?P<word>[A-Za-z]\w*)\s+(?:\\\w+\s*,\s*)?\[\s*\[")
_SILENT = re.compile(  # instructions that neither move the arm nor lead elsewhere
    r"(?i)[ \t]*(?:(?:Set(?:DO|AO|GO)?|Reset|Pulse[DG]O|InvertDO|Wait(?:Time|Until|[DAG][IO])|Conf[LJ]"
    r"|TP(?:Write|Erase)|SingArea|AccSet|VelSet|SpeedRefresh|Clk(?:Start|Stop|Reset)|Incr|Decr|Add|Clear)\b"
    r"|\w+(?:\{[^}]*\})?[ \t]*:=)[^;]*;[ \t]*$")
KINDS = {
    "movel": "linear",
    "movej": "joint",
    "movec": "circular",
    "moveabsj": "joint",
    "arcl": "linear",
    "arcc": "circular",
    "triggl": "linear",
    "triggj": "joint",
    "triggc": "circular",
}


def read(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    reader = _Reader(sources, setting)
    for index in range(len(sources)):
        begun = len(reader.motions)
        reader.motions_of(index)
        if 0 < begun < len(reader.motions):  # another module: where the arm comes from is not known
            reader.motions.insert(begun, Motion("joint", None, reader.motions[begun].line))
    points = [name for name, data in reader.data.items() if data[0].kind in ("robtarget", "jointtarget")]
    told = unread(sources, reader.texts, points, [target.name for target in reader.targets], reader.spans)
    return Program(NAME, sources, tuple(reader.targets), tuple(reader.motions), _notation(setting),
                   (*reader.warnings, *told))


def _notation(setting: Setting) -> Notation:
    def words(targets: Sequence[Target], q: np.ndarray) -> Iterator[Edit]:
        rows = [k for k, target in enumerate(targets) if target.is_pose and setting.robot.axes == 6]
        if not rows:
            return
        old = np.array([targets[k].numbers[7:10] for k in rows])
        reported = setting.reported(q[rows])
        new = quadrants(reported)
        for k, i in np.argwhere(~in_quadrant(reported[:, [0, 3, 5]], np.trunc(old))):
            target = targets[rows[k]]
            if target.places[7 + i] != NOWHERE:
                yield Edit(target.file, *target.places[7 + i], b"%d" % new[k, i])

    return Notation(
        joints=lambda numbers: setting.joints(np.radians(numbers)),
        reported=lambda q: np.degrees(setting.reported(q)),
        poses=lambda numbers: Poses(1e-3 * numbers[:, :3], from_quaternion(numbers[:, 3:7])),
        shown=lambda tips, old: np.hstack([1e3 * tips.position, to_quaternion(tips.rotation, old[:, 3:7])]),
        words=words,
    )


class _Reader(Frames):
    def __init__(self, sources: tuple[SourceText, ...], setting: Setting):
        super().__init__(sources, setting)
        self.targets: list[Target] = []
        self.motions: list[Motion] = []
        self.used: dict[tuple[int, int], int] = {}
        self.warnings: list[str] = []
        self.coupled = bool(setting.robot.controller.coupling)
        self.cells: dict[tuple[str, str, int], tuple] = {}  # frames and load of a motion
        self.outside: dict[tuple[str, ...], bool] = {}  # external axes, the same in most: none in use
        self.nearest = {kind for index in range(len(sources)) for kind in self.unmonitored(index)}
        self.spans: list[list[tuple[int, int]]] = [
            [(datum.place, datum.literal.end if datum.literal else datum.place + 1)
             for data in self.data.values() for datum in data if datum.file == index]
            for index in range(len(sources))]

    # -- motions -------------------------------------------------------------------------------------
    def motions_of(self, index: int) -> None:
        source, text = self.sources[index], self.texts[index]
        source.refuse_words(text, REASONS)
        grips = re.finditer(r"[Gg](?<!\w.)(?i:ripLoad\s+(?!load0\b))", text)
        for match in grips if "gripload" in text.lower() else ():
            if self.setting.load is None:
                raise source.refuse(match.start(), "GripLoad: a load besides that of the tool; expected "
                                                   "--payload with both together")
        for match in _ELSEWHERE.finditer(";" + text):
            line = source.line(match.start("word") - 1)
            self.warnings.append(f"{source.path.name} line {line}: {match['word']} is not read; a target in "
                                 "it stays as it is")
        manners: dict[tuple[str, str], tuple[str, int, str, str]] = {}
        before = None  # the statement of the motion above
        for match in _MOVE.finditer(text):
            end = text.find(";", match.end())
            if end < 0:
                raise source.refuse(match.start(), f"{match[1]} without its end; expected ;")
            self.spans[index].append((match.start(), end))
            whole = ROBTARGET.match(text, match.end(), end)  # most targets in brackets
            switches, given, tail = self.arguments(text, match.end(), end, whole)
            key = match[0], tail
            if not tail or key not in manners:
                manners[key] = self.manner(index, match, switches, given.all)
            kind, count, tool, wobj = manners[key]
            axes = kind == "joint" and match[1].lower() == "moveabsj"
            nearest = kind in self.nearest and any(motion.target is not None for motion in self.motions)
            found = None if whole is None else Literal(whole.start(), whole.end(), [], whole)
            via = None
            goal = self.target(index, *given.first, axes, tool, wobj, found, nearest)
            if count == 2:
                via, goal = goal, self.target(index, *given.all[1], axes, tool, wobj, None, nearest)
            insert = None
            if kind == "linear" and switches.keys() <= SPREAD:
                insert = partial(self.insertion, index, match, end, given, before)
            before = (match.start(), end + 1)
            self.motions.append(Motion(kind, goal, source.line(match.start()), via, insert=insert))

    def manner(self, index: int, match: re.Match, switches: Mapping[str, str],
               plain: list[tuple[str, int]]) -> tuple[str, int, str, str]:
        """Kind, count of targets, tool and work object of a motion: by its word and what stands behind its
        first target."""
        source, word = self.sources[index], match[1].lower()
        if word == "searchl":
            raise source.refuse(match.start(), "SearchL stops where a sensor says; expected a target")
        for name in switches:
            if re.match(r"(wobj|tload)\s*\?", name):
                raise source.refuse(match.start(), f"a frame or load that a caller gives (\\{name}); "
                                                   "expected a name of these files")
        kind = KINDS[word]
        count = 2 if kind == "circular" else 1
        if len(plain) < count:
            raise source.refuse(match.start(), f"{match[1]} without a target")
        if found := switches.keys() & SENSED:
            raise source.refuse(match.start(), f"a sensor guides the motion (\\{found.pop()}); "
                                               "expected a target that is reached as it stands")
        if switches.get("tload", "load0").lower() != "load0" and self.setting.load is None:
            raise source.refuse(match.start(), "\\TLoad in place of the load of the tool; expected "
                                               "--payload with it")
        tool = tool_of(plain, count + 2 if match[2] and word.startswith("move") else -1)
        return kind, count, tool, switches.get("wobj", "wobj0")

    def insertion(self, index: int, match: re.Match, end: int, given: Given,
                  before: tuple[int, int] | None, points: list) -> Edit | None:
        """Points before a MoveL that has its line for itself and follows the motion above; flown by in a zone
        of 1 mm."""
        source, text, plain = self.sources[index], self.texts[index], given.all
        start = source.line_start(match.start())
        newline = re.search(r"\r\n|\n|\r", source.text)
        if (
            match[0].strip().lower() != "movel"
            or text[start : match.start()].strip()
            or len(plain) != 4
            or newline is None
            or not goes_on(text, before, start, _SILENT)
        ):
            return None
        (target, place), (zone, zone_place) = plain[0], plain[2]
        name = zone.strip()
        if not re.fullmatch(r"\w+", name) or "\n" in text[match.start() : end]:
            return None
        behind = zone_place + zone.index(name)
        head, middle = source.text[start:place], source.text[place + len(target) : behind]
        tail = source.text[behind + len(name) : end + 1]

        lines = []
        for q, tip in points:
            wxyz = to_quaternion(tip.rotation, np.array([1.0, 0.0, 0.0, 0.0]))
            position = ",".join(f"{value:.{MM_DECIMALS}f}" for value in 1e3 * tip.position)
            turn = ",".join(f"{value:.{QUATERNION_DECIMALS}f}" for value in wxyz)
            reported = self.setting.reported(q)
            word = [*quadrants(reported).tolist(), self.wrist(index, target, place)]
            literal = f"[[{position}],[{turn}],[{','.join(map(str, word))}],[9E9,9E9,9E9,9E9,9E9,9E9]]"
            lines.append(head + literal + middle + FLY_BY + tail + newline[0])
        return Edit(index, start, start, "".join(lines).encode("latin-1"))

    def wrist(self, index: int, target: str, place: int) -> int:
        """cfx of a point on the way: that of its end, for no straight motion passes a singular pose."""
        word, file = target.strip(), index
        literal = self.literal(index, place) if word.startswith("[") else None
        if literal is None:
            datum = self.seen(index, word)[0]
            literal, file = datum.literal, datum.file
        return int(self.part(file, literal, 2)[3].value)

    def target(
        self, index: int, value: str, place: int, axes: bool, tool: str, wobj: str, whole: Literal | None,
        nearest: bool,
    ) -> int:
        source = self.sources[index]
        literal = whole
        if literal is None:
            place += len(value) - len(value.lstrip())
            word = value.strip()
            literal = self.literal(index, place) if word.startswith("[") else None
        else:
            place = literal.start
        name, file = "", index
        if literal is None:
            if not re.fullmatch(r"\w+", word):
                self.targets.append(Target.unread(
                    word, index, source.line(place), "the target is computed; expected a name or numbers"))
                return len(self.targets) - 1
            datum = self.datum(index, word, place, ("jointtarget",) if axes else ("robtarget",))
            name, literal, file = word, datum.literal, datum.file
        line = self.sources[file].line(literal.start)
        where = name or f"line {line}", file, line
        key = (file, literal.start)
        made = (
            self.joints(where, literal, tool, index, place)
            if axes
            else self.pose(where, literal, tool, wobj, index, place, nearest)
        )
        if key in self.used:
            before = self.targets[self.used[key]]
            if not (before.tool == made.tool and before.base == made.base and before.load == made.load):
                raise source.refuse(
                    place,
                    f"{where[0]} is used with different tools or work objects: no one number is right for "
                    "all",
                )
            return self.used[key]
        self.targets.append(made)
        self.used[key] = len(self.targets) - 1
        return self.used[key]

    def joints(self, where: tuple[str, int, int], literal: Literal, tool: str, index: int,
               place: int) -> Target:
        file = where[1]
        source, n = self.sources[file], self.setting.robot.axes
        numbers = self.numbers(file, literal, 0, None, "the joint angles")[:n]
        if len(numbers) != n:
            raise source.refuse(literal.start, f"{len(numbers)} joint angles; expected {n}")
        load = self.once(self.tool, tool, index, place)[2]  # the arm bends under it, wherever the tip is
        numbers = Numbers.of(numbers).checked(source)
        return Target(*where, *numbers, (DEG_DECIMALS,) * n, load=load)

    def pose(
        self, where: tuple[str, int, int], literal: Literal, tool: str, wobj: str, index: int, place: int,
        nearest: bool,
    ) -> Target:
        source = self.sources[where[1]]
        numbers, places = self.robtarget(where[1], literal)
        if off := no_turn(numbers[3:7]):
            raise source.refuse(places[3][0], off)
        if (tool, wobj, index) not in self.cells:
            tip, why, load = self.once(self.tool, tool, index, place)
            base, why_base = self.once(self.work_object, wobj, index, place)
            self.cells[tool, wobj, index] = tip, base, load, why or why_base
        tip, base, load, why = self.cells[tool, wobj, index]
        monitored = self.setting.robot.axes == 6 and not nearest
        return Target(*where, numbers, places, DIGITS, is_pose=True, tool=tip, base=base, load=load,
                      matches=partial(self.fits, numbers[7:11]) if monitored else None,
                      refusal=why or (FIXED if monitored and places[7] == NOWHERE else ""))

    def robtarget(self, file: int, literal: Literal) -> Numbers:
        """Its numbers, but those of external axes, which must not be in use."""
        if literal.plain is not None:
            words = literal.plain.groups()
            outside, values = words[11:], tuple(map(float, words[:11]))
            if outside not in self.outside:
                self.outside[outside] = NOT_IN_USE.issuperset(map(float, outside))
            if self.outside[outside] and -LARGEST <= min(values) and max(values) <= LARGEST:
                return Numbers(values, literal.plain.regs[1:12])
        source = self.sources[file]
        numbers = Numbers.of([number for k in range(len(PARTS)) for number in self.part(file, literal, k)])
        if not NOT_IN_USE.issuperset(numbers.values[11:]):
            raise source.refuse(literal.start, "an external axis is in use; expected 9E9 in all of them")
        Numbers(numbers.values[:7], numbers.places).checked(source)
        return Numbers(numbers.values[:11], numbers.places[:11])

    def part(self, file: int, literal: Literal, k: int) -> list[Number]:
        """Numbers of a part of a robtarget. Configuration and external axes may be names: other targets may
        share them, and so their numbers have no place where new ones could be written."""
        part = literal.parts[k] if k < len(literal.parts) else None
        if k not in SHARED or not isinstance(part, tuple) or not re.fullmatch(r"\w+", part[0].strip()):
            return self.numbers(file, literal, k, *PARTS[k])
        datum = self.datum(file, part[0].strip(), part[1], (SHARED[k],))
        alone = Literal(datum.literal.start, datum.literal.end, [datum.literal.nested])
        return [number._replace(start=NOWHERE[0], end=NOWHERE[1])
                for number in self.numbers(datum.file, alone, 0, *PARTS[k])]

    def fits(self, cf: Sequence[float], q: np.ndarray) -> bool:
        """Whether joint angles are of a configuration."""
        angles = (self.setting.reported(q) if self.coupled else q).tolist()
        first, fourth, sixth, wrist = map(int, cf)
        if not (in_quadrant(angles[0], first) and in_quadrant(angles[3], fourth)
                and in_quadrant(angles[5], sixth)):
            return False
        sine = math.sin(angles[4])
        return abs(sine) < EDGE_RAD or wrist == 0 or bool(wrist & 1) == (sine < 0.0)
