"""Axes of a serial chain in space -> modified Denavit-Hartenberg frames, exactly.

Frame i is fixed to link i, its z along axis i + 1, and follows frame i-1 by
    Rot_z(sign q + zero) Trans_z(d) Trans_x(a) Rot_x(alpha) Rot_y(beta)   (thesis (2.2), (2.3), E1).
Axes that are not parallel: x along the common normal (Denavit and Hartenberg 1955), beta = None.
(Nearly) parallel axes have no common normal that stays where it is: origin where axis i + 1 meets the plane
of frame i-1, so d = 0, and beta takes the inclination (Hayati and Mirmirani 1985).
What the frames cannot carry, before the first axis and behind the last, is left to `base` and `tool`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from exactarm.robot.robot import Joint, Placement

NEARLY_PARALLEL = 0.05  # rad between two axes, or its sine: beyond it nobody calls them parallel
ROUNDING = 1e-14  # m, rad: what remains of a zero after a few rotations


@dataclass(frozen=True)
class Axis:
    """A joint axis at q = 0 in the root frame: a point on it (m), unit vector of positive q, joint type."""

    point: np.ndarray
    direction: np.ndarray
    type: str = "revolute"


@dataclass(frozen=True)
class Chain:
    """Frames of a chain: base in the root frame, joints, target in frame n, frames 1..n at q = 0 in it."""

    base: Placement
    joints: tuple[Joint, ...]
    tool: Placement
    frames: tuple[Placement, ...]


def compose(first: Placement, second: Placement) -> Placement:
    """Placement of what is placed by `second` in the frame placed by `first`."""
    return Placement(first.rotation @ second.rotation, first.rotation @ second.position + first.position)


def relative(frame: Placement, other: Placement) -> Placement:
    """`other` as seen from `frame`, both given in the same third frame."""
    return Placement(frame.rotation.T @ other.rotation, frame.rotation.T @ (other.position - frame.position))


def rotation_x(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rotation_y(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def behind_axis(joint: Joint) -> Placement:
    """The part of a frame that does not move with q: Trans_z(d) Trans_x(a) Rot_x(alpha) Rot_y(beta)."""
    rotation = rotation_x(joint.alpha) @ rotation_y(joint.beta or 0.0)
    return Placement(rotation, np.array([joint.a, 0.0, joint.d]))


def frame_at_zero(joint: Joint) -> Placement:
    """Frame i in frame i-1 at q = 0."""
    return compose(Placement(rotation_z(joint.zero)), behind_axis(joint))


def tilt_of_next(joint: Joint) -> float:
    """Angle in rad (modulo half a turn, pi / 2 at most) between the axis of the joint and the one that its
    frame carries."""
    x, y, z = rotation_x(joint.alpha) @ rotation_y(joint.beta or 0.0)[:, 2]
    return float(np.arctan2(np.hypot(x, y), abs(z)))


def mdh_chain(axes: Sequence[Axis], target: Placement) -> Chain:
    """Frames of the chain with these axes that ends in `target` (at q = 0, in the root frame)."""
    base = _first_frame(axes[0])
    frame, sign = base, _sign_along(axes[0].direction, np.array([0.0, 0.0, 1.0]))
    joints, frames = [], []
    for index, axis in enumerate(axes):
        if index + 1 < len(axes):
            following = axes[index + 1]
            direction = frame.rotation.T @ following.direction
            parallel = np.hypot(direction[0], direction[1]) < NEARLY_PARALLEL
            next_sign = _sign_along(direction, np.array([0.0, 0.0, 1.0])) if parallel else 1.0
            point = frame.rotation.T @ (following.point - frame.position)
            fields = (_hayati if parallel else _denavit_hartenberg)(point, next_sign * direction)
        else:
            next_sign, fields = 1.0, _last(relative(frame, target))
        joint = Joint(type=axis.type, sign=sign, **{name: _plain(value) for name, value in fields.items()})
        frame = compose(frame, frame_at_zero(joint))
        joints.append(joint)
        frames.append(frame)
        sign = next_sign
    return Chain(base, tuple(joints), _plain_placement(relative(frame, target)), tuple(frames))


def _sign_along(direction: np.ndarray, wanted: np.ndarray) -> float:
    return -1.0 if direction @ wanted < -ROUNDING else 1.0


def _first_frame(axis: Axis) -> Placement:
    """Frame 0: z along the first axis (upwards), origin on it nearest to the root, x nearest to its x."""
    z = axis.direction * _sign_along(axis.direction, np.array([0.0, 0.0, 1.0]))
    start = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = start - z * (z @ start)
    x /= np.linalg.norm(x)
    origin = axis.point - z * (z @ axis.point)
    return _plain_placement(Placement(np.stack([x, np.cross(z, x), z], 1), origin))


def _half_turn(angle: float, *lengths: float) -> tuple[float, ...]:
    """The same with |angle| <= 90 degrees: x the other way round."""
    if abs(angle) <= np.pi / 2 + ROUNDING:
        return (angle, *lengths)
    return (angle - np.copysign(np.pi, angle), *(-length for length in lengths))


def _denavit_hartenberg(point: np.ndarray, z: np.ndarray) -> dict[str, float | None]:
    """The next axis (point, direction) in the present frame -> frame with x along the common normal."""
    normal = np.array([-z[1], z[0], 0.0])  # e_z x z
    square = normal @ normal
    d = np.cross(point, z) @ normal / square
    x = normal / np.sqrt(square)
    zero, a, alpha = _half_turn(np.arctan2(x[1], x[0]), point @ x, np.arctan2(np.sqrt(square), z[2]))
    return {"zero": zero, "d": d, "a": a, "alpha": alpha, "beta": None}


def _hayati(point: np.ndarray, z: np.ndarray) -> dict[str, float | None]:
    """The next, nearly parallel axis in the present frame -> frame with its origin in that x-y plane."""
    meeting = point - z * (point[2] / z[2])
    a = np.hypot(meeting[0], meeting[1])
    zero, a = _half_turn(np.arctan2(meeting[1], meeting[0]), a) if a > ROUNDING else (0.0, 0.0)
    turned = rotation_z(zero).T @ z
    beta = np.arctan2(turned[0], np.hypot(turned[1], turned[2]))
    return {"zero": zero, "d": 0.0, "a": a, "alpha": np.arctan2(-turned[1], turned[2]), "beta": beta}


def _last(target: Placement) -> dict[str, float | None]:
    """The last frame goes along the last axis to the target's height; with its x where it may turn."""
    x = target.rotation[:, 0]
    zero = np.arctan2(x[1], x[0]) if abs(x[2]) < NEARLY_PARALLEL else 0.0
    return {"zero": zero, "d": target.position[2], "a": 0.0, "alpha": 0.0, "beta": None}


def _plain(value: float | None) -> float | None:
    return value if value is None else 0.0 if abs(value) < ROUNDING else float(value)


def _plain_placement(placement: Placement) -> Placement:
    """Rounding taken out of entries that are meant to be 0, 1 or -1."""
    clean = lambda array: np.where(np.abs(array - np.round(array)) < ROUNDING, np.round(array), array) + 0.0
    return Placement(clean(placement.rotation),
                     np.where(np.abs(placement.position) < ROUNDING, 0.0, placement.position))
