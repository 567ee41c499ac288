"""The moment that a joint carries, across and along its axis, in the measuring frame.

    M_i = sum_{j >= i} (r_j - P_i) x m_j g      r_j: centre of mass of link j, P_i: a point on joint axis i

at rest with what the flange carries (signal `flange_load`) as one body more; in a motion less what turns and
speeds up the links. What gives way turns all beyond P_i by  c (M - z (z . M)),  z the axis of the joint, and
does not ring; what gives way slowly (a damped foundation) does so under the weight alone.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from exactarm import _core
from exactarm.data.kinds import WITH_TARGET
from exactarm.effects.base import Change, Effect, Station
from exactarm.effects.moving_frames import MovingFrames, turn_slope, turned_about
from exactarm.robot.robot import Joint, Link, Robot


@dataclass(frozen=True)
class CarriedMoment:
    """moment, point and axis (N, 3) of one joint; the derivatives of the moment by signals (N, 3, s), name ->
    it, and of the others by q (N, 3, n)."""

    moment: np.ndarray
    moment_by: Mapping[str, np.ndarray]
    point: np.ndarray
    point_by_q: np.ndarray
    axis: np.ndarray
    axis_by_q: np.ndarray


@dataclass(frozen=True)
class Bending(Effect):
    """What gives way across an axis, by one value, rad per Nm; weight_alone: too slowly for accelerations."""

    weight_alone: bool = False

    station = Station.GEOMETRY
    kinds = WITH_TARGET
    compensable = True
    by_load = per_load = gives_way = True

    def to_table(self):
        return super().to_table() | ({"weight_alone": True} if self.weight_alone else {})

    @classmethod
    def from_table(cls, table):
        found = super().from_table(table)
        alone = table.get("weight_alone", False)
        if not isinstance(alone, bool):
            raise TypeError("weight_alone: expected true or false")
        return replace(found, weight_alone=alone)

    def describe(self):
        return super().describe() + (", slowly: accelerations do not tilt it" if self.weight_alone else "")

    def forms_in(self, view) -> Iterator[Effect]:
        """At rest one, in a motion both."""
        yield self
        if moves(view):
            yield replace(self, weight_alone=True)

    def bent(self, view, index: int) -> Change:
        """All beyond joint `index` (from 0) gives way."""
        return bending(view, index, self.values[0], self.weight_alone)


def moves(view) -> bool:
    """Whether the rows have accelerations."""
    return "q_ddot" in view.signals


def carried_moment(view, index: int, weight_alone: bool = False) -> CarriedMoment:
    """Of joint `index` (from 0), on every row of `view`, whose frames of the base are known."""
    frames = MovingFrames.of(view)
    point, axis = frames.origins[:, index], frames.axes[:, index]
    point_by_q = frames.point_by_q(point, index - 1)
    moment, by = (_in_motion(view, index, frames) if moves(view) and not weight_alone
                  else _at_rest(view, index, frames, point_by_q))
    return CarriedMoment(moment, by, point, point_by_q, axis, frames.direction_by_q(axis, index - 1))


def _at_rest(view, index: int, frames: MovingFrames,
             point_by_q: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    robot, n, point = view.robot, view.axes, frames.origins[:, index]
    gravity = frames.base @ np.asarray(robot.gravity)
    moment, by_q = np.zeros((view.rows, 3)), np.zeros((view.rows, 3, n))
    bodies = [(j, link.mass * gravity, np.asarray(link.centre_of_mass, float))
              for j, link in enumerate(robot.links) if j >= index]
    for j, weight, inside in bodies:
        centre = frames.origins[:, j + 1] + (frames.rotations[:, j + 1] @ inside[..., None])[..., 0]
        moment += np.cross(centre - point, weight)
        by_q += np.cross(frames.point_by_q(centre, j) - point_by_q, weight[:, :, None], axis=1)
    if (load := view.signals.get("flange_load")) is None:
        return moment, {"q": by_q}
    arm = frames.origins[:, n] - point
    by_mass, turned = np.cross(arm, gravity), frames.rotations[:, n]
    by_flange = np.concatenate([by_mass[:, :, None], np.cross(turned, gravity[:, :, None], axis=1)], axis=2)
    if np.any(load):
        first_moment = (turned @ load[:, 1:, None])[:, :, 0]
        load_by_q = (load[:, :1, None] * (frames.point_by_q(frames.origins[:, n], n - 1) - point_by_q)
                     + frames.direction_by_q(first_moment, n - 1))
        moment += (by_flange @ load[:, :, None])[:, :, 0]
        by_q += np.cross(load_by_q, gravity[:, :, None], axis=1)
    return moment, {"q": by_q, "flange_load": by_flange}


def _in_motion(view, index: int, frames: MovingFrames) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """By the inverse dynamics of an arm with three more joints before this one, at rest: what they hold."""
    rows, n = view.rows, view.axes
    real = np.delete(np.arange(n + 3), np.arange(index, index + 3))
    turned = -frames.rotations[:, index]
    moment = np.zeros((rows, 3))
    by = {name: np.zeros((rows, 3, n)) for name in ("q", "q_dot", "q_ddot")}
    for at, arm in view.arms:
        motion = (np.insert(view.signals[name][at], [index] * 3, 0.0, axis=1) for name in by)
        held = _core.inverse_dynamics_derivatives(_on_three_axes(arm, index).core, *motion,
                                                  threads=view.threads)
        x_y_z = np.array([index + 1, index + 2, index])
        moment[at] = (turned[at] @ held["tau"][:, x_y_z, None])[:, :, 0]
        for name, slope in zip(by, ("dtau_dq", "dtau_dq_dot", "mass_matrix")):
            by[name][at] = turned[at] @ held[slope][:, x_y_z[:, None], real]
    by["q"] += frames.direction_by_q(moment, index - 1)
    return moment, by


def _on_three_axes(robot: Robot, index: int) -> Robot:
    """With three joints before joint `index` that turn about z, x and y of the frame that it stands on, and
    leave the frame as it is."""
    turn, nothing = Joint(zero=np.pi / 2.0, alpha=np.pi / 2.0), Link(0.0, np.zeros(3), np.zeros((3, 3)))
    before = lambda each, new: (*each[:index], *3 * (new,), *each[index:])
    return replace(robot, joints=before(robot.joints, turn), links=before(robot.links, nothing), effects=())


def giving_way(view, index: int, shapes: np.ndarray, sizes: Sequence[float], weight_alone: bool) -> Change:
    """All beyond a joint that stands on the base (`index` from 0) turns by sum_k sizes_k shapes_k M, shapes
    (K, 3, 3) rad/Nm in the robot's base."""
    at = carried_moment(view, index, weight_alone)
    base = view.signals["base_rotation"].reshape(view.rows, 3, 3)
    parts, by_q, by_signal = [], 0.0, defaultdict(float)
    for size, shape in zip(sizes, shapes):
        turned = base @ shape @ np.swapaxes(base, 1, 2)
        value, slope = turned_about(view, (turned @ at.moment[:, :, None])[:, :, 0],
                                    turned @ at.moment_by["q"], at.point, at.point_by_q)
        parts.append(value)
        by_q = by_q + size * slope
        for name, by in at.moment_by.items():
            if name != "q":
                by_signal[name] = by_signal[name] + size * turn_slope(view, turned @ by, at.point)
    by_parameters = np.stack(parts, axis=2)
    return Change(tuple(range(6)), by_parameters @ np.asarray(sizes), by_parameters,
                  dict(by_signal) | {"q": by_q})


def bending(view, index: int, compliance: float, weight_alone: bool) -> Change:
    """All beyond joint `index` (from 0) gives way across its axis, by `compliance` rad/Nm."""
    at = carried_moment(view, index, weight_alone)
    across = np.eye(3) - at.axis[:, :, None] * at.axis[:, None, :]
    along = np.sum(at.axis * at.moment, axis=1)
    along_by_q = np.einsum("ni,nij->nj", at.moment, at.axis_by_q)
    by_q = (across @ at.moment_by["q"] - at.axis_by_q * along[:, None, None]
            - at.axis[:, :, None] * along_by_q[:, None, :])
    value, value_by_q = turned_about(view, (across @ at.moment[:, :, None])[:, :, 0], by_q, at.point,
                                     at.point_by_q)
    by_signal = {name: compliance * turn_slope(view, across @ by, at.point)
                 for name, by in at.moment_by.items() if name != "q"}
    return Change(tuple(range(6)), compliance * value, value[:, :, None],
                  by_signal | {"q": compliance * value_by_q})
