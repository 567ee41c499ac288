"""Fanuc TP as text, `.ls`: J, L and C motions to the positions of the section /POS.

    P[i]{ GP1: UF : u, UT : t, CONFIG : 'N U T, 0, 0, 0', X = .. mm, ..., W = .. deg, P, R }     R = Rz(R)
    Ry(P) Rx(W) P[i]{ GP1: UF : u, UT : t, J1= .. deg, ... }
User frames and tools are not in the file: --base u=X,Y,Z,W,P,R, --tool t=...; number 0 is none. What CONFIG
means for an arm is not certain: poses follow the branch of the target before (--start for the first), and
CONFIG must stay the same. Whether J3 counts from the horizon is not certain either: the robot file has to say
it ([controller] coupling = [[3, 2, 1.0]], or [] for no coupling). Numbers have the decimals of their
position, three at least: whether a controller reads more is not known. Groups other than 1 stay as they are.
Refused: position registers, offsets, incremental motions, remote tools, frames and positions that the program
sets, UFRAME_NUM and UTOOL_NUM other than those of a position, PAYLOAD without --payload, extended axes.
"""

from __future__ import annotations

import re
from functools import partial

import numpy as np

from exactarm.compensate.angles import from_zyx, to_zyx
from exactarm.compensate.fanuc_points import Listing
from exactarm.compensate.flange_poses import Poses
from exactarm.compensate.program import (
    HERE,
    NUMBER,
    THREES,
    Motion,
    Notation,
    Number,
    Numbers,
    Program,
    SourceText,
    Target,
)
from exactarm.compensate.setting import Setting
from exactarm.errors import InputError
from exactarm.files.whole_number import whole_number
from exactarm.robot.robot import Placement

NAME, SUFFIXES = "Fanuc TP", (".ls",)
_MOTION = re.compile(r"(?m)^[ \t]*\d*[ \t]*:[ \t]*([JLCAS])[ \t]+(P|PR)\[([^\]]*)\]([^;]*);?")
_SECTION = re.compile(r"(?m)^[ \t]*/(MN|POS)\b")
_POSITION = re.compile(r"P\[\s*(\d+)\s*(?::[^\]]*)?\]\s*\{(.*?)\}\s*;", re.S)
_GROUP = re.compile(r"GP(\d+)\s*:")
_FRAME = {key: re.compile(rf"\b{key}\s*:\s*(\w+)") for key in ("UF", "UT")}
_CONFIG = re.compile(r"CONFIG\s*:\s*'([^']*)'")
_QUOTED = re.compile(r"'[^']*'")
FORBIDDEN = ("offset", "inc", "rtcp", "coord", "search")
_FORBIDDEN = re.compile(r"(?i)\b(Offset|Tool_Offset|INC|RTCP|VOFFSET|COORD|Search(?=[ \t]*\[))\b")
_INDEX = r"\[(?:[^\[\]\r\n]|\[[^\]\r\n]*\])*\]"  # of a number, or of a register: [R[1]]
_SET = re.compile(rf"(?:\b(?:UTOOL|UFRAME|P)|\$MNU(?:TOOL|FRAME)){_INDEX}[ \t]*=")
_MOVED = re.compile(  # what moves the targets that follow, or goes to one in a way that is not read
    r"(?m)^[ \t]*\d*[ \t]*:[ \t]*((?:Touch|MP)[ \t]+Offset\b|Track\b|[JLCAS][ \t]+(?!PR?\[)[^ \t;=\[]+)")
_TRACKED = re.compile(r"LINE_TRACK_SCHEDULE_NUMBER[ \t]*:[ \t]*0*[1-9]")
_ATTRIBUTES = re.compile(r"(?m)^/ATTR\b[^/]*")  # words of a listing are of one language, all of it
_ACTIVE = re.compile(  # what sets the frames that are active, and where ways part and meet
    r"(?m)^[ \t]*\d*[ \t]*:[ \t]*(?:(?P<which>UFRAME|UTOOL)_NUM[ \t]*=[ \t]*(?P<number>[^;\r\n]*?)[ \t]*;"
    r"|(?P<way>LBL\[|CALL\b|IF\b|ELSE|ENDIF|SELECT\b|FOR\b|ENDFOR|JMP\b|RUN\b|=))")
_FIELD = re.compile(r"\b(X|Y|Z|W|P|R|J\d|E\d)\s*=\s*([-+]?\d+\.?\d*(?=[ \tmd])|[^,\s]+?)"
                    r"\s*(mm|deg)?(?=[\s,]|$)")
