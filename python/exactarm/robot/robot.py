"""A serial robot as Python sees it: immutable tables, from which the compiled core is built.

    theta --gear--> phi --+ q_offset, spring--> q --geometry--> flange

Frame i: Rot_z(sign q + zero) Trans_z(d) Trans_x(a) Rot_x(alpha) Rot_y(beta) (modified
Denavit-Hartenberg with Hayati's beta; thesis (2.2), (2.3)). A frame whose `beta` is not None follows
Hayati: `beta` is a parameter of it and `d` is not.

A controller reports q = theta / controller_ratio + controller_offset: its own constants, which a
calibration does not change, as it does not change the frames in `controller`. `ratio`, `q_offset` and the
joints' frames are the best knowledge of the real ones.
Units: m, rad, kg, Nm, s. Gear coefficients are relative to the ratio (E5).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from exactarm import _core
from exactarm.errors import InputError
from exactarm.robot.covariance import ParameterCovariance
from exactarm.value import Value

GRAVITY_M_S2 = 9.81
Point = Literal["flange", "target"]
Frame = Literal["base", "device"]


@dataclass(frozen=True, eq=False)
class GearTable(Value):
    """Harmonics of u(phi) in one direction: order [cycles per output turn], a, b (relative), each (m,)."""

    order: np.ndarray = field(default_factory=lambda: np.zeros(0))
    a: np.ndarray = field(default_factory=lambda: np.zeros(0))
    b: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def core(self) -> _core.GearTable:
        return _core.GearTable(self.order, self.a, self.b)


@dataclass(frozen=True, eq=False)
class Joint(Value):
    """One axis: kind, geometry of its frame, gear, spring, drive, limits. None = not declared."""

    type: str = "revolute"
    sign: float = 1.0
    zero: float = 0.0
    d: float = 0.0
    a: float = 0.0
    alpha: float = 0.0
    beta: float | None = None
    q_offset: float = 0.0
    controller_offset: float | None = None  # None: the same as q_offset
    ratio: float | None = None
    controller_ratio: float | None = None  # None: the same as ratio
    cw: GearTable | None = None  # the motor angle falls
    ccw: GearTable | None = None
    spring_linear: float | None = None  # Nm/rad; None = rigid
    spring_cubic: float = 0.0  # Nm/rad^3
    rotor_inertia: float | None = None  # kg m^2, motor side
    coulomb: float | None = None  # Nm, output side
    viscous: float | None = None  # Nm s, output side
    q_min: float | None = None
    q_max: float | None = None
    q_dot_max: float | None = None
    q_ddot_max: float | None = None
    torque_max: float | None = None
    torque_constant: float | None = None  # Nm/A, motor side

    @property
    def has_gear(self) -> bool:
        return self.ratio is not None

    @property
    def highest_order(self) -> float:
        """Of the declared waves, cycles per output turn; 0 without any."""
        tables = [table.order for table in (self.cw, self.ccw) if table is not None]
        return float(np.max(np.concatenate(tables), initial=0.0)) if tables else 0.0

    @property
    def has_harmonics(self) -> bool:
        return any(table is not None and table.order.size for table in (self.cw, self.ccw))

    @cached_property
    def tables(self) -> tuple[tuple[int, _core.GearTable], ...]:
        """The core's tables by direction of motion: -1 cw, 0 the mean of both, 1 ccw."""
        cw, ccw = self.cw or self.ccw or GearTable(), self.ccw or self.cw or GearTable()
        mean = cw if cw is ccw else GearTable(
            np.concatenate([cw.order, ccw.order]), 0.5 * np.concatenate([cw.a, ccw.a]),
            0.5 * np.concatenate([cw.b, ccw.b]))
        return tuple((direction, table.core()) for direction, table in ((-1, cw), (0, mean), (1, ccw)))

    @cached_property
    def core(self) -> dict[str, Any]:
        """What the core's joint is made of, but for the link that it carries."""
        kind = getattr(_core.JointType, self.type)
        motor = _core.Friction(coulomb=self.coulomb or 0.0, viscous=self.viscous or 0.0)
        limits = {name: value for name in ("q_min", "q_max", "q_dot_max", "q_ddot_max", "torque_max")
                  if (value := getattr(self, name)) is not None}
        gear = 1.0 if self.ratio is None else self.ratio
        return {
            "frame": _core.Frame(kind, self.sign, self.zero, self.d, self.a, self.alpha, self.beta or 0.0),
            "q_offset": self.q_offset,
            "gear": _core.Gear(gear, *((table or GearTable()).core() for table in (self.cw, self.ccw))),
            "spring": _core.Spring(self.spring_linear or 0.0, self.spring_cubic),
            "drive": _core.Drive(self.rotor_inertia or 0.0, motor=motor),
            "limits": _core.Limits(**limits)}


