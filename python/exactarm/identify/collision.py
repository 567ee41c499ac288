"""Why a parameter cannot be identified, in words: which others it collides with and what in the arm makes it
so.

The collision itself is a fact of the Jacobian (a combination of other columns gives the same motion of the
target); the reason is looked up in the geometry: frame i lies between axes i and i + 1, which are parallel
where its alpha and beta vanish (modulo half a turn), and collinear where its a vanishes too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from exactarm.effects.parameter_id import Group, ParameterId
from exactarm.effects.units_in_names import unit_of
from exactarm.robot.mdh_frames import NEARLY_PARALLEL, tilt_of_next
from exactarm.robot.robot import Robot

EXACTLY_PARALLEL_RAD = 1e-9
COLLINEAR_M = 1e-3
_MOST_PARTNERS = 6


@dataclass(frozen=True)
class Arm:
    """What the reasons are looked up in: the robot, and the axes (from 1) that do not move in these poses."""

    robot: Robot
    still: tuple[int, ...] = ()


def no_effect(p: ParameterId) -> str:
    """The sentence for a parameter whose column vanishes."""
    if p.group is Group.GEOMETRY and p.symbol in ("alpha", "beta"):
        return f"{p} turns the tool about the target itself: only a measured orientation shows that"
    if p.group is Group.OFFSET:
        return f"{p} moves nothing that is measured: the target lies on axis {p.axis}"
    if p.group is Group.RATIO:
        return (f"{p} moves nothing that is measured: the target lies on axis {p.axis}, or the axis rests at "
                "zero")
    return f"{p} changes nothing that is measured in these poses"


def move_alike(name: ParameterId, partners: Sequence[ParameterId], arm: Arm | None) -> str:
    """The sentence for a parameter that a combination of `partners` imitates exactly."""
    reason = _reason(name, partners, arm)
    return f"{name} and {listed(partners)} move the tool alike" + (
        f": {reason}" if reason else " in these poses")


def hardly_differ(name: ParameterId, partners: Sequence[ParameterId], arm: Arm | None, uncertainty: float,
                  plausible: float) -> str:
    """The sentence for a parameter that the noise hides: its standard deviation and plausible magnitude."""
    unit = f" {unit_of(name)}".rstrip()
    text = (f"{name} is lost in the noise: known to {uncertainty:.2g}{unit} only, plausible is "
            f"{plausible:.2g}{unit}")
    if not partners:
        return text
    reason = _reason(name, partners, arm)
    return f"{text}; it is hardly told from {listed(partners)}" + (f": {reason}" if reason else "")


def listed(names: Sequence[ParameterId]) -> str:
    """Names as a person lists them; the six numbers of a frame become one."""
    short = list(dict.fromkeys(_short(name, names) for name in names))
    if len(short) > _MOST_PARTNERS:
        short = short[:_MOST_PARTNERS] + [f"{len(short) - _MOST_PARTNERS} more"]
    return short[0] if len(short) == 1 else ", ".join(short[:-1]) + " and " + short[-1]


def _short(p: ParameterId, names: Sequence[ParameterId]) -> str:
    if p.group is not Group.FRAME:
        return p
    if p.symbol == "contact":
        return "the contacts"
    sessions = {q.session for q in names if q.group is Group.FRAME}
    return f"the {p.symbol} frame" + ("s of all sessions" if len(sessions) > 1 else "")


def _reason(p: ParameterId, partners: Sequence[ParameterId], arm: Arm | None) -> str:
    frames = {q.symbol for q in partners if q.group is Group.FRAME}
    others = [q for q in partners if q.group is not Group.FRAME]
    if arm is None:
        return _absorbed(p, frames) if frames and not others else ""
    for rule in _RULES if others else ():
        if text := rule(p, others, arm.robot):
            return text
    if (resting := _resting(p, others, frames, arm)) and not _always_absorbed(p, frames, arm.robot):
        return f"axis {resting} stands still in these poses"
    if frames and not others:
        return _absorbed(p, frames)
    if frames:
        return f"together they are a motion of {_frames(frames)}"
    return ""


def _resting(p: ParameterId, others: list[ParameterId], frames: set[str], arm: Arm) -> int | None:
    """The first axis at rest that makes two of these parameters one: its neighbours move as one body."""
    involved = [q.axis for q in (p, *others) if q.axis is not None]
    for k in arm.still:
        at_end = ("base" in frames and k == 1) or ("tool" in frames and k == arm.robot.axes)
        if at_end or any(axis in (k - 1, k) for axis in involved):
            return k
    return None


def _always_absorbed(p: ParameterId, frames: set[str], robot: Robot) -> bool:
    """Whether a frame takes the parameter up however the axes move."""
    if frames == {"base"}:
        return p.axis == 1 and p.symbol in ("d", "q_offset")
    return frames == {"tool"} and p.axis == robot.axes


def _absorbed(p: ParameterId, frames: set[str]) -> str:
    if "contact" in frames:
        return f"{_frames(frames)} absorb it"
    which = " and ".join(sorted(frames))
    verb = "absorb" if len(frames) > 1 else "absorbs"
    if frames == {"base"} and p.axis == 1:
        kind = "a shift along" if p.symbol == "d" else "a turn about"
        return f"{kind} axis 1 is a change of the base frame, which {verb} it"
    return f"the {which} frame{'s' if len(frames) > 1 else ''} {verb} it"


def _frames(symbols: set[str]) -> str:
    """The frames and contacts of a collision, as a person lists them."""
    frames = sorted(symbols - {"contact"})
    named = ["the " + " and ".join(frames) + " frame"] if frames else []
    return " and ".join(named + (["the contacts"] if "contact" in symbols else []))


def _prismatic(p: ParameterId, others: list[ParameterId], robot: Robot) -> str:
    sliding = [i + 1 for i, joint in enumerate(robot.joints) if joint.type == "prismatic"]
    if p.axis in sliding and {p.symbol, *(q.symbol for q in others)} == {"d", "q_offset"}:
        return f"axis {p.axis} slides: its zero and its d are one and the same"
    near = [axis for axis in sliding if p.axis is not None and axis in (p.axis, p.axis + 1)]
    if near and p.symbol in ("d", "a", "q_offset"):
        return f"axis {near[0]} slides: its direction matters, the place where it lies does not"
    return ""


def _alike_along_parallel_axes(p: ParameterId, others: list[ParameterId], robot: Robot) -> str:
    along = [q.axis for q in others if q.symbol == "d"]
    if p.symbol != "d" or not along or len(along) != len(others):
        return ""
    if all(deviation_from_parallel(robot, p.axis, axis) < NEARLY_PARALLEL for axis in along):
        return _are([*along, p.axis], robot, "parallel")
    return ""


def _collinear_turn(p: ParameterId, others: list[ParameterId], robot: Robot) -> str:
    turns = [q.axis for q in others if q.symbol == "q_offset"]
    if p.symbol != "q_offset" or not turns:
        return ""
    near = [axis for axis in turns if deviation_from_parallel(robot, p.axis, axis) < NEARLY_PARALLEL]
    if near and all(abs(robot.joints[i].a) < COLLINEAR_M
                    for i in range(min(near[0], p.axis) - 1, max(near[0], p.axis) - 1)):
        return _are([near[0], p.axis], robot, "collinear")
    return ""


def _turn_about_parallel_y(p: ParameterId, others: list[ParameterId], robot: Robot) -> str:
    """Hayati's beta at a frame whose axes are perpendicular turns about a line parallel to its own axis."""
    for q, r in ((p, others), *((q, [p, *others]) for q in others)):
        if q.symbol != "beta" or not any(s.symbol == "q_offset" and s.axis == q.axis for s in r):
            continue
        if abs(np.cos(robot.joints[q.axis - 1].alpha)) < NEARLY_PARALLEL:
            return (
                f"alpha_{q.axis} is a right angle, so beta_{q.axis} turns about a parallel of axis {q.axis}")
    return ""


