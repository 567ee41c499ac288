"""URScript: movej, movel, movep, movec, servoj with `[q1, ..]` (rad) or `p[x, y, z, rx, ry, rz]` (m, rotation
vector).

Targets stand in the call, or as a literal in a variable that is set once (a frame of `pose_trans`: also more
than once, where the way through the program says which numbers it has); `get_inverse_kin(pose, qnear=q)` of
such literals is the pose, on the branch of q, which stays; `pose_trans(frame, pose)` of literals is the pose
in a frame, which stays. Poses are of the TCP that
`set_tcp(p[..])` sets, in the controller's base; `set_payload(kg, [x, y, z])` is the load. A pose is taken on
the branch nearest to the target before. The controller turns poses by its own calibrated frames: the robot
file must have them ([controller] chain = "calibrated"). Not read: what else is computed (`pose_add`, ...),
relative moves, blends. What moves targets (REASONS) is refused, and so is a tool or load that hangs on
the way through the program (ways.py).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import NamedTuple

import numpy as np

from exactarm.compensate.angles import from_vector, to_vector
from exactarm.compensate.flange_poses import Poses
from exactarm.compensate.program import (
    HERE,
    NUMBER,
    Edit,
    Motion,
    Notation,
    Numbers,
    Program,
    SourceText,
    Target,
)
from exactarm.compensate.setting import Setting
from exactarm.compensate.urscript_ways import blocks, frames_of, refuse_threads
from exactarm.compensate.ways import UNCERTAIN, Step, goes_on, unread, walk
from exactarm.robot.mdh_frames import compose
from exactarm.robot.robot import Placement

NAME, SUFFIXES = "URScript", (".script", ".urscript")
DECIMALS = 9  # m and rad: a nanometre
DIGITS = (DECIMALS,) * 6
BLEND_M = 0.001  # at points in between, so that the arm does not stop there
KINDS = {"movej": "joint", "servoj": "joint", "movel": "linear", "movep": "linear", "movec": "circular"}
_MOVE = re.compile(r"([ms](?<!\w.)(?:(?<=m)ove[jlpc]|(?<=s)ervoj))\s*\(")  # a letter first: quick
_SET = re.compile(r"(s(?<!\w.)et_(?:tcp|payload|payload_mass|payload_cog|target_payload))\s*\(")
_ASSIGNED = re.compile(
    r"(?m)^[ \t]*(?:global[ \t]+|local[ \t]+)?([A-Za-z_]\w*)[ \t]*(?:\[[^\]\r\n]*\][ \t]*)*=(?!=)[ \t]*"
)
_ARGUMENTS = re.compile(r"(?m)^[ \t]*(?:def|thread)[ \t]+\w+[ \t]*\(([^)]*)\)")
MOVED = "moves the targets that follow; expected targets as they are"
REASONS = {"set_base": MOVED, "path_offset_enable": MOVED, "path_offset_set": MOVED,
           "track_conveyor_linear": MOVED, "track_conveyor_circular": MOVED}
_CROWDED = re.compile(  # a block whose statements stand in the line of its head
    r"[ \t]*(?:if|elif|else|while|for|switch|case|default|def|thread|sec)\b[^\r\n]*:[ \t]*[^\s:]")
UNREAD = ("servoc", "speedj", "speedl", "optimovej", "optimovel", "force_mode", "conveyor_pulse_decode")
_UNREAD = re.compile(rf"\b({'|'.join(UNREAD)})[ \t]*\(")
_LITERAL = re.compile(r"(p?)\s*\[([^\[\]]*)\]")
_ALONE = re.compile(
    r"(?m)^([ \t]*)movel\([ \t]*p\[[^\]]*\]((?:[ \t]*,[ \t]*[avr][ \t]*=[^,()\r\n]*)*)\)[ \t]*$"
)
_SILENT = re.compile(  # calls that neither move the arm nor lead elsewhere
    r"[ \t]*(?:sleep|textmsg|set_\w+|write_output_\w+|sync)[ \t]*\([^()]*\)[ \t]*$"
    r"|[ \t]*\$|[ \t]*(?:global[ \t]+|local[ \t]+)?\w+[ \t]*=[ \t]*p?\[[^()]*$")
_NAMED = re.compile(r"([A-Za-z_]\w*)\s*([,)])")
_BLANK = re.compile(r"\s*(?:(?:q|pose)\s*=(?!=)\s*)?")
_INVERSE = re.compile(r"get_inverse_kin\s*\(\s*")
_NEAR = re.compile(r"\s*,\s*(?:qnear\s*=\s*)?")
_CLOSED = re.compile(r"\s*\)\s*([,)])")
_PRODUCT = re.compile(r"pose_trans\s*\(\s*")
_SIX = re.compile(  # most targets; the rest of the way is for all others
    r"\s*(p?)\s*\[" + ",".join([rf"\s*({NUMBER})\s*"] * 6) + r"\](?=[ \t]*(?:[,)\]\r\n]|$))")
_BRACKETS = re.compile(r"[()\[\]]")
_BEHIND = re.compile(r"[ \t]*(?:[,)\]\r\n]|$)")  # what may follow numbers that nothing is done with


class _Literal(NamedTuple):
    """frames: literals, from the base on, in whose product it stands (pose_trans)."""

    is_pose: bool
    numbers: Sequence[float]
    places: Sequence[tuple[int, int]]
    start: int
    end: int
    frames: tuple[_Literal, ...] = ()

    @property
    def base(self) -> Placement:
        return reduce(compose, (placement(frame.numbers) for frame in self.frames), HERE)


class _Computed(Exception):
    """A target that is no numbers of its own: where it stands, its name, and what was expected."""


def read(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    (source,) = sources
    text = source.without(r"#[^\r\n]*", r'"[^"\r\n]*"')
    source.refuse_words(text, REASONS)
    for match in source.at_lines(_CROWDED, text):
        raise source.refuse(match.start(), "statements behind a colon; expected each on a line of its own")
    n = setting.robot.axes
    assigned: dict[str, list[int]] = {}
    assignments = source.at_lines(_ASSIGNED, text)
    for match in assignments:
        assigned.setdefault(match[1], []).append(match.end())
    given = source.at_lines(_ARGUMENTS, text)
    for match in given:  # a name of their own, whatever stands outside
        for word in re.finditer(r"[A-Za-z_]\w*", match[1]):
            assigned.setdefault(word[0], []).append(match.start(1) + word.end())
    targets: list[Target] = []
    motions: list[Motion] = []
    index: dict[tuple, int] = {}
    begun: set[int] = set()
    framed: dict[int, tuple[int, ...]] = {}  # target -> where its frames stand
    close: list[str] = []  # names of frames, and of angles that choose a branch
    tool, load = _given_tool(setting), None
    changing = frames_of(text, assignments, given)

    def literal(place: int) -> _Literal | None:
        match = _LITERAL.match(text, place)
        if match is None:
            return None
        numbers = Numbers.listed(source, text, *match.span(2))
        expected = 6 if match[1] else n
        if len(numbers.values) != expected:
            raise source.refuse(place, f"{len(numbers.values)} numbers; expected {expected}")
        numbers.checked(source)
        if not _BEHIND.match(text, match.end()):
            raise source.refuse(match.end(), "numbers that are calculated with; expected numbers alone")
        return _Literal(bool(match[1]), *numbers, place, match.end())

    def argument(place: int) -> tuple[str, _Literal, int]:
        """Name and numbers of a target that stands at `place`, and where it ends."""
        place = _BLANK.match(text, place).end()
        if call := _PRODUCT.match(text, place):
            word, frame, end = set_before(call.end()) or argument(call.end())
            close.append(word)
            if frame.is_pose and (comma := _NEAR.match(text, end)):
                name, found, end = argument(comma.end())
                if found.is_pose and (closed := _CLOSED.match(text, end)):
                    frames = (*frame.frames, frame._replace(frames=()), *found.frames)
                    return name, found._replace(frames=frames), closed.start(1)
        found = literal(place)
        if found is not None:
            return f"line {source.line(place)}", found, found.end
        word = _NAMED.match(text, place)
        if word is None:
            shown = re.split(r"[\r\n]", text[place : place + 40])[0]
            raise _Computed(place, shown, "the target is computed; expected numbers, or a variable "
                                          "that holds them")
        places = assigned.get(word[1], [])
        if len(places) != 1:
            times = "never" if not places else f"{len(places)} times"
            raise _Computed(place, word[1], f"is set {times} in this program; expected once, with numbers")
        found = literal(places[0])
        if found is None:
            raise _Computed(places[0], word[1], "is computed; expected numbers")
        return word[1], found, word.end(1)

    def set_before(place: int) -> tuple[str, _Literal, int] | None:
        """Name and numbers of a frame that is set more than once: those that it has at this motion."""
        word = _NAMED.match(text, place)
        if word is None or word[1] not in changing:
            return None
        found = state[word[1]]
        if not isinstance(found, _Literal):
            raise _Computed(place, word[1], f"a frame that is {found or 'not set before this motion'}; "
                                            "expected one with numbers")
        return word[1], found, word.end(1)

    def inverse(place: int) -> tuple[str, _Literal, np.ndarray] | None:
        """Name and numbers of the pose in a call of get_inverse_kin at `place`, and the angles near by."""
        if (call := _INVERSE.match(text, place)) is None:
            return None
        name, found, end = argument(call.end())
        if comma := _NEAR.match(text, end):
            word, angles, end = argument(comma.end())
            close.append(word)
            if found.is_pose and not angles.is_pose and _CLOSED.match(text, end):
                return name, found, setting.joints(np.array(angles.numbers))
        raise _Computed(place, "get_inverse_kin", "the target is computed; expected numbers, or "
                                                  "get_inverse_kin(pose, qnear=angles) alone")

    def target(place: int) -> int:
        six = _SIX.match(text, place)
        numbers = Numbers.groups(six, slice(1, 7)) if six and (six[1] or n == 6) else None
        if numbers is not None and numbers.sound:
            found, near = _Literal(bool(six[1]), *numbers, six.start(1), six.end()), None
            name = f"line {source.line(found.start)}"
        else:
            try:
                solved = inverse(_BLANK.match(text, place).end())
                name, found, near = (*argument(place)[:2], None) if solved is None else solved
            except _Computed as error:
                where, name, why = error.args
                targets.append(Target.unread(name, 0, source.line(where), why))
                return len(targets) - 1
        frames = tuple(frame.start for frame in found.frames)
        key = (found.start, id(tool) if found.is_pose else 0, load, frames)
        if key in index:
            return index[key]
        if found.start in begun:
            raise source.refuse(
                place, f"{name} is used with different tools, loads or frames: no one number is right for all"
            )
        made = _pose if found.is_pose else _joints
        new = made(source, name, found, tool, load, setting)
        targets.append(new if near is None else new._replace(near=near))
        begun.add(found.start)
        index[key] = len(targets) - 1
        framed[index[key]] = frames
        return index[key]

    moves = [*_MOVE.finditer(text)]
    if any(word in text for word in UNREAD):  # that is quick
        moves += _UNREAD.finditer(text)
    steps = [Step(match.start(), "move", match) for match in moves]
    for match in _SET.finditer(text):
        if match[1] == "set_tcp":
            found = literal(match.end())
            if found is None or not found.is_pose:
                raise source.refuse(match.end(), "the tool is computed; expected set_tcp(p[...])")
            steps.append(Step(match.start(), "set",
                              ("tool", placement(found.numbers))))
        else:
            steps.append(Step(match.start(), "set", ("load", _load(source, text, match))))
    for match in assignments:
        if match[1] in changing:
            found = None if "[" in match[0] else literal(match.end())
            frame = found if found is not None and found.is_pose else UNCERTAIN
            steps.append(Step(match.start(), "set", (match[1], frame)))
    steps += blocks(source, text)
    refuse_threads(source, text, steps)
    spans = [match.span() for match in assignments]
    told, above = [], None
    for match, state in walk(steps, {"tool": tool, "load": None, **changing}):
        tool, load, line = state["tool"], state["load"], source.line(match.start())
        spans.append((match.start(), _end(text, match.end())))
        if match.re is _UNREAD:
            told.append(f"{source.path.name} line {line}: {match[1]} is not read; a target in it stays as it "
                        "is")
            motions.append(Motion("joint", None, line))
        elif match[1] == "movec":
            via, behind = target(match.end()), _next_argument(text, match.end())
            if _mode(text[_next_argument(text, behind) : spans[-1][1]]) != "0":
                raise source.refuse(match.start(), "movec with another mode than 0: the arm does not take "
                                                   "the orientation of its end; expected mode=0")
            motions.append(Motion("circular", target(behind), line, via))
        else:
            insert = None
            if match[1] == "movel":
                insert = partial(_insertion, source, text, match, literal, above)
            index_of = target(match.end())
            motions.append(Motion(KINDS[match[1]], index_of, line, insert=insert))
        above = (match.start(), spans[-1][1] + 1)
    for i in [i for i, frames in framed.items() if begun.intersection(frames)]:
        targets[i] = targets[i]._replace(refusal="a frame of its pose_trans is a target, too, whose numbers "
                                                 "change; expected another variable for the frame")
    points = [name for name, places in assigned.items() if (match := _LITERAL.match(text, places[0]))
              and match[2].count(",") == (5 if match[1] else n - 1)]
    told += unread(sources, [text], points, [*close, *(target.name for target in targets)], [spans])
    return Program(NAME, sources, tuple(targets), tuple(motions), _notation(setting), tuple(told))


def _notation(setting: Setting) -> Notation:
    return Notation(
        joints=setting.joints,
        reported=setting.reported,
        poses=lambda numbers: Poses(numbers[:, :3], from_vector(numbers[:, 3:])),
        shown=lambda tips, old: np.hstack([tips.position, to_vector(tips.rotation, old[:, 3:])]),
    )


def _end(text: str, place: int) -> int:
    """Where the bracket closes in which `place` is."""
    first = text.find(")", place)
    if first >= 0 and text.find("(", place, first) < 0:  # most calls: lists of numbers are closed before
        return first
    depth = 1
    for match in _BRACKETS.finditer(text, place):
        depth += 1 if match[0] in "([" else -1
        if depth == 0:
            return match.start()
    return len(text)


def _insertion(
    source: SourceText, text: str, match: re.Match, literal: Callable[[int], _Literal | None],
    above: tuple[int, int] | None, points: list,
) -> Edit | None:
    """Points before a `movel(p[...], name=value, ...)` that has its line for itself and follows the motion
    above; passed with a small blend."""
    found = literal(match.end())
    if found is None or not found.is_pose:
        return None
    start = source.line_start(match.start())
    whole = _ALONE.match(text, start)
    if whole is None or not goes_on(text, above, start, _SILENT):
        return None
    options = re.sub(r"[ \t]*,[ \t]*r[ \t]*=[^,]*", "", whole[2].rstrip()) + f", r={BLEND_M}"
    end = re.search(r"\r\n|\n|\r", source.text)
    near = np.array(found.numbers[3:])
    lines = []
    for _, tip in points:
        pose = ", ".join(
            f"{value:.{DECIMALS}f}" for value in [*tip.position, *to_vector(tip.rotation, near)]
        )
        lines.append(f"{whole[1]}movel(p[{pose}]{options}){end[0] if end else ''}")
    return Edit(0, start, start, "".join(lines).encode("latin-1")) if end else None


def _mode(options: str) -> str:
    """That of a movec with `a, v, r, mode`, by their order or by name."""
    given = [part.split("=") for part in options.split(",")]
    named = [part[1] for part in given if part[0].strip() == "mode" and len(part) == 2]
    return (named or [part[0] for part in given[3:4]] or ["0"])[0].strip()


def _next_argument(text: str, place: int) -> int:
    """Behind the first comma outside brackets."""
    depth = 0
    for i in range(place, len(text)):
        depth += text[i] in "[(" and 1 or -(text[i] in "])")
        if text[i] == "," and depth == 0:
            return i + 1
    return len(text)


def _load(source: SourceText, text: str, match: re.Match):
    call = re.compile(rf"\s*({NUMBER})\s*,\s*\[([^\]]*)\]").match(text, match.end())
    if match[1] in ("set_payload_cog", "set_payload_mass") or call is None:
        raise source.refuse(
            match.start(),
            f"{match[1]} without mass and centre; expected {match[1]}(kg, [x, y, z]), or --payload",
        )
    centre = Numbers.listed(source, text, *call.span(2)).values
    if len(centre) != 3:
        raise source.refuse(call.start(2), f"{len(centre)} numbers; expected the centre of the load, three")
    return float(call[1]), tuple(centre)


def _given_tool(setting: Setting) -> Placement | None:
    numbers = setting.tool("")
    return None if numbers is None else placement(numbers)


def placement(numbers) -> Placement:
    """Of a frame as the controller shows it."""
    return Placement(from_vector(np.array(numbers[3:6])), np.array(numbers[:3]))


def _joints(
    source: SourceText, name: str, found: _Literal, tool: Placement | None, load, setting: Setting
) -> Target:
    digits = (DECIMALS,) * len(found.numbers)
    return Target(name, 0, source.line(found.start), found.numbers, found.places, digits,
                  tool=tool if isinstance(tool, Placement) else HERE,
                  load=load if isinstance(load, tuple) else None, refusal=_unknown(load))


def _unknown(load) -> str:
    """Why the load is not known; empty where it is, or nothing sets it."""
    return f"its load is {UNCERTAIN}: expected one set_payload" if load == UNCERTAIN else ""


def _pose(
    source: SourceText, name: str, found: _Literal, tool: Placement | None, load, setting: Setting
) -> Target:
    refusal = ""
    if setting.robot.controller.chain != "calibrated":
        refusal = (
            "a pose that the controller turns into joint angles by frames of its own calibration, which are "
            "not on record: "
            'put them into the robot file ([controller] chain = "calibrated"), or write the program with '
            'joint targets'
        )
    elif tool == UNCERTAIN:
        refusal = f"its tool is {UNCERTAIN}: expected one, or --tool x,y,z,rx,ry,rz (m, rad)"
    elif tool is None:
        refusal = (
            "a pose with an unknown tool: expected set_tcp(p[...]) before it, or --tool x,y,z,rx,ry,rz (m, "
            "rad)"
        )
    return Target(name, 0, source.line(found.start), found.numbers, found.places, DIGITS, is_pose=True,
                  tool=tool if isinstance(tool, Placement) else HERE, base=found.base,
                  load=load if isinstance(load, tuple) else None, refusal=refusal or _unknown(load))
