"""Whole numbers in names and programs: `q_12`, `P[7]`, `UT : 3`.

`str.isdigit` and `\\d` take superscripts and digits of other scripts; `int` does not take all of them, nor
blanks that are control characters, nor more than 4,300 digits. No index of an axis, point or frame has more
than nine.
"""

import re

_WHOLE = re.compile(r"[ \t]*([0-9]{1,9})[ \t]*")


def whole_number(text: str) -> int | None:
    """The number that `text` is, blanks around it aside; None where it is none."""
    match = _WHOLE.fullmatch(text)
    return None if match is None else int(match[1])