@dataclass(frozen=True, eq=False)
class Link(Value):
    """Mass properties of link i in DH frame i; inertia (3, 3) about the centre of mass."""

    mass: float
    centre_of_mass: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True, eq=False)
class Placement(Value):
    """Pose of one frame in another: rotation (3, 3), position (3,) in m."""

    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def core(self) -> _core.Pose:
        return _core.Pose(self.rotation, self.position)

    @property
    def matrix(self) -> np.ndarray:
        """(4, 4), or (N, 4, 4) of a stack of poses: homogeneous matrix."""
        rotation = np.asarray(self.rotation, float)
        out = np.zeros((*rotation.shape[:-2], 4, 4))
        out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = rotation, self.position, 1.0
        return out

    @classmethod
    def of_matrix(cls, matrix: np.ndarray) -> Placement:
        """The pose of a homogeneous matrix (4, 4)."""
        matrix = np.asarray(matrix, float)
        return cls(matrix[..., :3, :3], matrix[..., :3, 3])


@dataclass(frozen=True, eq=False)
class Controller(Value):
    """What the controller itself works with, and a calibration does not change.

    frames            joints of which only sign, zero, d, a, alpha and beta count; empty: not on record
    base, flange      DH frame 0 in the controller's base frame; the controller's flange in DH frame n
    chain             "nominal": the maker's drawing, "calibrated": frames that the controller was given for
                      this very arm
    absolute_accuracy the controller corrects targets by itself
    coupling          (i, j, factor): q_i = reported_i + factor * reported_j, axes from 1; None: not said
    pulses_per_rad    of each axis, for programs in pulses
    joint_names       in the order of the axes, for programs that name them
    """

    frames: tuple[Joint, ...] = ()
    base: Placement = field(default_factory=Placement)
    flange: Placement = field(default_factory=Placement)
    chain: str = "nominal"
    absolute_accuracy: bool = False
    coupling: tuple[tuple[int, int, float], ...] | None = None
    pulses_per_rad: tuple[float, ...] = ()
    joint_names: tuple[str, ...] = ()

    def joints(self, reported: np.ndarray) -> np.ndarray:
        """q (..., n) of what a controller reports whose axes are coupled."""
        q = np.array(reported, float)
        for i, j, factor in self.coupling or ():
            q[..., i - 1] += factor * reported[..., j - 1]
        return q

    def reported(self, q: np.ndarray) -> np.ndarray:
        """The inverse of `joints`: couplings are to axes that are not coupled themselves."""
        reported = np.array(q, float)
        for i, j, factor in self.coupling or ():
            reported[..., i - 1] -= factor * q[..., j - 1]
        return reported


    @property
    def coupling_in_words(self) -> str:
        """As in "q_3 = reported_3 + reported_2"; empty where no axis is coupled."""
        terms: dict[int, str] = {}
        for i, j, factor in self.coupling or ():
            size = "" if abs(factor) == 1.0 else f"{abs(factor):.9g} "
            terms[i] = terms.get(i, f"q_{i} = reported_{i}") + f" {'-+'[factor > 0.0]} {size}reported_{j}"
        return ", ".join(terms.values())


