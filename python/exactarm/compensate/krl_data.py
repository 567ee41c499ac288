"""What KRL files declare: names with their records `{X 1, Y 2}`, as text with the place of every number.

    NAME or NAME[i] -> (file, place, fields)     a point of a motion: its name, or a record in the line itself

A name is refused where it is used, not where it stands: given twice, computed, or with a component that the
program sets. Comments and strings are blank in `texts`; places are those of the files.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from exactarm.compensate.program import NUMBER, Number, Numbers, SourceText
from exactarm.compensate.ways import Step
from exactarm.errors import InputError

ELSEWHERE = (
    "XHOME",
    "HOME",
    "$H_POS",
    "$AXIS_ACT",
    "$AXIS_RET",
    "$AXIS_FOR",
    "$POS_ACT",
)  # of the controller itself

_ALONE = re.compile(r"\{([^{}]*)\}(?=[ \t]*(?:[\r\n]|\Z))")
AGGREGATE = re.compile(r"\{([^{}]*)\}")
ASSIGNED = re.compile(
    r"(?im)^[ \t]*((?:(?:global|decl|const)[ \t]+)*(?:[a-z]\w*[ \t]+)?)(\$?[a-z_]\w*)[ "
    r"\t]*(\[[^\]\r\n]*\])?(\.\w+)?[ \t]*=(?!=)[ \t]*"
)
_SPLITS = re.compile(r"[,{}()]")
_ONE = re.compile(r"[ \t]*(\w+|\{[^{}()]*\})(?:[ \t]+C_\w+)*[ \t]*")
_WITH = re.compile(r"(?i)[ \t]+WITH\b.*$")
_BLEND = re.compile(r"(?i)(?<=[\w}])[ \t]+(C_\w+|WITH\b.*)\s*$")
_HEAD = re.compile(r"\s*\w+\s*:")
_FIELD = re.compile(r"\s*([A-Za-z_]\w*)(\[\])?\s*")
POINT_NAME = re.compile(r"(?i)\$?[a-z_]\w*$")


_HEADS = re.compile(r"(?i)[ \t]*(?:GLOBAL[ \t]+)?DEF[ \t]+\w+[ \t]*\(([^)\r\n]*\w[^)\r\n]*)\)")
_SENSED = "a sensor decides where the arm goes; expected targets that are reached as they stand"
REASONS = dict.fromkeys(("rsi_on", "rsi_movecorr", "st_on", "st_on1", "st_movesens"), _SENSED)
_KEPT = re.compile(  # an orientation that the arm keeps
    r"(?i)(\$ORI_TYPE[ \t]*=|\bORI_TYP[ \t]+)[ \t]*#(?:CONSTANT|IGNORE)\b")
_AT_ANY_TIME = re.compile(r"(?i)\bDO[ \t]+(\$(?:TOOL|BASE|IPO_MODE|LOAD)\b)")
_BLOCK = re.compile(
    r"(?im)^[ \t]*(?:(?P<open>IF\b[^\r\n]*\bTHEN\b|SWITCH\b)|(?P<loop>(?:FOR|WHILE|LOOP|REPEAT)\b)"
    r"|(?P<branch>(?:ELSE|CASE|DEFAULT)\b)|(?P<close>(?:ENDIF|ENDSWITCH|ENDFOR|ENDWHILE|ENDLOOP|UNTIL)\b)"
    r"|(?:GLOBAL[ \t]+)?DEF(?:FCT[ \t]+\w+(?:\[[^\]]*\])?)?[ \t]+(?P<routine>\w+)[ \t]*\("
    r"|(?P<end>END(?:FCT)?\b)|(?P<label>\w+[ \t]*:(?!=))|(?P<call>\w+)[ \t]*\()"
)
CARTESIAN = ("X", "Y", "Z", "A", "B", "C")
_FIELDS = lambda keys: r"\s*,\s*".join(rf"{key}\s+(?P<{key}>{NUMBER})" for key in keys)
_PLAIN = re.compile(  # most points; the rest of the way is for all others
    r"(?i)\{\s*(?:\w+\s*:\s*)?(?:" + _FIELDS(CARTESIAN)
    + r"(?:\s*,\s*S\s+(?P<S>\d+)\s*,\s*T\s+(?P<T>\d+))?|" + _FIELDS([f"A{i}" for i in range(1, 7)]) + ")"
    + "".join(rf"(?:\s*,\s*E{i}\s+(?:0(?:\.0*)?|9E9))?" for i in range(1, 7)) + r"\s*\}")
_BITS = re.compile(r"\s*'\s*([BbHh])\s*([0-9A-Fa-f]+)\s*'\s*")
_GROUPS = {"X": slice(0, 6), "A1": slice(8, 14)}


@dataclass(eq=False)
class Aggregate:
    """`{X 1, Y 2}` of file `file`: field -> its text and place. plain: six coordinates, with S and T or
    without, or six axes, and no external axis in use."""

    file: int
    start: int
    plain: re.Match | None
    given: dict[str, tuple[str, int]]

    @property
    def fields(self) -> dict[str, tuple[str, int]]:
        match = self.plain
        if match is None:
            return self.given
        return {key: (match[key], match.start(key)) for key in _PLAIN.groupindex if match[key] is not None}

    @property
    def is_axis(self) -> bool:
        return "A1" in self.given if self.plain is None else self.plain["A1"] is not None


class Declarations:
    """Of the files of one program; `warnings` grow as points are looked up."""

    def __init__(self, sources: tuple[SourceText, ...]):
        self.sources = sources
        self.texts = [source.without(r";[^\r\n]*", r'"[^"\r\n]*"') for source in sources]
        self.warnings: list[str] = []
        self.values: dict[
            str, list[tuple[int, int, Aggregate | None]]
        ] = {}  # NAME or NAME[i] -> (file, place, aggregate)
        self.assigned: list[list[re.Match]] = []  # of each file
        self.parts: dict[str, tuple[int, int]] = {}  # NAME of which a component is set -> (file, place)
        for index in range(len(sources)):
            self.declarations_of(index)

    def declarations_of(self, index: int) -> None:
        source, text = self.sources[index], self.texts[index]
        small = text.lower()  # words are looked for in it first: that is quick
        if match := "$abs_accur" in small and re.search(r"(?i)\$ABS_ACCUR(?![ \t]*=[ \t]*FALSE)", text):
            raise source.refuse(
                match.start(),
                "$ABS_ACCUR: the controller corrects this program by itself; it must not be corrected twice",
            )
        source.refuse_words(text, REASONS)
        if match := "ori_typ" in small and _KEPT.search(text):
            raise source.refuse(match.start(), f"the arm keeps its orientation and does not take that of a "
                                               f"point ({match[0]}); expected #VAR")
        if match := ("trigger" in small or "interrupt" in small) and _AT_ANY_TIME.search(text):
            raise source.refuse(match.start(1), f"what sets {match[1]} on the way of a motion, or at any "
                                                "time; expected it set between motions")
        self.assigned.append(source.at_lines(ASSIGNED, text))
        for match in self.assigned[index]:
            _, name, subscript, component = match.groups()
            key = name.upper() + re.sub(r"\s", "", subscript or "")
            if component:
                self.parts.setdefault(key, (index, match.start(2)))
                continue
            try:
                found = self.assigned_record(index, match)
            except InputError:  # other records than points; a point among them is refused where it is used
                found = None
            self.values.setdefault(key, []).append((index, match.start(2), found))
        for match in source.at_lines(_HEADS, text):
            for name, _, mode in (word.partition(":") for word in match[1].upper().split(",")):
                place = rf"(?im)^[ \t]*(?:DECL[ \t]+)?(?:E6)?(?:POS|AXIS|FRAME)[ \t]+{name.strip()}\b"
                if mode.strip() != "IN" and {name.strip()} & (self.parts.keys() | self.values.keys()) and (
                        re.search(place, text)):
                    raise source.refuse(match.start(), f"the routine sets {name.strip()}, which it is given; "
                                                       "expected points and frames that stay")

    def assigned_record(self, index: int, assigned: re.Match) -> Aggregate | None:
        """What is set to a name, where it is one record and nothing more: `{..}:{..}` is computed."""
        match = _ALONE.match(self.texts[index], assigned.end())
        return None if match is None else self.aggregate(index, match)

    def aggregate(self, index: int, match: re.Match) -> Aggregate:
        """Fields of `{TYPE: NAME VALUE, ...}`."""
        if plain := _PLAIN.fullmatch(self.texts[index], *match.span()):
            return Aggregate(index, match.start(), plain, {})
        inner, at = match[1], match.start(1)
        head = _HEAD.match(inner)
        if head:
            inner, at = inner[head.end() :], at + head.end()
        fields: dict[str, tuple[str, int]] = {}
        for part in inner.split(","):
            word = _FIELD.match(part)
            if word is None:
                raise self.sources[index].refuse(
                    at, f"found {part.strip()[:30]!r}; expected a field and its value"
                )
            key = word[1].upper()
            if key in fields:
                raise self.sources[index].refuse(at, f"{key} is given twice")
            fields[key] = (part[word.end() :], at + word.end())
            at += len(part) + 1
        return Aggregate(index, match.start(), None, fields)

    def number(self, aggregate: Aggregate, key: str) -> Number:
        text, place = aggregate.fields[key]
        return Number.read(self.sources[aggregate.file], text, place)

    def numbers(self, point: Aggregate, wanted: Sequence[str]) -> Numbers:
        """Those of a point."""
        source = self.sources[point.file]
        if point.plain is not None and len(wanted) == 6 and (wanted[0] == "A1") == point.is_axis:
            found = Numbers.groups(point.plain, _GROUPS[wanted[0]])
            if found.sound:
                return found
        self.complete(point, wanted)
        for key in () if wanted[0] == "A1" else (f"E{i}" for i in range(1, 7)):
            if key in point.fields and 0.0 < abs(self.number(point, key).value) < 9e9:
                raise source.refuse(point.fields[key][1],
                                    f"external axis {key} is in use; expected an arm that stands still")
        return Numbers.of([self.number(point, key) for key in wanted]).checked(source)

    def status_and_turn(self, point: Aggregate) -> list[Number | None]:
        if point.plain is not None and point.plain["T"] is None:
            return [None, None]
        return [self.whole(point, key) if key in point.fields else None for key in ("S", "T")]

    def whole(self, point: Aggregate, key: str) -> Number:
        """S or T, which may stand as bits, too: 'B010', 'H1F'."""
        text, place = point.fields[key]
        bits = _BITS.fullmatch(text)
        if bits is None:
            return self.number(point, key)
        try:
            value = int(bits[2], 2 if bits[1] in "Bb" else 16)
        except ValueError:
            raise self.sources[point.file].refuse(place, f"{key} is {text.strip()}; expected bits") from None
        return Number(float(value), place + text.index("'"), place + text.rindex("'") + 1)

    def complete(self, point: Aggregate, wanted: Sequence[str]) -> None:
        missing = [key for key in wanted if key not in point.fields]
        if missing:
            raise self.sources[point.file].refuse(
                point.start,
                f"{missing[0]} is missing: it would stay as it is when the arm comes there; expected all of "
                f"{', '.join(wanted)}",
            )

    def record(self, index: int, match: re.Match, group: int) -> Aggregate | None:
        """The plain record that the group of a match is, with blanks at most behind it: most motions."""
        text, start = self.texts[index], match.start(group)
        plain = _PLAIN.match(text, start, match.end(group)) if text[start : start + 1] == "{" else None
        if plain is None or plain.end() < match.end(group) and text[plain.end() : match.end(group)].strip():
            return None
        return Aggregate(index, start, plain, {})

    def point(self, index: int, text: str, place: int) -> tuple[str, Aggregate] | None:
        """Name and fields of a point that stands in a motion; None for one of the controller's own."""
        source, word = self.sources[index], text.strip()
        place += len(text) - len(text.lstrip())
        if word.startswith("{"):
            plain = _PLAIN.match(self.texts[index], place)
            if plain and plain.end() == place + len(word):
                return f"line {source.line(place)}", Aggregate(index, place, plain, {})
            match = AGGREGATE.fullmatch(word)
            if match is None:
                raise source.refuse(place, f"found {word[:40]!r}; expected one {{...}}")
            return f"line {source.line(place)}", self.aggregate(
                index, AGGREGATE.match(self.texts[index], place)
            )
        if not POINT_NAME.match(word):
            raise source.refuse(place, f"the point {word[:40]!r} is computed; expected a name or numbers")
        name, known = word.upper(), self.values.get(word.upper(), [])
        if not known and name in ELSEWHERE:
            self.warnings.append(f"{word} stands in the controller and stays as it is")
            return None
        if not known:
            data = source.path.with_suffix(".dat").name
            alone = f" {data}: give both files" if len(self.sources) == 1 else ""
            raise source.refuse(place, f"point {word} is not in "
                                       f"{' or '.join(s.path.name for s in self.sources)}; expected it in "
                                       f"the data list{alone}")
        if len(known) > 1:
            lines = ", ".join(
                f"{self.sources[f].path.name} line {self.sources[f].line(p)}" for f, p, _ in known
            )
            raise source.refuse(place, f"point {word} is given {len(known)} times ({lines}); expected once")
        if name in self.parts:
            file, where = self.parts[name]
            raise self.sources[file].refuse(
                where, f"a component of point {word} is set by the program; expected numbers alone"
            )
        file, where, found = known[0]
        if found is None:
            raise self.sources[file].refuse(where, f"point {word} is computed; expected numbers")
        return word, found


def arguments(text: str, place: int) -> list[tuple[str, int]]:
    """The arguments of a motion, split at commas outside braces; blending words behind the last are cut
    off."""
    if one := _ONE.fullmatch(text):
        return [(one[1], place + one.start(1))]
    parts, depth, start = [], 0, 0
    for match in _SPLITS.finditer(text):
        letter = match[0]
        if letter == ",":
            if depth == 0:
                parts.append((text[start : match.start()], place + start))
                start = match.end()
        else:
            depth += 1 if letter in "{(" else -1
    if depth == 0:
        parts.append((text[start:], place + start))
    return [(_without_words(part), at) for part, at in parts]


def _without_words(part: str) -> str:
    part, before = _WITH.sub("", part), None
    while before != part:
        before, part = part, _BLEND.sub("", part)
    return part


def blocks(source: SourceText, text: str) -> list[Step]:
    """Where the ways of a program part and meet, and calls."""
    steps = []
    for match in source.at_lines(_BLOCK, text):
        what = match.lastgroup
        data = {"branch": match[0].strip().upper() in ("ELSE", "DEFAULT"), "routine": match["routine"],
                "call": match["call"]}.get(what)
        steps.append(Step(match.start(), what, data.upper() if isinstance(data, str) else data))
    return steps
