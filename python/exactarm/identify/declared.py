"""The declared model of a pose measurement: what a calibration estimates when nothing else is asked for.

Modified DH parameters, joint offsets, gear ratios of axes that have a gear without a harmonics table, and
base and tool frames of every session. Effects that the robot file carries are in the chain: held at their
values, or free where an earlier fit has estimated them.
"""

from dataclasses import replace

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.data.kinds import POSES, kind_of
from exactarm.data.split import DEFAULT_SEED
from exactarm.effects.base import Effect, Parameter, Station
from exactarm.effects.declared_ratio import DeclaredRatio
from exactarm.effects.frames import Frames
from exactarm.effects.geometry import Geometry
from exactarm.effects.joint_offset import JointOffset
from exactarm.errors import InputError
from exactarm.identify.frames import find_frames
from exactarm.robot.robot import Robot

_MOST_CHECKED = 5000  # rows, evenly spread


def require_geometry(robot: Robot) -> None:
    if not robot.has_geometry:
        raise InputError(f"robot {robot.name}: expected a declared geometry, found drives only",
                         file=robot.file)


def carried_layout(robot: Robot, data: Dataset, kind: str = POSES.name) -> Layout:
    """The robot file's own effects that show in this kind of data, none of them free.

    Those that tell of another record (a tracker that was pushed there) have no part in it.
    """
    own = tuple(effect for effect in robot.effects if kind in effect.kinds and effect.acts_on(data))
    layout = Layout.of(own, estimate=False)
    if own and robot.has_geometry and kind_of(kind).at_rest:
        _require_values(robot, layout, data)
    return layout


def _require_values(robot: Robot, layout: Layout, data: Dataset) -> None:
    """A formula in a robot file may have no value at some angles, as log(q_4) at negative ones."""
    spread = np.unique(np.linspace(0, len(data) - 1, min(len(data), _MOST_CHECKED)).astype(int))
    some = data.select(spread) if len(data) else data
    with np.errstate(all="ignore"):
        place = predict_poses(robot, layout, some, tangents=False).position
    without = np.flatnonzero(~np.isfinite(place).all(axis=1))
    if without.size:
        titles = ", ".join(effect.title for effect in layout.effects)
        place_of = some.place_of(int(without[0]))
        raise InputError(f"its effects ({titles}) give no finite position at {place_of}; expected formulas "
                         "that have a value at every row", file=robot.file or data.first_file)


def all_effects(robot: Robot, data: Dataset, layout: Layout, kind: str = POSES.name) -> tuple[Effect, ...]:
    """The robot file's effects that had no part in this data, and those of `layout` that are not declared."""
    carried = carried_layout(robot, data, kind).effects
    apart = tuple(effect for effect in robot.effects if effect not in carried)
    return apart + tuple(effect for effect in layout.effects if not effect.declared)


def with_estimates(robot: Robot, layout: Layout, intervals: np.ndarray) -> Robot:
    """The robot with the estimates of the declared model in its tables and the intervals (P, 2) on record;
    how a sensor was mounted is none of it."""
    set_up = {effect.parameter_label(parameter) for effect in layout.effects
              if effect.declared and effect.station == Station.DEVICE for parameter in effect.parameters()}
    told = {name: (float(low), float(high)) for name, (low, high) in zip(layout.names, intervals)
            if name not in set_up}
    return replace(layout.baked(robot, declared=True), intervals=dict(robot.intervals) | told)


def reestimated_layout(robot: Robot, data: Dataset, kind: str = POSES.name) -> Layout:
    """The same effects, those free that were estimated from data before: what has an interval on record.

    An estimate is no declaration: held, it would keep what another cause had lent it. Orders and other
    searched parameters stay where they were found, parameters at a bound too.
    """
    layout = carried_layout(robot, data, kind)
    free = tuple(
        np.array([not (p.fixed or p.search) and _was_estimated(robot, e, p) for p in e.parameters()], bool)
        for e in layout.effects)
    return Layout(layout.effects, free)


def _was_estimated(robot: Robot, effect: Effect, parameter: Parameter) -> bool:
    low, high = robot.intervals.get(effect.parameter_label(parameter), (0.0, 0.0))
    return low < high


def frames_layout(robot: Robot, data: Dataset, *, orientation: bool,
                  seed: int = DEFAULT_SEED) -> tuple[Layout, list]:
    """Base and tool frames of every session, without starting values; and what was found, by session."""
    found = []
    for session in sorted(set(data.session.tolist())):
        found.append((session, find_frames(robot, data.select(data.session == session),
                                           carried_layout(robot, data), seed)))
    frames = tuple(Frames.of(session, f.base, f.tool, orientation) for session, f in found)
    return Layout.of(frames), found


def geometry_layout(robot: Robot) -> Layout:
    """mDH parameters, joint offsets and the gear ratios to re-identify, as they stand in the tables."""
    axes = range(robot.axes)
    geometry = tuple(Geometry.of(robot, i) for i in axes)
    offsets = tuple(JointOffset.of(robot, i) for i in axes)
    ratios = tuple(DeclaredRatio.of(robot, i) for i in axes
                   if robot.joints[i].has_gear and not robot.joints[i].has_harmonics)
    return Layout.of(geometry + offsets + ratios)