@dataclass(frozen=True, eq=False, repr=False)
class Robot(Value):
    """A robot: joints, links (None where no masses are declared), gravity, tool, effects, record.

    `mass`: of the whole arm, kg, where it is known; `generic_masses`: the links are no declaration but
    exactarm.robot.generic_masses.
    `has_geometry` is False for a robot of which only the drives are known. `effects` are the causes
    beyond the tables, in the order they were added. `record` tells how the file came about
    (data, date, intervals); `intervals` maps a parameter's name to its 95 % interval, `covariance` says how
    the estimates hang together. `file`: as the user named it, for messages.
    """

    name: str
    joints: tuple[Joint, ...]
    links: tuple[Link, ...] | None = None
    gravity: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, -GRAVITY_M_S2]))
    base: Placement = field(default_factory=Placement)
    tool: Placement = field(default_factory=Placement)
    has_geometry: bool = True
    effects: tuple[Any, ...] = ()  # each an exactarm.effects.Effect, which lies above a robot
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    record: dict[str, Any] = field(default_factory=dict)
    controller: Controller = field(default_factory=Controller)
    mass: float | None = None
    generic_masses: bool = False
    covariance: ParameterCovariance | None = None
    file: str | None = field(default=None, compare=False)

    @property
    def axes(self) -> int:
        return len(self.joints)

    @property
    def reach(self) -> float:
        """Length of the stretched arm: sum_i sqrt(a_i^2 + d_i^2), with the stroke of sliding axes; m."""
        strokes = [abs(bound or 0.0) for joint in self.joints if joint.type == "prismatic"
                   for bound in (joint.q_min, joint.q_max)]
        return float(sum(np.hypot(joint.a, joint.d) for joint in self.joints) + sum(strokes))

    def __repr__(self) -> str:
        """What a person wants to see of it; the robot file has all numbers."""
        told = [f"{self.axes} axes", "" if self.has_geometry else "geometry not known",
                "" if self.links else "masses not known",
                f"effects {', '.join(effect.label for effect in self.effects)}" if self.effects else "",
                f"{len(self.intervals)} parameters with intervals" if self.intervals else ""]
        return f"<Robot {self.name}: {', '.join(word for word in told if word)}>"

    def with_joint(self, index: int, **changes: Any) -> Robot:
        """The same robot with fields of joint `index` (from 0) replaced."""
        if not -self.axes <= index < self.axes:
            raise InputError(f"joint {index}; expected 0 to {self.axes - 1}, the first axis is 0")
        joints = list(self.joints)
        joints[index] = replace(joints[index], **changes)
        return replace(self, joints=tuple(joints))

    @property
    def with_controller_frames(self) -> Robot:
        """The same with its frames kept as the controller's, unless others are: before they change."""
        if self.controller.frames or not self.has_geometry:
            return self
        return replace(self, controller=replace(self.controller, frames=tuple(map(frame_of, self.joints))))

    @cached_property
    def ratios(self) -> np.ndarray:
        """(n,) gear ratios; 1 where no gear is declared."""
        return np.array([1.0 if joint.ratio is None else joint.ratio for joint in self.joints])

    @cached_property
    def controller_ratios(self) -> np.ndarray:
        """(n,) the ratios by which the controller turns motor angles into the q it reports."""
        own = [joint.controller_ratio for joint in self.joints]
        return np.array([ratio if value is None else value for value, ratio in zip(own, self.ratios)])

    @cached_property
    def offsets(self) -> np.ndarray:
        """(n,) q = phi + offset, in rad."""
        return np.array([joint.q_offset for joint in self.joints])

    @cached_property
    def controller_offsets(self) -> np.ndarray:
        """(n,) the offsets that the controller uses, in rad."""
        own = [joint.controller_offset for joint in self.joints]
        return np.array([offset if value is None else value for value, offset in zip(own, self.offsets)])

    @cached_property
    def core(self) -> _core.Robot:
        """The compiled core's robot, built once."""
        links = [None] * self.axes if self.links is None else [
            _core.LinkInertia(link.mass, link.centre_of_mass, link.inertia) for link in self.links]
        joints = [_core.Joint(link=link, **joint.core)
                  for joint, link in zip(self.joints, links, strict=True)]
        return _core.Robot(joints, self.base.core(), self.tool.core(), self.gravity)

    # -- at the angles that the controller reports (chain/controller.py) ---------------------------------
    def fk(self, q: ArrayLike, *, of: Point = "flange", seen_from: Frame = "base") -> Placement:
        """Pose at the controller's angles q (n,) or (N, n), rad: of the controller's flange or the target, in
        the controller's base frame or that of the device.

        Calibrated offsets, gears, springs and found effects are in it: the pose that the real arm takes.

            >>> import exactarm as ea
            >>> pose = ea.load_robot("ur10").fk([0.0, -1.5, 1.5, 0.0, 1.5, 0.0])
            >>> pose.position.round(3).tolist()
            [-0.708, -0.17, 0.622]
        """
        rows = self._rows("q", q)
        position, rotation = at_reported_angles().forward(self, rows, of, seen_from)
        return Placement(rotation, position) if np.ndim(q) == 2 else Placement(rotation[0], position[0])

    def ik(self, pose: Placement | ArrayLike, start: ArrayLike | None = None, *, of: Point = "flange",
           seen_from: Frame = "base") -> np.ndarray:
        """(n,) controller's angles that put the real arm at the pose (a Placement or a 4 x 4 matrix).

        `start`: angles (n,) nearby, to choose a branch; default: the branch nearest to the middle of the
        limits.

            >>> import exactarm as ea, numpy as np
            >>> robot, q = ea.load_robot("ur10"), np.array([0.0, -1.5, 1.5, 0.0, 1.5, 0.0])
            >>> bool(np.allclose(robot.ik(robot.fk(q), start=q + 0.1), q))
            True
        """
        goal = pose if isinstance(pose, Placement) else Placement.of_matrix(_numbers("pose", pose, (4, 4)))
        _numbers("pose", goal.matrix, (4, 4))
        near = None if start is None else _numbers("start", start, (self.axes,))
        return at_reported_angles().inverse(self, goal.position, goal.rotation, near, of, seen_from)

    def jacobian(self, q: ArrayLike, *, of: Point = "flange", seen_from: Frame = "base") -> np.ndarray:
        """(6, n) or (N, 6, n): change of position (m) and orientation (rad) with the controller's angles."""
        found = at_reported_angles().jacobian(self, self._rows("q", q), of, seen_from)
        return found if np.ndim(q) == 2 else found[0]

    def inverse_dynamics(self, q: ArrayLike, q_dot: ArrayLike | None = None,
                         q_ddot: ArrayLike | None = None) -> np.ndarray:
        """(n,) or (N, n) joint torques in Nm without friction, at the controller's angles; gravity alone
        without rates."""
        rows = self._rows("q", q)
        rates = [np.zeros_like(rows) if each is None else np.atleast_2d(_numbers(name, each, np.shape(q)))
                 for name, each in (("q_dot", q_dot), ("q_ddot", q_ddot))]
        found = at_reported_angles().inverse_dynamics(self, rows, *rates)
        return found if np.ndim(q) == 2 else found[0]

    def _rows(self, name: str, q: ArrayLike) -> np.ndarray:
        """(N, n) of angles (n,) or (N, n)."""
        found = _array(name, q)
        return np.atleast_2d(_numbers(name, found, (*found.shape[:-1], self.axes)[-2:]))


