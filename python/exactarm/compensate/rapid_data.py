"""What RAPID modules declare: targets, tools and work objects, as text with the place of every number.

    name -> its declarations        a literal `[[x, y, z], [...]]` -> nested lists of (text, place)

A module sees its own data, and those of other modules that are neither LOCAL nor declared in a routine; its
own come first. A name is refused where it is used, not where it stands: given twice, computed, an array, or
set by the program. Comments and strings are blank in `texts`; places are those of the files.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from exactarm.compensate.program import NUMBER, Number, SourceText

# Of what stands before a `:=`
_DATA = re.compile(
    r"(?i)\b(LOCAL\s+)?(?:CONST|PERS|VAR|TASK\s+PERS)\s+"
    r"(robtarget|jointtarget|tooldata|wobjdata|confdata|extjoint)\s+(\w+)\s*(\{[^}]*\})?\s*\Z"
)
_ASSIGNED = re.compile(r"(?<![\w\\.}])(\w+)[ \t]*(?:\{[^}]*\}|\.\w+)*\s*\Z")
# Of text in small letters; letters first and the edge of the word behind them: so the search is quick
_ROUTINE = re.compile(r"(?:proc|func|trap)\b(?:(?<=\b(end)....)|(?<=\b....))")
_WORD = re.compile(r"[A-Za-z_]\w*")
_NAME = re.compile(r"\s*\w+\s*")
_WHOLE = re.compile(r"\w+")
_BLANK = re.compile(r"\s*")
_LIST = lambda count: r"\[" + ",".join([rf"\s*({NUMBER})\s*"] * count) + r"\]"
ROBTARGET = re.compile(r"\[\s*" + r"\s*,\s*".join(map(_LIST, (3, 4, 4, 6))) + r"\s*\]")
_LISTS = ((0, 3), (3, 7), (7, 11), (11, 17))  # of its numbers
_SPLITS = re.compile(r"[\[({\])},\\]")
_MARKS = re.compile(r"[\[\],;]")
_ARGUMENTS = re.compile(r"(?<!\w)(?:proc|func\s+\w+)\s+\w+\s*\(([^)]*)\)")
_LENT = re.compile(r"\b(?:inout|pers|var)\s+(?:robtarget|jointtarget|tooldata|wobjdata)\s+(\w+)")
_ARGUMENT = re.compile(r"(?i)\b(?:robtarget|jointtarget|tooldata|wobjdata)\s+(\w+)")

_MOVED = "moves the targets that follow; expected targets as they are"
_CARRIED = "the work object moves with a conveyor; expected one that stands still"
REASONS = {"pdispon": _MOVED, "pdispset": _MOVED, "eoffson": _MOVED, "eoffsset": _MOVED,
           "waitwobj": _CARRIED, "dropwobj": _CARRIED,
           "lockaxis4": "axis 4 stays where it is, and the orientation of a target is not reached; expected "
                        "SingArea without it"}
_CONF = re.compile(r"\bconf([jl])\s*\\\s*(on|off)\b")
SENSED = {"corr", "track"}  # switches of motions that a sensor guides


class Literal(NamedTuple):
    """A bracketed aggregate: nested lists of (text, place). plain: a robtarget whose numbers
    are such."""

    start: int
    end: int
    nested: list
    plain: re.Match | None = None

    @property
    def parts(self) -> list:
        if self.plain is None:
            return self.nested
        return [[(self.plain[k + 1], self.plain.start(k + 1)) for k in range(a, b)] for a, b in _LISTS]


class Given(NamedTuple):
    """Arguments of a motion without a switch, with their places: the first one (None: none), and the others,
    whose places count from `shift`."""

    first: tuple[str, int] | None
    others: list[tuple[str, int]]
    shift: int

    @property
    def all(self) -> list[tuple[str, int]]:
        others = [(value, place + self.shift) for value, place in self.others]
        return others if self.first is None else [self.first, *others]


class Datum(NamedTuple):
    kind: str
    literal: Literal | None  # None: computed, or an array
    file: int
    place: int
    own: bool  # LOCAL, or of a routine: other modules do not see it


class Declarations:
    """Of the modules of one program."""

    def __init__(self, sources: tuple[SourceText, ...]):
        self.sources = sources
        self.texts = [source.without(r'"[^"\r\n]*"', r"![^\r\n]*") for source in sources]
        self.data: dict[str, list[Datum]] = {}
        self.tails: dict[str, tuple[dict[str, str], list[tuple[str, int]]]] = {}
        self.assigned: dict[str, dict[int, int]] = {}  # name -> file -> the first place
        for index, text in enumerate(self.texts):
            small = text.lower()
            routines = list(_ROUTINE.finditer(small))
            starts = [match.start() for match in routines]
            for begin, place in _set(text):
                if match := _DATA.search(text, begin, place):
                    k = bisect_right(starts, match.start())
                    own = bool(match[1]) or k > 0 and routines[k - 1][1] is None
                    literal = None if match[4] else self.literal(index, place + 2)
                    self.data.setdefault(match[3].lower(), []).append(
                        Datum(match[2].lower(), literal, index, match.start(3), own)
                    )
                elif match := _ASSIGNED.search(text, begin, place):
                    self._assign(match[1], index, match.start(1))
            changed = {name for name, places in self.assigned.items() if index in places}
            for match in filter(None, (_ARGUMENTS.match(small, begin) for begin in starts)):
                if lent := changed.intersection(_LENT.findall(match[1])):
                    raise self.sources[index].refuse(
                        match.start(), f"the routine sets {min(lent)}, which it is given; expected data that "
                                       "stay as they are")
                for argument in _ARGUMENT.finditer(match[1]):
                    self._assign(argument[1], index, match.start())

    def unmonitored(self, index: int) -> list[str]:
        """Kinds of motions for which the module switches the check of configurations off: a controller then
        takes the branch nearest to where the arm is, whatever cf1 to cfx say."""
        small = self.texts[index].lower()  # the word is looked for in it first: that is quick
        found = {(match[1], match[2]): match for match in _CONF.finditer(small)} if "conf" in small else {}
        if {("j", "on"), ("j", "off")} <= found.keys():
            raise self.sources[index].refuse(
                found["j", "off"].start(), "the check of configurations of MoveJ is switched on and off; "
                                           "expected one of both")
        kinds = {"j": ("joint",), "l": ("linear", "circular")}
        return [kind for letter, switch in found if switch == "off" for kind in kinds[letter]]

    def arguments(
        self, text: str, begin: int, end: int, whole: re.Match | None
    ) -> tuple[Mapping[str, str], Given, str]:
        """Switches (small letters) of a motion, its other arguments, and what stands behind the first one:
        the same in most motions, and taken apart once ("": not so here)."""
        comma = text.find(",", whole.end() if whole else begin, end)
        head = "" if comma < 0 else text[begin:comma]
        if head and (text[whole.end() : comma].isspace() or whole.end() == comma if whole
                     else _NAME.fullmatch(head)):
            tail = text[comma:end]
            if tail not in self.tails:
                self.tails[tail] = _sorted(arguments(tail, 0, len(tail), None))
            switches, others = self.tails[tail]
            return switches, Given((head, begin), others, comma), tail
        switches, plain = _sorted(arguments(text, begin, end, whole))
        return switches, Given(plain[0] if plain else None, plain[1:], 0), ""

    def _assign(self, name: str, index: int, place: int) -> None:
        self.assigned.setdefault(name.lower(), {}).setdefault(index, place)

    def seen(self, index: int, name: str) -> list[Datum]:
        """The declarations that a name means in the module `index`."""
        found = self.data.get(name.lower(), [])
        return ([datum for datum in found if datum.file == index]
                or [datum for datum in found if not datum.own])

    def literal(self, index: int, place: int) -> Literal | None:
        """The aggregate that starts at `place`; None where none does."""
        text = self.texts[index]
        place = _BLANK.match(text, place).end()
        if text[place : place + 1] != "[":
            return None
        if plain := ROBTARGET.match(text, place):  # most literals; the rest of the way is for all others
            return Literal(place, plain.end(), [], plain)
        stack: list[list] = [[]]
        start = place + 1
        for match in _MARKS.finditer(text, place):
            i, letter = match.start(), match[0]
            if letter == "[":
                stack.append([])
                start = i + 1
            elif letter in ",]":
                behind_list = bool(stack[-1]) and isinstance(stack[-1][-1], list)
                if text[start:i].strip() or (letter == "," and not behind_list):
                    stack[-1].append((text[start:i], start))
                start = i + 1
                if letter == "]":
                    done = stack.pop()
                    stack[-1].append(done)
                    if len(stack) == 1:
                        return Literal(place, i + 1, done)
            else:
                break
        raise self.sources[index].refuse(place, "a bracket is not closed; expected ]")

    def numbers(
        self, index: int, literal: Literal, where: int, count: int | None, what: str
    ) -> list[Number]:
        """Those of the list at `where` of an aggregate."""
        source = self.sources[index]
        parts = literal.parts[where] if where < len(literal.parts) else None
        if not isinstance(parts, list) or not all(isinstance(part, tuple) for part in parts):
            raise source.refuse(literal.start, f"{what} is missing; expected it as list {where + 1}")
        if count is not None and len(parts) != count:
            raise source.refuse(literal.start, f"{what}: {len(parts)} numbers; expected {count}")
        return [Number.read(source, *part) for part in parts]

    def load(self, datum: Datum, parts) -> tuple[float, tuple[float, ...]] | None:
        """kg and its centre, m; -1 kg: not known."""
        source = self.sources[datum.file]
        if not isinstance(parts, list) or not parts or not isinstance(parts[0], tuple):
            raise source.refuse(datum.literal.start, "the mass of the load is missing; expected it in list 3")
        mass = Number.read(source, *parts[0]).value
        inner = Literal(datum.literal.start, datum.literal.end, parts)
        centre = self.numbers(datum.file, inner, 1, 3, "the centre of the load")
        return (mass, tuple(1e-3 * number.value for number in centre)) if mass > 0.0 else None

    def datum(self, index: int, name: str, place: int, kinds: tuple[str, ...]) -> Datum:
        """The one declaration of a name, with numbers."""
        found = self.seen(index, name)
        if len(found) != 1:
            hidden = "LOCAL, or of a routine, in another of these files"
            none = hidden if name.lower() in self.data else "not in these files"
            times = none if not found else f"given {len(found)} times"
            raise self.sources[index].refuse(place, f"{name} is {times}; expected it once")
        datum = found[0]
        if datum.kind not in kinds:
            raise self.sources[index].refuse(
                place, f"{name} is a {datum.kind}; expected a {' or '.join(kinds)}"
            )
        if datum.literal is None:
            raise self.sources[datum.file].refuse(
                datum.place, f"{name} is computed, or an array; expected numbers"
            )
        for file, where in self.assigned.get(name.lower(), {}).items():
            if datum in self.seen(file, name):
                raise self.sources[file].refuse(
                    where, f"{name} is set by the program, or an argument; expected numbers alone")
        return datum


def linked(sources: Sequence[SourceText]) -> list[list[int]]:
    """The modules in groups: together stand those of which one uses data that another one declares."""
    modules = Declarations(tuple(sources))
    group = list(range(len(sources)))
    for index, text in enumerate(modules.texts):
        for name in {word.lower() for word in _WORD.findall(text)} & modules.data.keys():
            for datum in modules.seen(index, name):
                old, new = group[datum.file], group[index]
                group = [new if each == old else each for each in group]
    return [[i for i, each in enumerate(group) if each == one] for one in dict.fromkeys(group)]


def _set(text: str) -> Iterator[tuple[int, int]]:
    """Each `:=`, and where its statement begins."""
    begin, place = 0, text.find(":=")
    while place >= 0:
        begin = max(begin, text.rfind(";", begin, place) + 1)
        yield begin, place
        begin, place = place + 2, text.find(":=", place + 2)


def arguments(text: str, begin: int, end: int, whole: re.Match | None) -> list[tuple[str, str, int]]:
    """(switch or "", value, place) of each argument, split at commas and backslashes outside brackets; whole:
    the target at the begin."""
    found, depth, start, switch = [], 0, begin, False

    def close(end: int) -> None:
        part = text[start:end]
        if switch:
            name, _, value = part.partition(":=")
            found.append((name.strip(), value.strip(), start))
        elif part.strip():
            found.append(("", part, start))

    for mark in _SPLITS.finditer(text, whole.end() if whole else begin, end):
        letter = mark[0]
        depth += (letter in "[({") - (letter in "])}")
        if depth == 0 and letter in ",\\":
            close(mark.start())
            start, switch = mark.end(), letter == "\\"
    if depth == 0:
        close(end)
    return found


def _sorted(given: list[tuple[str, str, int]]) -> tuple[dict[str, str], list[tuple[str, int]]]:
    """Switches, and arguments without one."""
    return ({name.lower(): value for name, value, _ in given if name},
            [(value, place) for name, value, place in given if not name])


def tool_of(plain: list[tuple[str, int]], where: int) -> str:
    """The last argument without a switch: target(s), speed, zone, tool; behind that of MoveLDO, a signal."""
    word = plain[where][0].strip() if where < len(plain) else ""
    return word if _WHOLE.fullmatch(word) else ""
