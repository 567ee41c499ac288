"""What a program has set when a motion runs (tool, base, load), where its ways part and meet again.

Statements are taken in the order of the text. Behind a branch a setting is known only if all ways agree on
it; in a loop only if the loop, with what it calls, does not change it further down; in a routine that others
call, behind a call of one that sets it, and behind a label, only if the file knows one value of it. Else it
is UNCERTAIN, and what needs it is refused. Routines of other files are not followed.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import chain
from operator import attrgetter
from typing import Any, NamedTuple

from exactarm.compensate.program import SourceText

LISTED = 8  # names in one warning
_WORD = re.compile(r"[A-Za-z_]\w*")
_BEGUN = re.compile(r"(?<=\w)\w*|")  # the rest of a word
UNCERTAIN = "set differently on several ways through the program"


class Step(NamedTuple):
    """One statement. what: "open", "loop", "branch" (data: whether one of the ways is always taken), "close",
    "routine" (data: its name), "end", "set" (data: setting, value), "call" (data: name), "label" or
    "move"."""

    place: int
    what: str
    data: Any = None


def walk(steps: Iterable[Step], start: Mapping[str, Any]) -> Iterator[tuple[Any, dict[str, Any]]]:
    """(data, setting -> value) of every motion; start: what holds before the first statement."""
    ordered = sorted(steps, key=attrgetter("place"))
    ends = _ends(ordered)
    only = {key: _only([step.data[1] for step in ordered if step.what == "set" and step.data[0] == key])
            for key in start}
    changed = _changed(ordered, ends)
    state, blocks = dict(start), []  # of each block: state before it, ends of its ways, one always taken
    inside, shown = False, None  # one dictionary for all motions that nothing changes between
    for step in ordered:
        if step.what == "move":
            shown = dict(state) if shown is None else shown
            yield step.data, shown
            continue
        shown = None
        if step.what == "set":
            state[step.data[0]] = step.data[1]
        elif step.what == "call":
            state |= {key: only[key] for key in changed.get(step.data, ())}
        elif step.what == "label":
            _meet(state, [{key: value for key, value in only.items() if value is not None}])
        elif step.what in ("open", "loop", "routine"):
            blocks.append((dict(state), [], False))
            if step.what == "loop":
                body = _between(ordered, step.place, ends[step])
                _meet(state, [dict([other.data]) for other in body if other.what == "set"])
                _meet(state, [{key: only[key] for key in changed.get(other.data, ())} for other in body
                              if other.what == "call"])
            elif step.what == "routine" and inside:
                state |= {key: value for key, value in only.items() if value is not None}
            inside = inside or step.what == "routine"
        elif blocks and step.what == "branch":
            before, ways, complete = blocks[-1]
            blocks[-1] = (before, [*ways, state], complete or step.data)
            state = dict(before)
        elif blocks and step.what == "close":
            before, ways, complete = blocks.pop()
            _meet(state, ways if complete else [*ways, before])
        elif blocks and step.what == "end":
            state = blocks.pop()[0]


def settings_of(steps: Iterable[Step]) -> dict[str, set[str]]:
    """Routine -> what it sets, itself or by what it calls."""
    ordered = sorted(steps, key=lambda step: step.place)
    return _changed(ordered, _ends(ordered))


def goes_on(text: str, before: tuple[int, int] | None, start: int, harmless: re.Pattern[str]) -> bool:
    """Whether the arm stands at the end of the motion above (start and end of its statement) when the one at
    `start` begins: nothing but lines that are `harmless` is between them. Anything else may be a way that
    comes from elsewhere, or move the arm."""
    if before is None:
        return False
    above = max(text.rfind("\n", 0, before[0]), text.rfind("\r", 0, before[0])) + 1
    between = text[above : before[0]] + text[before[1] : start]
    return all(harmless.match(line) for line in between.splitlines() if line.strip())


def _ends(ordered: list[Step]) -> dict[Step, float]:
    """Where each block ends; one that is not closed: nowhere."""
    found: dict[Step, float] = {}
    begun: list[Step] = []
    for step in ordered:
        if step.what in ("open", "loop", "routine"):
            begun.append(step)
        elif step.what in ("close", "end") and begun:
            found[begun.pop()] = step.place
    return found | dict.fromkeys(begun, float("inf"))


def _changed(ordered: list[Step], ends: Mapping[Step, float]) -> dict[str, set[str]]:
    """Routine -> settings that it sets, itself or by what it calls."""
    found: dict[str, set[str]] = {}
    calls: dict[str, set[str]] = {}
    for step in ordered:
        if step.what == "routine":
            body = _between(ordered, step.place, ends[step])
            found[step.data] = {other.data[0] for other in body if other.what == "set"}
            calls[step.data] = {other.data for other in body if other.what == "call"}
    grown = True
    while grown:
        grown = False
        for name, called in calls.items():
            more = found[name].union(*(found.get(other, ()) for other in called))
            grown, found[name] = grown or len(more) > len(found[name]), more
    return found


def _between(ordered: list[Step], begin: int, end: float) -> list[Step]:
    """The statements behind one place and before another."""
    place = attrgetter("place")
    return ordered[bisect_right(ordered, begin, key=place) : bisect_left(ordered, end, key=place)]


def _only(values: list[Any]) -> Any:
    """The one value of a setting that a file knows; None if it knows none."""
    if not values:
        return None
    return values[0] if all(_same(value, values[0]) for value in values) else UNCERTAIN


def _meet(state: dict[str, Any], others: Iterable[Mapping[str, Any]]) -> None:
    for other in others:
        state |= {key: UNCERTAIN for key, value in other.items() if not _same(value, state[key])}


def _same(a: Any, b: Any) -> bool:
    return a is b or bool(a == b)


def unread(
    sources: Iterable[SourceText], texts: Iterable[str], points: Iterable[str], reached: Iterable[str],
    spans: Iterable[Iterable[tuple[int, int]]],
) -> list[str]:
    """What is told of `points` that no motion goes to (they stay as they are), and of those that stand
    outside of the motions and declarations in `spans` of each file: what uses them there is not followed."""
    known = {name.lower(): name for name in points}
    met = {name.lower() for name in reached}
    told = []
    left = [name for low, name in known.items() if low not in met]
    if left:
        told.append(f"no motion that is read goes to {listed(left)}: they stay as they are")
    for source, text, taken in zip(sources, texts, spans):
        found = _elsewhere(text, known, taken)
        if found:
            places = listed([f"{known[name]} (line {source.line(place)})" for name, place in found.items()])
            told.append(f"{source.path.name}: used by what is no motion that is read, and not followed: "
                        f"{places}")
    return told


def listed(words: list[str]) -> str:
    return ", ".join(words[:LISTED]) + (f" and {len(words) - LISTED} more" if len(words) > LISTED else "")


def _elsewhere(text: str, names: Collection[str], spans: Iterable[tuple[int, int]]) -> dict[str, int]:
    """Name in small letters -> the first place where it stands outside of `spans`."""
    gaps, last = [], 0
    for start, end in (*sorted(spans), (len(text), len(text))) if names else ():
        if start > last:
            gaps.append((last, start))
        last = max(last, _BEGUN.match(text, end).end())
    found: dict[str, int] = {}
    words = _WORD.findall("\n".join(text[start:end] for start, end in gaps))
    if not set(map(str.lower, words)).isdisjoint(names):  # in most programs nothing is to be found
        for word in chain.from_iterable(_WORD.finditer(text, *gap) for gap in gaps):
            if word[0].lower() in names:
                found.setdefault(word[0].lower(), word.start())
    return found
