"""The arguments of commands that plan measurements: target, unknown frames, kind of measurement, box."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from exactarm.errors import InputError
from exactarm.identify.identifiability import Dropped
from exactarm.identify.planned import FRAMES, SIGMA_POSITION_M
from exactarm.identify.pose_space import Box
from exactarm.robot import Placement, Robot


def add_planning(parser: argparse.ArgumentParser) -> None:
    # "-0.5,1" is a value: argparse takes only a single negative number for one.
    parser._negative_number_matcher = re.compile(r"^-[\d.]")
    parser.add_argument("--tool", metavar="X,Y,Z",
                        help="target on the flange in m (default: that of the robot file)")
    parser.add_argument("--frames", choices=FRAMES, default="both",
                        help="which frames are unknown: base and tool (default), one of them, or none as in "
                             "the source")
    parser.add_argument("--use", choices=("position", "pose"), default="position",
                        help="what is measured: the position of a target (default), or its orientation too")
    parser.add_argument("--box", metavar="XMIN,XMAX,YMIN,YMAX,ZMIN,ZMAX",
                        help="where flange and target may be, in m in the base frame (default: above the "
                             "floor, z >= 0)")
    parser.add_argument("--clearance", metavar="M", type=float,
                        help="least distance of flange and target from base column and upper arm in m "
                             "(default: a tenth "
                             "of the arm; 0: none)")


def add_noise(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--noise", metavar="M", type=float, default=SIGMA_POSITION_M,
                        help="standard deviation of a measured coordinate in m (default %(default)s)")


def tool_of(text: str | None) -> np.ndarray | None:
    """(3,) m, where --tool says."""
    return None if text is None else numbers_of("--tool", text, 3)


def with_tool(robot: Robot, text: str | None) -> Robot:
    """The robot with the target where --tool says."""
    tool = tool_of(text)
    return robot if tool is None else replace(robot, tool=Placement(robot.tool.rotation, tool))


def box_of(text: str | None) -> Box:
    if text is None:
        return Box()
    numbers = numbers_of("--box", text, 6)
    lower, upper = numbers[::2], numbers[1::2]
    for axis, low, high in zip("xyz", lower, upper):
        if not low < high:
            raise InputError(f"--box {text}: {axis}min {low:g} is not below {axis}max {high:g}")
    return Box(lower, upper)


def target_hint(dropped: Sequence[Dropped]) -> tuple[str, ...]:
    """What to do where parameters are lost only because the target lies on the last axis."""
    lost = [entry.name for entry in dropped if "the target lies on axis" in entry.why]
    if not lost:
        return ()
    return (f"the target lies on the last axis, which hides {', '.join(lost)}: mount it beside that axis "
            "(plans are told "
            "where by --tool X,Y,Z)",)


def clearance_of(value: float | None) -> float | None:
    if value is not None and not 0.0 <= value < np.inf:
        raise InputError(f"--clearance {value}: expected a distance in m, 0 or more")
    return value


def noise_of(value: float) -> float:
    if not value > 0.0 or not np.isfinite(value):
        raise InputError(f"--noise {value}: expected a standard deviation in m, above 0")
    return value


def numbers_of(option: str, text: str, count: int) -> np.ndarray:
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != count or np.isnan(numbers).any():
        raise InputError(f"{option} {text}: expected {count} numbers in m, separated by commas")
    return numbers
