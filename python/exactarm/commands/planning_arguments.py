"""The arguments of commands that plan measurements: target, unknown frames, kind of measurement, box."""

import argparse
from collections.abc import Sequence

import numpy as np

from exactarm.design.line_of_sight import ACCEPTANCE_RAD, Station
from exactarm.design.pose_space import Box
from exactarm.errors import InputError
from exactarm.identify.identifiability import Dropped
from exactarm.identify.planned import FRAMES, SIGMA_POSITION_M
from exactarm.robot.controller_frames import with_target
from exactarm.robot.robot import Robot

FARTHEST_STATION_M = 100.0
MOST_NOISE_M = 0.02  # of a tape measure: what is more was meant in mm
LONGEST_TOOL = 3.0  # times the reach: a fishing rod
ACCEPTANCE_DEG = round(float(np.degrees(ACCEPTANCE_RAD)), 9)
Numbers = str | Sequence[float] | np.ndarray  # "0.05,0,0.1" on the command line


def add_planning(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--tool", metavar="X,Y,Z",
                        help="target on the flange in m (default: that of the robot file)")
    parser.add_argument("--frames", choices=FRAMES, default="both",
                        help="which frames are unknown: base and tool (default), one of them, or none")
    parser.add_argument("--use", choices=("position", "pose"), default="position",
                        help="what is measured: the position of a target (default), or its orientation too")
    parser.add_argument("--box", metavar="XMIN,XMAX,YMIN,YMAX,ZMIN,ZMAX",
                        help="where flange and target may be, in m in the base frame (default: above the "
                             "floor, z >= 0)")
    parser.add_argument("--clearance", metavar="M", type=float,
                        help="least distance of flange and target from base column and upper arm in m "
                             "(default: a tenth of the arm; 0: none)")


def add_station(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what the tracker sees")
    group.add_argument("--station", metavar="X,Y,Z",
                       help="where the tracker stands, in m in the base frame: the arm's body must not hide "
                            "the target")
    group.add_argument("--opening", metavar="X,Y,Z",
                       help="direction to which the reflector opens, in the flange frame (default: to all "
                            "sides)")
    group.add_argument("--acceptance", metavar="DEG", type=float, default=ACCEPTANCE_DEG,
                       help="half-angle within which the reflector returns the beam (default %(default)g)")


def station_of(position: Numbers | Station | None, opening: str | None = None,
               acceptance_deg: float = ACCEPTANCE_DEG) -> Station | None:
    """Where --station says; None without."""
    if isinstance(position, Station):
        return position
    if not 0.0 < acceptance_deg <= 180.0:
        raise InputError(f"--acceptance {acceptance_deg:g}: expected degrees above 0, 180 at most")
    if position is None and opening is not None:
        raise InputError("--opening acts with --station X,Y,Z only")
    if opening is None and acceptance_deg != ACCEPTANCE_DEG:
        raise InputError("--acceptance acts with --station X,Y,Z and --opening X,Y,Z only")
    if position is None:
        return None
    axis = None if opening is None else numbers_of("--opening", opening, 3)
    if axis is not None and not np.any(axis):
        raise InputError(f"--opening {opening}: expected a direction, not zero")
    where = numbers_of("--station", position, 3)
    if np.linalg.norm(where) > FARTHEST_STATION_M:
        raise InputError(f"--station {position}: {np.linalg.norm(where):.4g} m from the robot; expected "
                         f"metres, at most {FARTHEST_STATION_M:g}, as far as trackers measure")
    return Station(where, axis, float(np.radians(acceptance_deg)))


def add_noise(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--noise", metavar="M", type=float, default=SIGMA_POSITION_M,
                        help="standard deviation of a measured coordinate in m (default %(default)s)")


def tool_of(text: Numbers | None) -> np.ndarray | None:
    """(3,) m, where --tool says."""
    return None if text is None else numbers_of("--tool", text, 3)


def with_tool(robot: Robot, text: Numbers | None) -> Robot:
    """The robot with the target where --tool says."""
    tool = tool_of(text)
    if tool is None:
        return robot
    if 0.0 < LONGEST_TOOL * robot.reach < np.linalg.norm(tool):
        raise InputError(f"--tool {text}: {np.linalg.norm(tool):.4g} m from the flange of an arm that "
                         f"reaches {robot.reach:.2g} m; expected metres")
    return with_target(robot, tool)


def box_of(text: Numbers | Box | None) -> Box:
    if isinstance(text, Box):
        return text
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
            "and say where by --tool X,Y,Z",)


def clearance_of(value: float | None) -> float | None:
    if value is not None and not 0.0 <= value < np.inf:
        raise InputError(f"--clearance {value}: expected a distance in m, 0 or more")
    return value


def noise_of(value: float) -> float:
    if not 0.0 < value <= MOST_NOISE_M:
        raise InputError(f"--noise {value}: expected a standard deviation in m, above 0, at most "
                         f"{MOST_NOISE_M:g}")
    return value


def numbers_of(option: str, text: Numbers, count: int) -> np.ndarray:
    try:
        numbers = np.array([float(part) for part in (text.split(",") if isinstance(text, str) else text)])
    except (ValueError, TypeError):
        numbers = np.zeros(0)
    if len(numbers) != count or np.isnan(numbers).any():
        raise InputError(f"{option} {text}: expected {count} numbers in m, separated by commas")
    return numbers
