"""The moment of gravity that a joint carries, across and along its axis, in the measuring frame.

    M_i = sum_{j >= i} (r_j - P_i) x m_j g      r_j: centre of mass of link j, P_i: a point on joint axis i

and its derivative by the joint angles. Static: what the arm's acceleration adds is left out.
"""

from dataclasses import dataclass

import numpy as np

from exactarm.effects.moving_frames import MovingFrames


@dataclass(frozen=True)
class GravityMoment:
    """moment, point and axis (N, 3) of one joint with their derivatives by q (N, 3, n)."""

    moment: np.ndarray
    moment_by_q: np.ndarray
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
    if not view.is_series and view.data.payload is not None:
        mass, centres = view.data.payload
        bodies.append((n - 1, mass[:, None] * gravity, centres))
    for j, weight, inside in bodies:
        centre = frames.origins[:, j + 1] + (frames.rotations[:, j + 1] @ inside[..., None])[..., 0]
        moment += np.cross(centre - point, weight)
        moment_by_q += np.cross(frames.point_by_q(centre, j) - point_by_q, weight[:, :, None], axis=1)
    return GravityMoment(moment, moment_by_q, point, point_by_q, axis, axis_by_q)
