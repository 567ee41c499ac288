"""What the name of a parameter says: its group, symbol and axis.

`session_1.base_x_m`, `d_2_m`, `q_offset_3_rad`, `ratio_4`, `joint_compliance_2.linear_rad_Nm`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import IntEnum

_GEOMETRY = re.compile(r"(d|a|alpha|beta)_(\d+)_(?:m|rad)$")
_OFFSET = re.compile(r"q_offset_(\d+)_(?:m|rad)$")
_RATIO = re.compile(r"ratio_(\d+)$")
_FRAME = re.compile(r"(?:session_(\d+)\.)?(base|tool|socket|plane|sphere|bar|tilt|accel|camera|partner)_"
                    r"(\w+)$")
_EFFECT = re.compile(r"\w*?_(\d+)\.\w+$")


class Group(IntEnum):
    """Kinds of parameters, in the order in which they are kept when they collide."""

    FRAME = 0
    GEOMETRY = 1
    OFFSET = 2
    RATIO = 3
    EFFECT = 4


@dataclass(frozen=True)
class ParameterName:
    """`axis` counts from 1, None for a parameter of no single axis; `symbol`: d, a, ..., base, tool,
    contact."""

    text: str
    group: Group
    symbol: str
    axis: int | None
    session: int | None = None


def parse_parameter(name: str) -> ParameterName:
    """Every name has a group; what is neither frame nor table is a parameter of an effect."""
    if match := _GEOMETRY.match(name):
        return ParameterName(name, Group.GEOMETRY, match[1], int(match[2]))
    if match := _OFFSET.match(name):
        return ParameterName(name, Group.OFFSET, "q_offset", int(match[1]))
    if match := _RATIO.match(name):
        return ParameterName(name, Group.RATIO, "ratio", int(match[1]))
    if match := _FRAME.match(name):
        symbol = match[2] if match[2] in ("base", "tool") else "contact"
        return ParameterName(name, Group.FRAME, symbol, None, int(match[1] or 0))
    axis = _EFFECT.match(name)
    return ParameterName(name, Group.EFFECT, name, int(axis[1]) if axis else None)