CARTESIAN = ("X", "Y", "Z", "W", "P", "R")
LEAST_DECIMALS = 3  # as controllers write them
_GIVEN = lambda keys, unit: r"\s*,\s*".join(rf"{key}\s*=\s*({NUMBER})\s*{unit}" for key in keys)
_SIX = (slice(3, 9), slice(9, 15))  # groups of it: of a pose, of joint angles
_PLAIN = re.compile(  # most positions; the rest of the way is for all others
    r"\s*GP1\s*:\s*UF\s*:\s*(\w+)\s*,\s*UT\s*:\s*(\w+)\s*,\s*(?:CONFIG\s*:\s*'([^']*)'\s*,\s*"
    + _GIVEN(CARTESIAN[:3], "mm") + r"\s*,\s*" + _GIVEN(CARTESIAN[3:], "deg") + "|"
    + _GIVEN([f"J{i}" for i in range(1, 7)], "deg") + r")\s*")


def placement(numbers) -> Placement:
    """Of a frame: X, Y, Z in mm, W, P, R in deg."""
    return Placement(from_zyx(np.radians(numbers[5:2:-1])), 1e-3 * np.array(numbers[:3], float))


def read(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    (source,) = sources
    text = source.text
    if "!" in text or "--eg:" in text:
        text = source.without(r"(?m)^[ \t]*\d*[ \t]*:[ \t]*(?:!|--eg:)[^\r\n]*")
    if setting.robot.controller.coupling is None:
        raise InputError(
            "Fanuc may count J3 from the horizon or from link 2, and the file does not say; put it into the "
            "robot file: "
            "[controller] coupling = [[3, 2, 1.0]] (q_3 = J3 + J2), or coupling = [] where J3 is q_3",
            file=source.path,
        )
    sections = {match[1]: match.start() for match in reversed(source.at_lines(_SECTION, text))}  # the first
    start, end = sections.get("MN", -1), sections.get("POS", -1)
    if min(start, end) < 0:
        raise source.refuse(0, "no sections /MN and /POS; expected a TP program as text")
    _require_english(source, text[:start])
    if match := _TRACKED.search(text):
        raise source.refuse(match.start(), "the arm follows a conveyor (line tracking); expected schedule 0")
    if match := _MOVED.search(text, start, end):
        raise source.refuse(match.start(), f"{' '.join(match[1].split())} moves targets that follow, or "
                                           "is no motion that is read; expected J, L or C to P[number]")
    positions: dict[int | None, list[re.Match]] = {}
    for match in _POSITION.finditer(text, end):
        positions.setdefault(whole_number(match[1]), []).append(match)
    targets: list[Target] = []
    motions: list[Motion] = []
    index: dict[int, int] = {}
    cells = _Cells(setting)

    def unread(name: str, place: int, why: str) -> int:
        targets.append(Target.unread(name, 0, source.line(place), why))
        return len(targets) - 1

    def target(kind: str, word: str, place: int) -> tuple[int, re.Match | None]:
        """Its index, and where it stands, if that is in /POS."""
        i = whole_number(word.split(":")[0])
        if kind == "PR" or i is None:
            return unread(f"{kind}[{word}]", place, "the target is in a register or computed; expected a "
                                                    "position P[number]"), None
        found = positions.get(i, [])
        if len(found) != 1:
            raise source.refuse(
                place, f"P[{i}] is {'not' if not found else f'{len(found)} times'} in /POS; expected it once"
            )
        if i not in index:
            targets.append(_target(source, i, found[0], setting, cells))
            index[i] = len(targets) - 1
        return index[i], found[0]

    if match := _SET.search(text, start, end):
        raise source.refuse(match.start(), f"the program sets {match[0].rstrip(' =')}; expected frames and "
                                           "positions that stay as they are")
    match = re.compile(r"\bPAYLOAD[ \t]*\[").search(text, start, end)
    if match and setting.load is None:
        raise source.refuse(match.start(), "PAYLOAD chooses a load of the controller; expected --payload")
    active: dict[str, str] = {}
    last = max((found[-1].end() for found in positions.values()), default=end)
    listing, above = Listing(source, text, start, end, last, _notation(setting)), None
    events = [*_MOTION.finditer(text, start, end), *_ACTIVE.finditer(text, start, end)]
    small = text[start:end].lower()  # words are looked for in it first: that is quick
    forbidden = any(word in small for word in FORBIDDEN)
    for match in sorted(events, key=lambda match: match.start()):
        if match.re is _ACTIVE:
            if match["way"]:
                active = {}
            else:
                active[match["which"]] = match["number"]
            continue
        if word := forbidden and _FORBIDDEN.search(match[4]):
            named = f"{match[2]}[{match[3].strip()}]"
            motions.append(Motion("joint", unread(
                f"{named} {word[1]}", match.start(1),
                f"{word[1]}: the motion does not end where {named} says; expected it without"),
                source.line(match.start(1))))
            above = match
            continue
        first, position = target(match[2], match[3], match.start(1))
        line = source.line(match.start(1))
        insert = None
        if match[1] == "L" and position and _same_branch(targets, motions, first):
            insert = partial(listing.before, match, above, position, targets[first])
        above = match
        if active and position:
            _require_active(source, position, active, match.start(1))
        if match[1] in "AS":
            kind = "circular motion of the form A" if match[1] == "A" else "spline motion S"
            raise source.refuse(match.start(1), f"a {kind} takes several lines together; expected J, L or C")
        if match[1] == "C":
            second = re.compile(r"\s*:?\s*(P|PR)\[([^\]]*)\]([^;]*)").match(match[4])
            if second is None:
                raise source.refuse(match.start(1), "a circle without its end; expected a second position")
            end_of, _ = target(second[1], second[2], match.start(1))
            motions.append(Motion("circular", end_of, line, first))
        else:
            motions.append(Motion("joint" if match[1] == "J" else "linear", first, line, insert=insert))
    left = [f"P[{found[0][1][:9]}]" for number, found in positions.items() if number not in index]
    told = (f"no motion that is read goes to {', '.join(left)}: they stay as they are",) if left else ()
    return Program(NAME, sources, tuple(targets), tuple(motions), listing.notation, told,
                   numbered=listing.numbered)


def _notation(setting: Setting) -> Notation:
    def shown(tips: Poses, old: np.ndarray) -> np.ndarray:
        angles = to_zyx(tips.rotation, np.radians(old[:, 5:2:-1]))
        return np.hstack([1e3 * tips.position, np.degrees(angles[:, ::-1])])

    return Notation(
        joints=lambda numbers: setting.joints(np.radians(numbers)),
        reported=lambda q: np.degrees(setting.reported(q)),
        poses=lambda numbers: Poses(1e-3 * numbers[:, :3], from_zyx(np.radians(numbers[:, 5:2:-1]))),
        shown=shown,
        alike=((slice(None),), THREES),
    )


def _require_english(source: SourceText, head: str) -> None:
    """Controllers list programs in their own language, with their own words for frames, loads and offsets."""
    found = _ATTRIBUTES.search(head)
    words = set(re.findall(r"(?m)^[ \t]*(\S+)[ \t]*=", found[0])) if found else set()
    if found and words and not words & {"OWNER", "COMMENT", "PROG_SIZE", "DEFAULT_GROUP", "CREATE"}:
        raise source.refuse(found.start(), f"a listing in another language ({min(words)}); expected English")


def _same_branch(targets: list[Target], motions: list[Motion], last: int) -> bool:
    """Whether what CONFIG says of a target holds on the way to it; joint angles need none."""
    before = motions[-1].target if motions else None
    return not targets[last].is_pose or (
        before is not None and targets[before].configuration == targets[last].configuration)


def _require_active(source: SourceText, position: re.Match, active: dict[str, str], place: int) -> None:
    """The frames of a position are those that the program has chosen: else a controller stops, or takes the
    position in other frames."""
    groups = list(_GROUP.finditer(position[2]))
    first = next((k for k, group in enumerate(groups) if group[1] == "1"), 0)
    begin, end = (groups[first].end(), *(group.start() for group in groups[first + 1 : first + 2]), None)[:2]
    for key, which in (("UF", "UFRAME"), ("UT", "UTOOL")):
        found = _FRAME[key].search(position[2][begin:end])
        number = active.get(which, "")
        chosen = whole_number(number)
        if found and found[1].isdigit() and chosen is not None and chosen != whole_number(found[1]):
            raise source.refuse(place, f"P[{position[1]}] is of {key} {found[1]}, and {which}_NUM is "
                                       f"{number} "
                                       "here; expected the same")


def _target(source: SourceText, number: int, match: re.Match, setting: Setting, cells: _Cells) -> Target:
    name, line, n = f"P[{number}]", source.line(match.start()), setting.robot.axes
    plain = _PLAIN.fullmatch(match.string, *match.span(2))
    if plain and n == 6 and (found := Numbers.groups(plain, _SIX[plain[3] is None])).sound:
        frames, config, is_pose = plain.groups()[:2], plain[3], plain[3] is not None
    else:
        found, frames, config, is_pose = _fields(source, number, match, n)
    if not is_pose:
        tool = cells.of("UT", frames[1])[0] if frames[1] else HERE  # of a straight motion to it
        return Target(name, 0, line, *found, (LEAST_DECIMALS,) * n, tool=tool)
    base, tool, why = cells.both(*frames)
    return Target(
        name,
        0,
        line,
        *found,
        (LEAST_DECIMALS,) * 6,
        is_pose=True,
        tool=tool,
        base=base,
        configuration=" ".join(config.split()),
        refusal=why,
    )


def _fields(
    source: SourceText, number: int, match: re.Match, n: int
) -> tuple[Numbers, tuple[str, str], str, bool]:
    """Numbers, UF and UT, CONFIG, and whether it is a pose, of a position in any layout."""
    body, at = match[2], match.start(2)
    groups = list(_GROUP.finditer(body))
    first = [k for k, group in enumerate(groups) if group[1] == "1"]
    if len(first) != 1:
        raise source.refuse(match.start(), f"P[{number}] has {len(first)} groups GP1; expected one")
    start = groups[first[0]].end()
    end = groups[first[0] + 1].start() if first[0] + 1 < len(groups) else len(body)
    part = body[start:end]
    fields: dict[str, Number] = {}
    quoted = _QUOTED.sub(lambda m: " " * len(m[0]), part)
    for field in _FIELD.finditer(quoted):
        if field[1] in fields:
            raise source.refuse(at + start + field.start(), f"{field[1]} is given twice")
        if field[1][0] == "E":
            if Number.read(source, field[2], at + start + field.start(2)).value:
                raise source.refuse(at + start + field.start(),
                                    f"extended axis {field[1]} is in use; expected "
                                                                "an arm that stands still")
            continue
        unit = "mm" if field[1] in "XYZ" else "deg"
        if field[3] != unit:
            raise source.refuse(
                at + start + field.start(), f"{field[1]} in {field[3] or 'no unit'}; expected {unit}"
            )
        fields[field[1]] = Number.read(source, field[2], at + start + field.start(2))
    named = [_FRAME[key].search(part) for key in ("UF", "UT")]
    frames = tuple(found[1] if found else "" for found in named)
    if "J1" in fields:
        return _all(source, match, fields, [f"J{i}" for i in range(1, n + 1)]), frames, "", False
    numbers, config = _all(source, match, fields, CARTESIAN), _CONFIG.search(part)
    if config is None:
        raise source.refuse(match.start(), f"P[{number}] without CONFIG; expected CONFIG : '...'")
    return numbers, frames, config[1], True


class _Cells:
    """User frames and tools by their numbers, asked once for all positions in them."""

    def __init__(self, setting: Setting):
        self.setting = setting
        self.known: dict[tuple[str, str], tuple[Placement, str]] = {}
        self.pairs: dict[tuple[str, str], tuple[Placement, Placement, str]] = {}

    def both(self, user: str, tool: str) -> tuple[Placement, Placement, str]:
        """User frame and tool, and why they are not known."""
        if (user, tool) not in self.pairs:
            (base, why_base), (tip, why_tip) = self.of("UF", user), self.of("UT", tool)
            self.pairs[user, tool] = base, tip, " and ".join(filter(None, (why_base, why_tip)))
        return self.pairs[user, tool]

    def of(self, key: str, which: str) -> tuple[Placement, str]:
        """Of UF or UT; `HERE` where it is not known, and why."""
        if (key, which) not in self.known:
            option, given = ("base", self.setting.base) if key == "UF" else ("tool", self.setting.tool)
            frame = given(which)
            if which == "0":
                found = Placement(), ""
            elif frame is not None and len(frame) == 6:
                found = placement(frame), ""
            else:
                found = HERE, (f"unknown {key} {which or '(none)'}: give --{option} {which}=X,Y,Z,W,P,R "
                               "(mm, deg)")
            self.known[key, which] = found
        return self.known[key, which]


def _all(source: SourceText, match: re.Match, fields: dict[str, Number], wanted) -> Numbers:
    missing = [key for key in wanted if key not in fields]
    if missing:
        raise source.refuse(
            match.start(), f"P[{match[1]}]: {missing[0]} is missing; expected all of {', '.join(wanted)}"
        )
    return Numbers.of([fields[key] for key in wanted]).checked(source)

