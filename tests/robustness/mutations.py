"""Ways to spoil a file: bytes, numbers, lines, columns, keys. `spoiled(content, random)` applies one to three
of them.

`mildly_spoiled` leaves the form as it is and changes what it says.

Every way takes and gives bytes and fits any file; those that need lines or cells find them by commas and line
ends.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence

import numpy as np

OPTION_VALUES = ["", " ", "0", "-1", "1", "2", "3.5", "nan", "inf", "-inf", "1e-300", "1e300", "99999999999",
                 "-99999999999", "1e9", "1,2", "1,,2", ",", "x", "joint=1", "joint=99", "backlash", "all",
                 "none", "line", "no.csv", "no.toml", "/", ".", "/dev/null", "/dev/zero", "poses.csv",
                 "path.toml",
                 "ur10.toml", "runs.csv", "fixture.toml", "draft.toml", "part.script", "ur10", "kr300",
                 "tx40", "racer-7-1.4", "../x", "µé漢", "a=b", "=", "q_1=q_2", "--", "-", "5/mm", "9" * 400]
KEPT = ("--out", "--threads", "--quiet", "--debug", "--help", "-h", "--workers")  # the trial's own

WORDS = [b"", b",", b"\n", b"\r", b"\r\n", b"nan", b"inf", b"1e999", b"-", b'"', b"\xff", b"\0", b"[", b"]",
         b"{", b"=", b"<", b"/>", b"_",
         b"99", b"session", b"true", b"''", b"#", b"&amp;", b"\xef\xbb\xbf", b"\x1b[2J", b"../", b"$x^2$",
         b"<script>", "µé漢".encode(),
         b"? ", b"- ", b"&a ", b"*a", b"[]: ", b"!!set "]
NUMBERS = [b"0", b"-0.0", b"1", b"-1", b"1e-300", b"1e300", b"1e20", b"9" * 400, b"1e-20", b"0.1",
           b"57.29577951308232", b"1000", b"2147483648",
           b"9007199254740993", b"-9223372036854775809", b"NaN", b"Infinity", b"1_000", b"0x10", b"1,5", b"",
           b"[1]", b"{}", b'"1"', b"true", b"9" * 5000, b"\x1e7", "²".encode("latin-1"),
           "²".encode(), "٣".encode()]
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
_VALUE = re.compile(rb"(?<![\w.])-?\d+\.?\d*(?:[eE][-+]?\d+)?(?![\w.])")  # no digit of a name


def _overwrite(content: bytes, random: np.random.Generator) -> bytes:
    start, length = random.integers(0, len(content) + 1), random.integers(0, 12)
    return content[:start] + WORDS[random.integers(len(WORDS))] + content[start + length :]


def _double(content: bytes, random: np.random.Generator) -> bytes:
    start, length = random.integers(0, len(content) + 1), random.integers(1, 200)
    return content[:start] + content[start : start
                                     + length] * int(random.integers(2, 30)) + content[start + length :]


def _cut(content: bytes, random: np.random.Generator) -> bytes:
    return content[: random.integers(0, len(content) + 1)]


def _flip_bits(content: bytes, random: np.random.Generator) -> bytes:
    values = np.frombuffer(content, np.uint8).copy()
    at = random.integers(0, len(values), random.integers(1, 8)) if len(values) else []
    values[at] ^= (1 << random.integers(0, 8, len(at))).astype(np.uint8)
    return values.tobytes()


def _number(content: bytes, random: np.random.Generator) -> bytes:
    found = list(_NUMBER.finditer(content))
    if not found:
        return content
    match = found[random.integers(len(found))]
    return content[: match.start()] + NUMBERS[random.integers(len(NUMBERS))] + content[match.end() :]


def _scaled_number(content: bytes, random: np.random.Generator) -> bytes:
    found = list(_NUMBER.finditer(content))
    if not found:
        return content
    match = found[random.integers(len(found))]
    value = float(match[0]) * float(10.0 ** random.integers(-12, 13)) * (-1.0) ** random.integers(2)
    return content[: match.start()] + repr(value).encode() + content[match.end() :]


def _lines(content: bytes, random: np.random.Generator) -> bytes:
    """Lines left out, doubled, exchanged, or all of them in another order."""
    lines = content.split(b"\n")
    a, b = random.integers(0, len(lines), 2)
    kind = random.integers(4)
    if kind == 0:
        del lines[min(a, b) : max(a, b)]
    elif kind == 1:
        lines.insert(a, lines[b])
    elif kind == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines = [lines[i] for i in random.permutation(len(lines))]
    return b"\n".join(lines)


def _columns(content: bytes, random: np.random.Generator) -> bytes:
    """A column of a table left out, doubled, exchanged with another, set to one cell, or renamed as
    another."""
    rows = [line.split(b",") for line in content.split(b"\n") if line]
    width = min(map(len, rows), default=0)
    if width < 2:
        return content
    a, b = random.integers(0, width, 2)
    kind = random.integers(5)
    for number, row in enumerate(rows):
        if kind == 0:
            del row[a]
        elif kind == 1:
            row.insert(a, row[b])
        elif kind == 2:
            row[a], row[b] = row[b], row[a]
        elif kind == 3 and number:
            row[a] = NUMBERS[int(a + b) % len(NUMBERS)]
        elif kind == 4 and not number:
            row[a] = row[b][:-1] + WORDS[int(a + b) % len(WORDS)]
    return b"\n".join(b",".join(row) for row in rows) + b"\n"


def _deep(content: bytes, random: np.random.Generator) -> bytes:
    start = random.integers(0, len(content) + 1)
    return content[:start] + [b"[", b"{a=", b"<link>", b"(",
                              b'"'][random.integers(5)] * int(10 ** random.integers(1, 5)) + content[start:]


WAYS: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    _overwrite, _double, _cut, _flip_bits, _number, _number, _scaled_number, _scaled_number, _lines, _columns,
    _columns, _deep,
)


def spoiled(content: bytes, random: np.random.Generator) -> bytes:
    for _ in range(random.integers(1, 4)):
        content = WAYS[random.integers(len(WAYS))](content, random)
    return content


def _nudged(content: bytes, random: np.random.Generator) -> bytes:
    """A number with a tenth more or less, another sign, as 0, or in degrees."""
    found = list(_VALUE.finditer(content))
    if not found:
        return content
    match = found[random.integers(len(found))]
    factor = [random.uniform(0.9, 1.1), -1.0, 0.0, 180.0 / np.pi, 1e3, 1e-3][random.integers(6)]
    return content[: match.start()] + repr(float(match[0]) * factor).encode() + content[match.end() :]


def _measured(content: bytes, random: np.random.Generator) -> bytes:
    """Cells of a table below its header: rows in another order, doubled, left out; a column of another sign
    or unit, the same throughout, lost now and then, a row late, or exchanged with another."""
    header, *lines = content.split(b"\n")
    rows = [line.split(b",") for line in lines if line]
    width = min(map(len, rows), default=0)
    if width < 2 or len(rows) < 4:
        return _nudged(content, random)
    a, b = (int(each) for each in random.integers(0, width, 2))
    first, last = sorted(int(each) for each in random.integers(0, len(rows), 2))
    kind, factor = random.integers(9), [-1.0, 1e3, 1e-3, 180.0 / np.pi][random.integers(4)]
    if kind == 0:
        rows = [rows[i] for i in random.permutation(len(rows))]
    elif kind == 1:
        rows += rows[first:last]
    elif kind == 2:
        del rows[first:last]
    elif kind == 3:
        late = [rows[0][a], *(row[a] for row in rows[:-1])]
        for row, cell in zip(rows, late):
            row[a] = cell
    else:
        for number, row in enumerate(rows[first if kind == 8 else 0 :]):
            if kind in (4, 8) and _VALUE.fullmatch(row[a]):
                row[a] = repr(float(row[a]) * factor).encode()
            elif kind == 5:
                row[a] = rows[0][a]
            elif kind == 6 and number % 7 == 3:
                row[a] = b"0"
            elif kind == 7:
                row[a], row[b] = row[b], row[a]
    return b"\n".join([header, *(b",".join(row) for row in rows)]) + b"\n"


def mildly_spoiled(content: bytes, random: np.random.Generator) -> bytes:
    """What is mostly read as if it were right: mistakes of a user more than of a file."""
    for _ in range(random.integers(1, 3)):
        content = (_nudged, _measured, _measured)[random.integers(3)](content, random)
    return content


def spoiled_words(words: Sequence[str], parser: argparse.ArgumentParser,
                  random: np.random.Generator) -> list[str]:
    """The words of a command line with one to three of them left out, doubled, exchanged or replaced, or with
    options of `parser` that have hostile values."""
    spoilt = list(words)
    options = [action for action in parser._actions
               if action.option_strings and action.option_strings[-1] not in KEPT]
    for _ in range(random.integers(1, 4)):
        kind, at = random.integers(6), int(random.integers(len(spoilt) + 1))
        value = OPTION_VALUES[random.integers(len(OPTION_VALUES))]
        if kind == 0:
            del spoilt[at : at + 1]
        elif kind == 1:
            spoilt.insert(at, value)
        elif kind == 2:
            spoilt[at : at + 1] = [value]
        elif options:
            action = options[random.integers(len(options))]
            choices = [*(action.choices or [value])]
            given = [value] if random.random() < 0.6 else [str(choices[random.integers(len(choices))])]
            spoilt += [action.option_strings[-1], *(given if action.nargs != 0 else [])]
    return spoilt
