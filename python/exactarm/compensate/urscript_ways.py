"""Where the ways of a URScript program part and meet, what its threads set, and the variables that stand for
frames and are set more than once.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from exactarm.compensate.program import SourceText
from exactarm.compensate.ways import Step, settings_of

_BLOCK = re.compile(
    r"(?m)^[ \t]*(?:(?P<open>(?:if|switch)\b)|(?P<loop>(?:while|for)\b)|"
    r"(?P<branch>(?:elif|else|case|default)\b)|(?P<close>end\b)|(?:def|thread|sec)[ \t]+(?P<routine>\w+))"
)
_CALL = re.compile(r"([A-Za-z_](?<!\w.)\w*)[ \t]*\(")
_THREAD = re.compile(r"(?m)^[ \t]*thread[ \t]+(\w+)")
_FRAME = re.compile(r"pose_trans\s*\(\s*([A-Za-z_]\w*)\s*,")


def blocks(source: SourceText, text: str) -> list[Step]:
    """Where the ways of a program part and meet, and calls; `end` closes whatever was opened last."""
    steps, begun, names = [], [], {}
    for match in source.at_lines(_BLOCK, text):
        what = match.lastgroup
        if what in ("open", "loop", "routine"):
            begun.append(what)
        elif what == "close" and begun and begun.pop() == "routine":
            what = "end"
        if what == "routine":
            names.setdefault(match[what], set()).add(match.start(what))
        word = match[0].split()[0].rstrip(":")
        data = {"branch": word in ("else", "default"), "routine": match["routine"]}
        steps.append(Step(match.start(), what, data.get(what)))
    steps += [Step(match.start(), "call", match[1]) for match in _CALL.finditer(text)
              if match[1] in names and match.start() not in names[match[1]]]
    return steps


def frames_of(text: str, assignments: Iterable[re.Match], arguments: Iterable[re.Match]) -> dict[str, None]:
    """Names of frames of `pose_trans` that are set more than once, and are no argument of a routine."""
    names = [match[1] for match in assignments]
    given = {word for match in arguments for word in re.findall(r"\w+", match[1])}
    return {name: None for name in dict.fromkeys(_FRAME.findall(text))
            if names.count(name) > 1 and name not in given}


def refuse_threads(source: SourceText, text: str, steps: Iterable[Step]) -> None:
    """A thread runs beside the motions: what it sets, it sets at any time."""
    for match in _THREAD.finditer(text):
        if found := settings_of(steps).get(match[1]):
            raise source.refuse(match.start(), f"the thread sets the {min(found)} at any time; expected it "
                                               "set between motions")