def _array(name: str, values: ArrayLike) -> np.ndarray:
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: no numbers; expected an array of them") from None


def _numbers(name: str, values: ArrayLike, shape: tuple[int, ...]) -> np.ndarray:
    """Finite numbers of that shape."""
    found = _array(name, values)
    if found.shape != shape:
        raise InputError(f"{name} has the shape {found.shape}; expected {shape}")
    if not np.isfinite(found).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(found))[0])
        raise InputError(f"{name}[{', '.join(map(str, place))}] is {found[place]}; expected a finite number")
    return found


class ReportedAngles(Protocol):
    """Kinematics and torques at the angles that a controller reports: chain/controller.py, above a robot."""

    def forward(self, robot: Robot, q: np.ndarray, of: Point,
                seen_from: Frame) -> tuple[np.ndarray, np.ndarray]: ...
    def jacobian(self, robot: Robot, q: np.ndarray, of: Point, seen_from: Frame) -> np.ndarray: ...
    def inverse(self, robot: Robot, position: np.ndarray, rotation: np.ndarray, start: np.ndarray | None,
                of: Point, seen_from: Frame) -> np.ndarray: ...
    def inverse_dynamics(self, robot: Robot, q: np.ndarray, q_dot: np.ndarray,
                         q_ddot: np.ndarray) -> np.ndarray: ...


_provided: list[Callable[[], ReportedAngles]] = []


def provide(source: Callable[[], ReportedAngles]) -> None:
    """Called once, by a module above the chain (robot_file.py); `source` imports when it is called."""
    _provided.append(source)


def at_reported_angles() -> ReportedAngles:
    if not _provided:
        raise RuntimeError("nothing gives kinematics at the controller's angles; expected "
                           "exactarm.robot_file to be imported")
    return _provided[-1]()


def frame_of(joint: Joint) -> Joint:
    """The geometry of a joint and nothing else."""
    return Joint(joint.type, joint.sign, joint.zero, joint.d, joint.a, joint.alpha, joint.beta)
