"""What two machines, or two runs, may differ in: one rule, for whoever compares their results.

A number is equal to 1e-9 of the largest of the numbers beside it: of its list, of a value and its interval,
of the largest and smallest error beside their root mean square. So are singular values: those of two matrices
differ by no more than the largest one of the matrices' difference (Weyl 1912).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

EQUAL, SMALLEST = 1e-9, 1e-12  # a share, and what is rounding in SI units
# What is the difference of numbers that are larger by far: standard deviations that planned poses show of a
# cause (4 are clear), metres that a plan is off its path.
REST = {"isolability": 1e-7, "tracking": 1e-9}
# How near to its optimum a plan has come is rounding itself; the others are of a run, not of its result.
OWN = {"kkt_error", "seconds", "asked", "run", "inputs", "files", "pdf", "peak_MB"}
BESIDE = ("value", "ci95", "rms")  # the scale of all numbers that stand with one of these
SECONDS = re.compile(r"\b[\d.]+ \w*s\b")  # in a sentence


def numbers(value: object) -> list[float]:
    """The numbers of a list of them and of lists within it."""
    if isinstance(value, list):
        return [number for part in value for number in numbers(part)]
    return [float(value)] if isinstance(value, (int, float)) and not isinstance(value, bool) else []


def within(told: list[dict]) -> list[tuple[float, dict]]:
    """Of changes that a check would see: what each acts by, one over its size, and the rest of its words."""
    return [(1.0 / each["size"], {key: part for key, part in each.items() if key != "size"}) for each in told]


def differences(ours: object, others: object, place: str = "",
                scale: float = 0.0, rest: float = SMALLEST) -> Iterator[tuple[float, str]]:
    """How far each value lies from that of the other, as a share of the scale, and where it is."""
    if isinstance(ours, dict) and isinstance(others, dict):
        if set(ours) != set(others):
            yield float("inf"), f"{place}: {sorted(set(ours) ^ set(others))} is in one alone"
        scale = max(map(abs, numbers([ours.get(name) for name in BESIDE])), default=0.0)
        for name in sorted(set(ours) & set(others) - OWN):
            pair = (ours[name], others[name])
            if name == "detectable":
                pair = tuple([list(each) for each in zip(*within(told))] for told in pair)
            yield from differences(*pair, f"{place}.{name}", scale, REST.get(name, rest))
    elif isinstance(ours, list) and isinstance(others, list):
        if len(ours) != len(others):
            yield float("inf"), f"{place}: {len(ours)} and {len(others)} values"
        scale = max([scale, *map(abs, numbers(ours))])
        for index, (one, other) in enumerate(zip(ours, others, strict=False)):
            yield from differences(one, other, f"{place}[{index}]", scale, rest)
    elif isinstance(ours, float) and isinstance(others, (int, float)):
        size = abs(ours - others)
        if not size <= rest:  # what is no number is never equal
            yield (size / max(scale, abs(ours)) if math.isfinite(size) else math.inf,
                   f"{place}: {ours!r} and {others!r}")
    elif ours != others and SECONDS.sub("", str(ours)) != SECONDS.sub("", str(others)):
        yield float("inf"), f"{place}: {ours!r} and {others!r}"
