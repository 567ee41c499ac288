"""The moment of gravity that a joint carries, across and along its axis, in the measuring frame.

    M_i = sum_{j >= i} (r_j - P_i) x m_j g      r_j: centre of mass of link j, P_i: a point on joint axis i

and its derivative by the joint angles. Static: what the arm's acceleration adds is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
    robot, n, rows = view.robot, view.axes, view.rows
    base = view.signals["base_rotation"].reshape(rows, 3, 3)
    origins, rotations = view.frames()
    origins = np.einsum("nij,nkj->nki", base, origins) + view.signals["base_position"][:, None, :]
    rotations = base[:, None] @ rotations
    axes = np.stack([robot.joints[k].sign * rotations[:, k, :, 2] for k in range(n)], axis=1)
    gravity = base @ np.asarray(robot.gravity)
    revolute = [joint.type == "revolute" for joint in robot.joints]

    def carried(point: np.ndarray, last: int) -> np.ndarray:
        """(N, 3, n) derivative of a point that joints 0..last move."""
        by_q = np.zeros((rows, 3, n))
        for k in range(last + 1):
            by_q[:, :, k] = np.cross(axes[:, k], point - origins[:, k]) if revolute[k] else axes[:, k]
        return by_q

    point, axis = origins[:, index], axes[:, index]
    point_by_q = carried(point, index - 1)
    axis_by_q = np.zeros((rows, 3, n))
    for k in range(index):
        if revolute[k]:
            axis_by_q[:, :, k] = np.cross(axes[:, k], axis)
    moment, moment_by_q = np.zeros((rows, 3)), np.zeros((rows, 3, n))
    bodies = [(j, link.mass * gravity, np.asarray(link.centre_of_mass, float))
              for j, link in enumerate(robot.links) if j >= index]
    if not view.is_series and view.data.payload is not None:
        mass, centres = view.data.payload
        bodies.append((n - 1, mass[:, None] * gravity, centres))
    for j, weight, inside in bodies:
        centre = origins[:, j + 1] + (rotations[:, j + 1] @ inside[..., None])[..., 0]
        moment += np.cross(centre - point, weight)
        moment_by_q += np.cross(carried(centre, j) - point_by_q, weight[:, :, None], axis=1)
    return GravityMoment(moment, moment_by_q, point, point_by_q, axis, axis_by_q)


def bending(view, rotation: np.ndarray, rotation_by_q: np.ndarray,
            at: GravityMoment) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (N, 6) of the target when all beyond `at.point` turns by the small `rotation` (N, 3) about
    it, and its derivative (N, 6, n) by q; without the identification Jacobian the arm counts as fixed in
    it."""
    arm = view.signals["target"] - at.point
    arm_by_q = -at.point_by_q
    target_by_q = view.target_by("q")
    if target_by_q is not None:
        arm_by_q = target_by_q[:, :3] + arm_by_q
    value = np.concatenate([np.cross(rotation, arm), rotation], axis=1)
    turned = np.cross(rotation_by_q, arm[:, :, None],
                      axis=1) + np.cross(rotation[:, :, None], arm_by_q, axis=1)
    return value, np.concatenate([turned, rotation_by_q], axis=1)
