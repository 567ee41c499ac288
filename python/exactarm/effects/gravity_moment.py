"""The moment of gravity that a joint carries, across and along its axis, in the measuring frame.

    M_i = sum_{j >= i} (r_j - P_i) x m_j g      r_j: centre of mass of link j, P_i: a point on joint axis i

at rest with what the flange carries (signal `flange_load`) as one body more, and its derivatives by the joint
angles and by that load. What gives way turns all beyond P_i by  c (M - z (z . M)),  z the axis of the joint.
Static: what the arm's acceleration adds is left out.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.effects.change import Change
from exactarm.effects.moving_frames import MovingFrames, turn_slope, turned_about


@dataclass(frozen=True)
class GravityMoment:
    """moment, point and axis (N, 3) of one joint with their derivatives by q (N, 3, n), and that of the
    moment by the load of the flange (N, 3, 4)."""

    moment: np.ndarray
    moment_by_q: np.ndarray
    moment_by_flange: np.ndarray
    point: np.ndarray
    point_by_q: np.ndarray
    axis: np.ndarray
    axis_by_q: np.ndarray


def gravity_moment(view, index: int) -> GravityMoment:
    """Of joint `index` (from 0), on every row of `view`, whose frames of the base are known."""
    robot, n = view.robot, view.axes
    frames = MovingFrames.of(view)
    gravity = frames.base @ np.asarray(robot.gravity)
    point, axis = frames.origins[:, index], frames.axes[:, index]
    point_by_q = frames.point_by_q(point, index - 1)
    axis_by_q = frames.direction_by_q(axis, index - 1)
    moment, moment_by_q = np.zeros((view.rows, 3)), np.zeros((view.rows, 3, n))
    bodies = [(j, link.mass * gravity, np.asarray(link.centre_of_mass, float))
              for j, link in enumerate(robot.links) if j >= index]
    for j, weight, inside in bodies:
        centre = frames.origins[:, j + 1] + (frames.rotations[:, j + 1] @ inside[..., None])[..., 0]
        moment += np.cross(centre - point, weight)
        moment_by_q += np.cross(frames.point_by_q(centre, j) - point_by_q, weight[:, :, None], axis=1)
    arm = frames.origins[:, n] - point
    by_mass, turned = np.cross(arm, gravity), frames.rotations[:, n]
    by_flange = np.concatenate([by_mass[:, :, None], np.cross(turned, gravity[:, :, None], axis=1)], axis=2)
    if (load := view.signals.get("flange_load")) is not None and np.any(load):
        first_moment = (turned @ load[:, 1:, None])[:, :, 0]
        by_q = (load[:, :1, None] * (frames.point_by_q(frames.origins[:, n], n - 1) - point_by_q)
                + frames.direction_by_q(first_moment, n - 1))
        moment += (by_flange @ load[:, :, None])[:, :, 0]
        moment_by_q += np.cross(by_q, gravity[:, :, None], axis=1)
    return GravityMoment(moment, moment_by_q, by_flange, point, point_by_q, axis, axis_by_q)


def bending(view, index: int, compliance: float) -> Change:
    """All beyond joint `index` (from 0) gives way across its axis, by `compliance` rad/Nm."""
    at = gravity_moment(view, index)
    across = np.eye(3) - at.axis[:, :, None] * at.axis[:, None, :]
    along = np.sum(at.axis * at.moment, axis=1)
    along_by_q = np.einsum("ni,nij->nj", at.moment, at.axis_by_q)
    by_q = (across @ at.moment_by_q - at.axis_by_q * along[:, None, None]
            - at.axis[:, :, None] * along_by_q[:, None, :])
    value, value_by_q = turned_about(view, (across @ at.moment[:, :, None])[:, :, 0], by_q, at.point,
                                     at.point_by_q)
    by_signal = {"q": compliance * value_by_q}
    if "flange_load" in view.signals:
        by_signal["flange_load"] = compliance * turn_slope(view, across @ at.moment_by_flange, at.point)
    return Change(tuple(range(6)), compliance * value, value[:, :, None], by_signal)
