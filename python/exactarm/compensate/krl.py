"""KUKA KRL: `.src` with its `.dat`. PTP, LIN, CIRC and their S forms, to points in the data list or literals.

    E6POS, POS, FRAME {X, Y, Z mm, A, B, C deg, S, T, E1..}   R = Rz(A) Ry(B) Rx(C)      E6AXIS, AXIS {A1..An
    deg}
Tool and base: FDAT of the inline form (TOOL_NO, BASE_NO), else $TOOL and $BASE; their numbers from TOOL_DATA,
BASE_DATA or literals in these files, or --tool, --base; number 0 and $NULLFRAME are none. Base frames are
taken in $ROBROOT. T holds the sign of each axis in a bit: it chooses the branch and is written anew. S stays:
its third bit is the sign of A5.
LIN and CIRC take the branch nearest to the point before, as the controller does.
Refused: $ABS_ACCUR, relative motions, geometric operators, computed points or frames, frames that the program
changes, a $TOOL or $BASE that hangs on its way (ways.py), tools at rest (#TCP), external axes beside poses,
and what moves targets (krl_data.py).
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from exactarm.compensate.angles import from_zyx, to_zyx
from exactarm.compensate.configuration import ZERO_RAD, sign_bits, signs_fit
from exactarm.compensate.flange_poses import Poses
from exactarm.compensate.krl_data import (
    AGGREGATE,
    ASSIGNED,
    CARTESIAN,
    POINT_NAME,
    Aggregate,
    arguments,
    blocks,
)
from exactarm.compensate.krl_frames import START, Frames, ToolAndBase
from exactarm.compensate.krl_frames import placement as placement  # what the dialect shows of a frame
from exactarm.compensate.program import HERE, Edit, Motion, Notation, Program, SourceText, Target
from exactarm.compensate.setting import Setting
from exactarm.compensate.ways import UNCERTAIN, Step, goes_on, settings_of, unread, walk
from exactarm.errors import InputError
from exactarm.robot.robot import Placement

NAME, SUFFIXES = "KRL", (".src", ".dat")
MM_DECIMALS, DEG_DECIMALS = 5, 7  # 1e-8 m and 2e-9 rad: below a micrometre at any reach
DIGITS = (MM_DECIMALS,) * 3 + (DEG_DECIMALS,) * 3
_MOTION = re.compile(r"(?im)^[ \t]*(S?PTP|S?LIN|S?CIRC|SPL)(_REL)?\b[ \t]*([^\r\n]*)")
_BAS = re.compile(r"(?im)^[ \t]*BAS[ \t]*\([ \t]*#(TOOL|BASE|FRAMES|EX_BASE|INITMOV)[ \t]*"
                  r"(?:,[ \t]*([^)\r\n]*))?\)")
_AT_ANY_TIME = re.compile(r"(?i)\bDO[ \t]+(\w+)[ \t]*\(")  # of an interrupt or a trigger
_POINT = re.compile(r"(?im)^[ \t]*(?:(?:global|decl)[ \t]+)*(?:E6)?(?:POS|AXIS)[ \t]+(\w+)[ \t]*=")
_ROBOT_BASE = re.compile(r"(?im)^[ \t]*(\$ROBROOT\b[^\r\n=]*=(?!=))")
_LOAD = re.compile(r"(?im)^[ \t]*(\$LOAD\b[^\r\n=]*=(?!=))")
_REST = re.compile(r"[^\r\n]*")
_SPLINE = re.compile(r"(?im)^[ \t]*(?:PTP_)?SPLINE\b([^\r\n]*)")
_OF_FORM = re.compile(  # in capitals: $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO)
    r"\$(TOOL|BASE|IPO_MODE)[ \t]*=[ \t]*S(?:TOOL2?|BASE|IPO_MODE)[ \t]*"
    r"\([ \t]*(\w+)[ \t]*(?:\.\w+[ \t]*)?\)")
_SPLINE_END = re.compile(r"(?im)^[ \t]*ENDSPLINE\b")
_SILENT = re.compile(  # lines that neither move the arm nor lead elsewhere
    r"(?i)[ \t]*(?:\$\w+(?:\[[^\]\r\n]*\])?(?:\.\w+)?[ \t]*=|[FPL]DAT_ACT[ \t]*=|BAS[ \t]*\([ \t]*#|"
    r"WAIT[ \t]+(?:SEC|FOR)\b|CONTINUE\b|PULSE[ \t]*\()")
ACCURATE = 16  # of S: for information alone; the arm goes where it would without
TWICE = ("bit 4 of S says that an arm with absolute accuracy was taught it; where the controller corrects by "
         "itself, it must not be corrected twice")
NOWHERE = (0, 0)  # of a T that is not given
KINDS = {
    "PTP": "joint",
    "SPTP": "joint",
    "LIN": "linear",
    "SLIN": "linear",
    "SPL": "joint",
    "CIRC": "circular",
    "SCIRC": "circular",
}


def read(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    reader = _Reader(sources, setting)
    for index, source in enumerate(sources):
        if source.path.suffix.lower() == ".src":
            reader.motions_of(index)
    reader.warnings += unread(sources, reader.texts, reader.declared, [t.name for t in reader.targets],
                              reader.spans)
    told = tuple(dict.fromkeys(reader.warnings))
    return Program(NAME, sources, tuple(reader.targets), tuple(reader.motions), _notation(setting), told)


def _notation(setting: Setting) -> Notation:
    def words(targets: Sequence[Target], q: np.ndarray) -> Iterator[Edit]:
        for target, reported in zip(targets, setting.reported(q)):
            turn = int(target.numbers[-1])
            if target.is_pose and target.places[-1] != NOWHERE and not signs_fit(turn, reported):
                bits = turn & ~(2 ** len(reported) - 1) | sign_bits(reported)
                yield Edit(target.file, *target.places[-1], b"%d" % bits)

    return Notation(
        joints=lambda numbers: setting.joints(np.radians(numbers)),
        reported=lambda q: np.degrees(setting.reported(q)),
        poses=lambda numbers: Poses(1e-3 * numbers[:, :3], from_zyx(np.radians(numbers[:, 3:6]))),
        shown=lambda tips, old: np.hstack(
            [1e3 * tips.position, np.degrees(to_zyx(tips.rotation, np.radians(old[:, 3:6])))]),
        words=words,
    )


ALONE = {kind for kind in KINDS if not kind.endswith("CIRC")}  # with one point


class _Reader(Frames):
    def __init__(self, sources: tuple[SourceText, ...], setting: Setting):
        super().__init__(sources, setting)
        self.targets: list[Target] = []
        self.motions: list[Motion] = []
        self.used: dict[tuple, int] = {}
        data = [text for source, text in zip(sources, self.texts) if source.path.suffix.lower() == ".dat"]
        self.declared = [match[1] for text in data for match in _POINT.finditer(text)]
        self.moves = [source.at_lines(_MOTION, text) for source, text in zip(sources, self.texts)]
        self.spans = [[match.span() for match in (*moves, *assigned)]
                      for moves, assigned in zip(self.moves, self.assigned)]
        places = lambda word, text: [m.start() for m in re.finditer(rf"(?im)^[ \t]*;{word}\b", text)]
        self.folds = [(places("FOLD", source.text), places("ENDFOLD", source.text)) for source in sources]
        if not any(source.path.suffix.lower() == ".src" for source in sources):
            raise InputError("a data list without its .src: the motions are there; give both",
                             file=sources[0].path)

    # -- motions -------------------------------------------------------------------------------------
    def motions_of(self, index: int) -> None:
        text, source = self.texts[index], self.sources[index]
        small = text.lower()
        for match in source.at_lines(_ROBOT_BASE, text) if "$robroot" in small else ():
            raise source.refuse(match.start(1), "the program sets where the arm stands, $ROBROOT, from which "
                                                "bases count; expected an arm that stays")
        for match in source.at_lines(_LOAD, text) if "$load" in small and self.setting.load is None else ():
            raise source.refuse(match.start(1),
                                "the program sets its load, $LOAD; expected --payload with it")
        events = [*self.moves[index], *source.at_lines(_BAS, text), *self.assigned[index]]
        if "spline" in small:
            events += [*source.at_lines(_SPLINE, text), *source.at_lines(_SPLINE_END, text)]
        steps, inline, block = blocks(source, text), None, None
        for match in sorted(events, key=lambda match: match.start()):
            place = match.start()
            if match.re is _BAS:
                steps += self.set_by_bas(place, match[1].upper(), match[2] or "", steps)
            elif match.re is ASSIGNED:
                name = match[2].upper()
                rest = _REST.match(text, match.end())[0].strip()
                if name == "FDAT_ACT":
                    inline = rest.upper()
                elif name in START:
                    value = self.assigned_record(index, match) or re.sub(r"\s", "", rest.upper())
                    steps.append(Step(place, "set", (name, UNCERTAIN if match[4] else value)))
            elif match.re in (_SPLINE, _SPLINE_END):
                block = self.inline_form(index, match, match[1], None) if match.re is _SPLINE else None
            else:
                form = self.inline_form(index, match, match[3], inline) or block
                steps += [Step(place, "move", (match, form)), *self.left_behind(place, inline)]
                inline = None
        setting = settings_of(steps)
        for match in _AT_ANY_TIME.finditer(text) if any(setting.values()) else ():
            if setting.get(match[1].upper()):
                raise source.refuse(match.start(1), f"{match[1]} sets {min(setting[match[1].upper()])} at "
                                                    "any time; expected it set between motions")
        self.above: tuple[int, int] | None = None  # the line of the motion above
        for (match, form), state in walk(steps, START):
            self.motion(index, match, state, form)

    def set_by_bas(self, place: int, which: str, number: str, above: list[Step]) -> list[Step]:
        """INITMOV takes back what is set above it, or leaves it, by what stands in BAS.SRC."""
        if which == "INITMOV":
            return [Step(place, "set", (name, "perhaps taken back by #INITMOV"))
                    for name in ("$TOOL", "$BASE")
                    if any(step.what == "set" and step.data[0] == name for step in above)]
        if which == "EX_BASE":
            return [Step(place, "set", ("$BASE", f"the base {number.strip()} of an external axis"))]
        return [] if which == "FRAMES" else [
            Step(place, "set", (f"${which}", f"{which}_DATA[{number.strip()}]"))]

    def inline_form(self, index: int, match: re.Match, behind: str, inline: str | None) -> str | None:
        """Name of the FDAT that holds tool and base of a motion, or of a spline block, by what stands behind
        its word."""
        clause = re.search(r"(?i)\bWITH\b(.*)", behind) if "$" in behind else None
        if clause is None or not re.search(r"(?i)\$(TOOL|BASE|IPO_MODE)\b", clause[1]):
            return inline
        given = dict(_OF_FORM.findall(clause[1].upper()))
        named = {word.upper() for word in re.findall(r"(?i)\$(TOOL|BASE|IPO_MODE)\b", clause[1])}
        forms = set(given.values())
        if len(forms) != 1 or not {"TOOL", "BASE"} <= given.keys() or named - given.keys():
            what = "spline block" if match.re is _SPLINE else "motion"
            raise self.sources[index].refuse(
                match.start(), f"the $TOOL, $BASE or $IPO_MODE of this {what} alone; expected those of "
                               "one inline form (STOOL2(F..), SBASE(F..)), or set before it")
        return forms.pop().upper()

    def left_behind(self, place: int, form: str | None) -> list[Step]:
        """An inline form with BAS leaves its tool and base as $TOOL and $BASE; WITH does not."""
        known = self.values.get(form or "", [])
        if len(known) != 1 or known[0][2] is None:
            return []
        fields = known[0][2].fields
        return [Step(place, "set", (f"${which}", f"{which}_DATA[{int(self.number(known[0][2], key).value)}]"))
                for which, key in (("TOOL", "TOOL_NO"), ("BASE", "BASE_NO")) if key in fields]

    def motion(self, index: int, match: re.Match, state: dict, inline: str | None) -> None:
        source, kind = self.sources[index], match[1].upper()
        line = source.line(match.start())
        if match[2]:
            self.arrive(index, match, line, [self.unread(
                f"{kind}_REL", index, line, "moves from where the arm is; expected absolute targets")],
                state, inline)
            return
        if kind in ALONE and (record := self.record(index, match, 3)):
            place = self.target(index, f"line {line}", record, state, inline, kind)
            self.arrive(index, match, line, [place], state, inline)
            return
        words = arguments(match[3], match.start(3))
        if not words or not words[0][0].strip():
            raise source.refuse(match.start(), f"{kind} without a point")
        if kind.endswith("CIRC"):
            if len(words) < 2:
                raise source.refuse(match.start(), f"{kind} without two points; expected two")
            angle = any(re.match(r"(?i)\s*CA\b", word) for word, _ in words[2:])
            words = words[:2]
        else:
            words, angle = words[:1], False
        places = []
        for word, place in words:
            if angle:
                places.append(self.unread(word, index, line,
                                          "an arc that ends at an angle (CA); expected one that ends at its "
                                          "point"))
                continue
            if not POINT_NAME.match(word.strip()) and not AGGREGATE.fullmatch(word.strip()):
                places.append(self.unread(word, index, line,
                                          "the point is computed; expected a name or numbers"))
                continue
            found = self.point(index, word, place)
            places.append(None if found is None else self.target(index, *found, state, inline, kind))
        self.arrive(index, match, line, places, state, inline)

    def unread(self, name: str, index: int, line: int, why: str) -> int:
        name = f"line {line}" if name.lstrip().startswith("{") else name
        self.targets.append(Target.unread(name, index, line, why))
        return len(self.targets) - 1

    def arrive(self, index: int, match: re.Match, line: int, places: list[int | None], state: dict,
               inline: str | None) -> None:
        """A motion to the targets `places`."""
        kind, insert = match[1].upper(), None
        via = places[0] if len(places) == 2 else None
        if kind == "LIN" and inline is None and places[-1] is not None:
            insert = partial(self.insertion, index, match, state, places[-1], self.above)
        self.above = match.span()
        self.motions.append(Motion(KINDS[kind], places[-1], line, via, insert=insert))

    def insertion(self, index: int, match: re.Match, state: dict, place: int, above: tuple[int, int] | None,
                  points: list) -> Edit | None:
        """Points before a LIN that follows the motion above, outside of folds (an inline form would be
        written anew from its comment), in the $TOOL and $BASE of its point; passed with C_DIS."""
        source, text = self.sources[index], self.texts[index]
        start = source.line_start(match.start())
        newline = re.search(r"\r\n|\n|\r", source.text)
        opened, closed = self.folds[index]
        if newline is None or bisect_left(opened, start) != bisect_left(closed, start):
            return None
        if not goes_on(text, above, start, _SILENT):
            return None
        end = start
        while end and text[end - 1].isspace():
            end -= 1
        if re.match(r"(?i)[ \t]*TRIGGER\b", text[source.line_start(end) : end]):
            return None
        here, target = self.frames(index, "", state, None), self.targets[place]
        if isinstance(here.tool, str) or isinstance(here.base, str) or (here.tool, here.base) != (
            target.tool, target.base
        ):
            return None
        indent = source.text[start : match.start(1)]

        lines = []
        for _, tip in points:
            values = [*(1e3 * tip.position), *np.degrees(to_zyx(tip.rotation, np.zeros(3)))]
            digits = [MM_DECIMALS] * 3 + [DEG_DECIMALS] * 3
            fields = ",".join(f"{key} {value:.{n}f}" for key, value, n in zip(CARTESIAN, values, digits))
            lines.append(f"{indent}LIN {{{fields}}} C_DIS{newline[0]}")
        return Edit(index, start, start, "".join(lines).encode("latin-1"))

    def target(
        self, index: int, name: str, point: Aggregate, state: dict, inline: str | None, kind: str
    ) -> int:
        key = (point.file, point.start)
        frames = None if point.is_axis else self.frames(index, name, state, inline)
        if key in self.used:
            if frames is not None and not frames.agree(self.targets[self.used[key]]):
                raise self.sources[point.file].refuse(
                    point.start,
                    f"point {name} is used with different tools or bases: no one number is right for all",
                )
            return self.used[key]
        made = self.axes(name, point) if frames is None else self.pose(name, point, frames, kind)
        self.targets.append(made)
        self.used[key] = len(self.targets) - 1
        return self.used[key]

    def axes(self, name: str, point: Aggregate) -> Target:
        source, n = self.sources[point.file], self.setting.robot.axes
        numbers, places = self.numbers(point, [f"A{i}" for i in range(1, n + 1)])
        digits = (DEG_DECIMALS,) * n
        return Target(name, point.file, source.line(point.start), numbers, places, digits)

    def pose(self, name: str, point: Aggregate, frames: ToolAndBase, kind: str) -> Target:
        source = self.sources[point.file]
        numbers, places = self.numbers(point, CARTESIAN)
        status, turn = self.status_and_turn(point)
        matches, written = None, NOWHERE if turn is None else (turn.start, turn.end)
        accurate = status is not None and int(status.value) & ACCURATE
        if accurate and not any(TWICE in told for told in self.warnings):
            self.warnings.append(f"{name} (line {source.line(point.start)}): {TWICE}")
        if turn is not None and kind in ("PTP", "SPTP"):
            wrist = None if status is None or self.setting.robot.axes != 6 else bool(int(status.value) & 4)
            matches = partial(self.fits, int(turn.value), wrist)
        known = lambda part: part if isinstance(part, Placement) else HERE
        return Target(
            name,
            point.file,
            source.line(point.start),
            (*numbers, 0.0 if turn is None else turn.value),
            (*places, written),
            DIGITS,
            is_pose=True,
            tool=known(frames.tool),
            base=known(frames.base),
            matches=matches,
            refusal=frames.refusal,
        )

    def fits(self, turn: int, wrist: bool | None, q: np.ndarray) -> bool:
        """Whether joint angles have the signs of T and, where S says it, that of axis 5."""
        reported = self.setting.reported(q)
        if wrist is None:
            return signs_fit(turn, reported)
        sine = np.sin(reported[4])
        return signs_fit(turn, reported) and (abs(sine) < ZERO_RAD or wrist == (sine < 0.0))
