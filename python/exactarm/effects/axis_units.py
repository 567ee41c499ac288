"""Units on a sliding axis: what is rad of a revolute one is m, Nm is N, and Nm s (of a rad/s) is N s/m.

    of_a_slide("width_rad") -> "width_m"        of_a_slide("2e-4 rad of play") -> "2e-4 m of play"

The numbers of an effect are in the unit of its axis; the names in files and in result.json stay the same.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from exactarm.robot.robot import Robot

_UNIT = re.compile(r"(?<![A-Za-z])(Nm[_ ]s|Nm3|Nm|rad)(?![A-Za-z0-9])")
_OF_A_SLIDE = {"Nm_s": "N_s_per_m", "Nm s": "N s/m", "Nm3": "N3", "Nm": "N", "rad": "m"}


def slides(robot: Robot, joint: int | None) -> bool:
    """Whether an axis, counted from 1, moves along a line."""
    return joint is not None and robot.joints[joint - 1].type == "prismatic"


def moves_by(robot: Robot, joint: int) -> str:
    """The name of an axis's own signal: `angle of axis 2`, `travel of axis 1` where it slides."""
    return f"{'travel' if slides(robot, joint) else 'angle'} of axis {joint}"


def of_a_slide(words: str) -> str:
    """A name or a sentence with the units of a sliding axis in place of those of a revolute one."""
    return _UNIT.sub(lambda match: _OF_A_SLIDE[match[1]], words)
