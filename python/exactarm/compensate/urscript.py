"""URScript: movej, movel, movep, movec, servoj with `[q1, ..]` (rad) or `p[x, y, z, rx, ry, rz]` (m, rotation
vector).

Targets stand in the call, or as a literal in a variable that is set once. Poses are of the TCP that
`set_tcp(p[..])` sets, in the controller's base; `set_payload(kg, [x, y, z])` is the load. A pose is taken on
the branch nearest to the target before. The controller turns poses by its own calibrated frames: the robot
file must have them ([controller] chain = "calibrated"). Not read: what is computed (`pose_trans`, `pose_add`,
...), relative moves, blends.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from exactarm.compensate.angles import from_vector, to_vector
from exactarm.compensate.program import NUMBER, Edit, Motion, Number, Program, SourceText, Target, in_range
from exactarm.compensate.setting import Setting
from exactarm.robot import Placement

NAME, SUFFIXES = "URScript", (".script", ".urscript")
DECIMALS = 9  # m and rad: a nanometre
BLEND_M = 0.001  # at points in between, so that the arm does not stop there
KINDS = {"movej": "joint", "servoj": "joint", "movel": "linear", "movep": "linear", "movec": "circular"}
_MOVE = re.compile(r"\b(movej|movel|movep|movec|servoj)\s*\(")
_SET = re.compile(r"\b(set_tcp|set_payload|set_payload_cog|set_target_payload)\s*\(")
_ASSIGNED = re.compile(r"(?m)^[ \t]*(?:global[ \t]+|local[ \t]+)?([A-Za-z_]\w*)[ \t]*=(?!=)[ \t]*")
_LITERAL = re.compile(r"(p?)\s*\[([^\[\]]*)\]")


@dataclass(frozen=True)
class _Literal:
    is_pose: bool
    numbers: tuple[Number, ...]
    start: int


def read(sources: tuple[SourceText, ...], setting: Setting) -> Program:
    (source,) = sources
    text = source.without(r"#[^\r\n]*", r'"[^"\r\n]*"')
    n = setting.robot.axes
    assigned: dict[str, list[int]] = {}
    for match in _ASSIGNED.finditer(text):
        assigned.setdefault(match[1], []).append(match.end())
    targets: list[Target] = []
    motions: list[Motion] = []
    index: dict[tuple, int] = {}
    tool, load = _given_tool(setting), None

    def literal(place: int) -> _Literal | None:
        match = _LITERAL.match(text, place)
        if match is None:
            return None
        numbers, at = [], match.start(2)
        for part in match[2].split(","):
            numbers.append(Number.read(source, part, at))
            at += len(part) + 1
        expected = 6 if match[1] else n
        if len(numbers) != expected:
            raise source.refuse(place, f"{len(numbers)} numbers; expected {expected}")
        in_range(source, numbers)
        return _Literal(bool(match[1]), tuple(numbers), place)

    def argument(place: int) -> tuple[str, _Literal]:
        """Name and numbers of a target that stands at `place`."""
        place += len(text[place:]) - len(text[place:].lstrip())
        found = literal(place)
        if found is not None:
            return f"line {source.line(place)}", found
        word = re.compile(r"([A-Za-z_]\w*)\s*([,)])").match(text, place)
        if word is None:
            shown = re.split(r"[\r\n]", text[place : place + 40])[0]
            raise source.refuse(
                place, f"the target {shown!r} is computed; expected numbers, or a variable that holds them"
            )
        places = assigned.get(word[1], [])
        if len(places) != 1:
            times = "never" if not places else f"{len(places)} times"
            raise source.refuse(
                place, f"{word[1]} is set {times} in this program; expected once, with numbers"
            )
        found = literal(places[0])
        if found is None:
            raise source.refuse(places[0], f"{word[1]} is computed; expected numbers")
        return word[1], found

    def target(place: int) -> int:
        name, found = argument(place)
        key = (found.start, id(tool) if found.is_pose else 0, load)
        if key in index:
            return index[key]
        if any(other[0] == found.start for other in index):
            raise source.refuse(
                place, f"{name} is used with different tools or loads: no one number is right for all"
            )
        if found.is_pose:
            made = _pose(source, name, found, tool, load, setting)
        else:
            made = _joints(source, name, found, load, setting)
        targets.append(made)
        index[key] = len(targets) - 1
        return index[key]

    events = sorted([*_MOVE.finditer(text), *_SET.finditer(text)], key=lambda match: match.start())
    for match in events:
        if match[1] == "set_tcp":
            found = literal(match.end())
            if found is None or not found.is_pose:
                raise source.refuse(match.end(), "the tool is computed; expected set_tcp(p[...])")
            tool = placement([number.value for number in found.numbers]) if not _given_tool(setting) else tool
        elif match[1].startswith("set_"):
            load = _load(source, text, match)
        elif match[1] == "movec":
            via = target(match.end())
            motions.append(
                Motion("circular", target(_next_argument(text, match.end())), source.line(match.start()), via)
            )
        else:
            insert = _insertion(source, text, match, literal(match.end()))
            index_of = target(match.end())
            motions.append(Motion(KINDS[match[1]], index_of, source.line(match.start()), insert=insert))
    return Program(NAME, sources, tuple(targets), tuple(motions))


def _insertion(source: SourceText, text: str, match: re.Match, found: _Literal | None):
    """Points before a `movel(p[...], name=value, ...)` that has its line for itself; passed with a small
    blend."""
    if match[1] != "movel" or found is None or not found.is_pose:
        return None
    line = re.compile(
        r"(?m)^([ \t]*)movel\([ \t]*p\[[^\]]*\]((?:[ \t]*,[ \t]*\w+[ \t]*=[^,()\r\n]*)*)\)[ \t]*$"
    )
    start = max(text.rfind("\n", 0, match.start()), text.rfind("\r", 0, match.start())) + 1
    whole = line.match(text, start)
    if whole is None:
        return None
    options = re.sub(r"[ \t]*,[ \t]*r[ \t]*=[^,]*", "", whole[2].rstrip()) + f", r={BLEND_M}"
    end = re.search(r"\r\n|\n|\r", source.text)
    values = np.array([number.value for number in found.numbers])

    def insert(points):
        lines = []
        for _, tip in points:
            pose = ", ".join(
                f"{value:.{DECIMALS}f}" for value in [*tip.position, *to_vector(tip.rotation, values[3:])]
            )
            lines.append(f"{whole[1]}movel(p[{pose}]{options}){end[0]}")
        return Edit(0, start, start, "".join(lines).encode("latin-1"))

    return insert if end else None


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
    if match[1] == "set_payload_cog" or call is None:
        raise source.refuse(
            match.start(),
            f"{match[1]} without mass and centre; expected {match[1]}(kg, [x, y, z]), or --payload",
        )
    centre, at = [], call.start(2)
    for part in call[2].split(","):
        centre.append(Number.read(source, part, at).value)
    if len(centre) != 3:
        raise source.refuse(call.start(2), f"{len(centre)} numbers; expected the centre of the load, three")
    return float(call[1]), tuple(centre)


def _given_tool(setting: Setting) -> Placement | None:
    numbers = setting.tool("")
    return None if numbers is None else placement(numbers)


def placement(numbers) -> Placement:
    """Of a frame as the controller shows it."""
    return Placement(from_vector(np.array(numbers[3:6])), np.array(numbers[:3]))


def _joints(source: SourceText, name: str, found: _Literal, load, setting: Setting) -> Target:
    def encode(q, _):
        return [
            number.edit(source, 0, value, DECIMALS)
            for number, value in zip(found.numbers, setting.reported(q))
        ]

    q = setting.joints([number.value for number in found.numbers])
    return Target(name, 0, source.line(found.start), encode, joints=q, load=load)


def _pose(
    source: SourceText, name: str, found: _Literal, tool: Placement | None, load, setting: Setting
) -> Target:
    values = np.array([number.value for number in found.numbers])

    def encode(_, tip):
        new = [*tip.position, *to_vector(tip.rotation, values[3:])]
        return [number.edit(source, 0, value, DECIMALS) for number, value in zip(found.numbers, new)]

    refusal = ""
    if setting.robot.controller.chain != "calibrated":
        refusal = (
            "a pose that the controller turns into joint angles by frames of its own calibration, which are "
            "not on record: "
            'put them into the robot file ([controller] chain = "calibrated"), or write the program with '
            'joint targets'
        )
    elif tool is None:
        refusal = (
            "a pose with an unknown tool: expected set_tcp(p[...]) before it, or --tool x,y,z,rx,ry,rz (m, "
            "rad)"
        )
    return Target(
        name,
        0,
        source.line(found.start),
        encode,
        pose=placement(values),
        tool=tool or Placement(),
        load=load,
        refusal=refusal,
    )