def _target_on_axis(p: ParameterId, others: list[ParameterId], robot: Robot) -> str:
    """Frame n - 1 cannot be told from turns about the target where the target lies on axis n."""
    last, tool = robot.joints[-1], robot.tool.position
    on_axis = abs(last.a) < COLLINEAR_M and abs(np.hypot(tool[0], tool[1])) < COLLINEAR_M
    if on_axis and {q.axis for q in (p, *others)} == {robot.axes - 1}:
        return f"the target lies on axis {robot.axes}"
    return ""


def _one_target(p: ParameterId, others: list[ParameterId], robot: Robot) -> str:
    if p.group in (Group.GEOMETRY, Group.OFFSET) and {q.axis for q in (p, *others)} == {robot.axes}:
        return "a single target point does not show how the last frame is turned"
    return ""


def _are(axes: list[int], robot: Robot, word: str) -> str:
    axes = sorted(set(axes))
    off = max(deviation_from_parallel(robot, axes[0], axis) for axis in axes)
    nearly = f"nearly {word} ({np.degrees(off):.2g} degrees)" if off > EXACTLY_PARALLEL_RAD else word
    return f"axes {', '.join(str(axis) for axis in axes[:-1])} and {axes[-1]} are {nearly}"


def deviation_from_parallel(robot: Robot, one: int, other: int) -> float:
    """Largest tilt in rad (modulo half a turn) of the frames between two axes (from 1); pi / 2 at most."""
    first, last = sorted((one, other))
    return max([0.0, *map(tilt_of_next, robot.joints[first - 1 : last - 1])])


_RULES = (_prismatic, _alike_along_parallel_axes, _collinear_turn, _turn_about_parallel_y, _target_on_axis,
          _one_target)
