"""What may have moved: the zero of an axis, the base or the tool, each as a function of its own size.

    zero    f_k = p_k(q_offset + delta) - p_k(q_offset)       through the chain
    base    f_k = exp(r) x_k + t - x_k                        x_k: where BEFORE has seen the point
    tool    f_k = R_k delta                                   R_k: the flange in the base

p_k (m): point k of the check in the controller's base frame as BEFORE shows it. `base_x_m ... base_rz_rad`
are t and the rotation vector r of the move in the axes of the base before it, about its origin; `tool_x_m
...` the move of the target in the axes of the controller's flange.

The move of a zero or the tool is as right as the model. Where that misses the points of BEFORE by s a
coordinate over a spread R of theirs (RMS), it errs by about s / R of a displacement; and a zero turns the
points about a tool that is known to C (3, 3), as s and the poses of BEFORE tell it. A rigid move of the base
owes the model nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from exactarm.chain import Layout, predict_poses
from exactarm.data.dataset import Dataset
from exactarm.effects.joint_offset import JointOffset
from exactarm.identify.pose_fit import PoseFit
from exactarm.numerics.rotation import exp, left_jacobian, skew
from exactarm.robot.robot import Placement, Robot
from exactarm.verify.change import Hypothesis, Moved

# Times s / R that a model errs. Simulated (48 arms of two makes, lengths and angles off by 0.08 or 0.75 mm
# and mrad and springs that the file has not or off by 10 %, 5 to 20 poses, a zero turned by 50 mrad): 1.0
# in the middle, 2.0 in nine of ten of axes 1, 2, 3 and 5, 3 of axis 4
WRONG = 2.0


def base_of(fit: PoseFit, session: int) -> Placement:
    """The controller's base in the frame of the device."""
    base = Placement()
    for effect in fit.layout.effects:
        base = effect.place(session, base, Placement())[0]
    first = fit.robot.controller.base
    turned = base.rotation @ first.rotation.T
    return Placement(turned, base.position - turned @ first.position)


def model_error(fit: PoseFit, before: Dataset, poses: int) -> tuple[float, np.ndarray]:
    """Part of a displacement that the model errs by, and C (m^2); fit: of the frames to so many different
    poses."""
    share = 3 * poses / max(3 * poses - fit.layout.size, 1)  # the frames took the rest
    s2 = WRONG**2 * share * np.mean(fit.residual(before) ** 2)
    spread = np.mean((before.position - before.position.mean(axis=0)) ** 2)
    visits = len(before) / poses
    tool = fit.fit.covariance[6:9, 6:9] * visits * s2 / max(fit.sigma_position**2, 1e-300)
    return float(np.sqrt(s2 / spread)), tool


def candidates(
    robot: Robot, fit: PoseFit, rows: Sequence[Dataset], level: np.ndarray, error: tuple[float, np.ndarray]
) -> tuple[Hypothesis, ...]:
    """rows: one of each pose, K in all, of BEFORE's session; level (K, 3): residual there, NaN unknown;
    error: of the model, as `model_error` tells it."""
    base = base_of(fit, int(rows[0].session[0]))
    points, columns = _at(robot, fit.layout, rows, base)
    flange = columns[:, :, 6:9].reshape(-1, 3) @ robot.controller.flange.rotation
    by_tool = lambda value: Moved(flange @ value, flange, _share(error[0], flange @ value))
    return (
        *(_zero(robot, fit.layout, rows, base, axis, error) for axis in range(robot.axes)),
        _base(points + np.nan_to_num(level)),
        Hypothesis("tool", flange, _named("tool", 3), by_tool),
    )


def _at(
    robot: Robot, layout: Layout, rows: Sequence[Dataset], base: Placement
) -> tuple[np.ndarray, np.ndarray]:
    """Points (K, 3) in the base frame, and their derivative (K, 3, P) by what is free."""
    found = [predict_poses(robot, layout, row) for row in rows]
    points = (np.concatenate([each.position for each in found]) - base.position) @ base.rotation
    return points, base.rotation.T @ np.concatenate([each.jacobian[:, :3] for each in found])


def _share(share: float, f: np.ndarray) -> np.ndarray:
    return share**2 * np.mean(f**2) * np.eye(len(f))


def rigid(points: np.ndarray) -> np.ndarray:
    """(3 K, 6) how points (K, 3) follow a small move of the base: translation, rotation vector."""
    shifted = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return np.concatenate([shifted, -skew(points)], axis=2).reshape(-1, 6)


def _zero(
    robot: Robot, layout: Layout, rows: Sequence[Dataset], base: Placement, axis: int,
    error: tuple[float, np.ndarray],
) -> Hypothesis:
    offset = JointOffset.of(robot, axis)
    share, doubt = error

    def points(value: float) -> tuple[np.ndarray, np.ndarray]:
        return _at(robot, Layout.of((offset.with_values(value),)).joined(layout), rows, base)

    def at(value: np.ndarray) -> Moved:
        position, columns = points(offset.values + value)
        f = (position - still).ravel()
        by_tool = (columns - before)[:, :, 7:10].reshape(-1, 3)
        return Moved(f, columns[:, :, 0].reshape(-1, 1), _share(share, f) + by_tool @ doubt @ by_tool.T)

    still, before = points(np.array(offset.values))
    names = (offset.parameter_label(offset.parameters()[0]),)
    return Hypothesis(f"zero of axis {axis + 1}", before[:, :, 0].reshape(-1, 1), names, at)


def _base(points: np.ndarray) -> Hypothesis:
    """points (K, 3): x_k."""

    def at(value: np.ndarray) -> Moved:
        turned = points @ exp(value[3:]).T
        columns = rigid(turned)
        columns[:, 3:] = columns[:, 3:] @ left_jacobian(value[3:])
        return Moved((turned + value[:3] - points).ravel(), columns, np.zeros((points.size,) * 2))

    return Hypothesis("base", rigid(points), _named("base", 6), at)


def _named(frame: str, count: int) -> tuple[str, ...]:
    return tuple(f"{frame}_{axis}" for axis in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")[:count])
