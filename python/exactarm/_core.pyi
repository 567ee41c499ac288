"""Types of the compiled core (SI units, radians throughout), written by pybind11-stubgen: setup/stub.sh."""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
class InvalidArgument(ValueError):
    pass
class JointType:
    """
    Members:
    
      revolute
    
      prismatic
    """
    __members__: typing.ClassVar[dict[str, JointType]]
    prismatic: typing.ClassVar[JointType]
    revolute: typing.ClassVar[JointType]
    @typing.overload
    def __eq__(self, other: JointType) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: JointType) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class Pose:
    @typing.overload
    def __init__(self) -> None:
        ...
    @typing.overload
    def __init__(self, rotation: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 3]"], position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def position(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        ...
    @property
    def rotation(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        ...
class Frame:
    def __init__(self, type: JointType = JointType.revolute, sign: typing.SupportsFloat | typing.SupportsIndex = 1.0, zero: typing.SupportsFloat | typing.SupportsIndex = 0.0, d: typing.SupportsFloat | typing.SupportsIndex = 0.0, a: typing.SupportsFloat | typing.SupportsIndex = 0.0, alpha: typing.SupportsFloat | typing.SupportsIndex = 0.0, beta: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    @property
    def a(self) -> float:
        ...
    @property
    def alpha(self) -> float:
        ...
    @property
    def beta(self) -> float:
        ...
    @property
    def d(self) -> float:
        ...
    @property
    def sign(self) -> float:
        ...
    @property
    def type(self) -> JointType:
        ...
    @property
    def zero(self) -> float:
        ...
class LinkInertia:
    def __init__(self, mass: typing.SupportsFloat | typing.SupportsIndex, centre_of_mass: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], inertia: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 3]"]) -> None:
        ...
    @property
    def centre_of_mass(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        ...
    @property
    def inertia(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        ...
    @property
    def mass(self) -> float:
        ...
class GearTable:
    @typing.overload
    def __init__(self) -> None:
        ...
    @typing.overload
    def __init__(self, order: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], a: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        ...
    @property
    def a(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @property
    def b(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @property
    def order(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
class Gear:
    def __init__(self, ratio: typing.SupportsFloat | typing.SupportsIndex = 1.0, cw: GearTable = ..., ccw: GearTable = ...) -> None:
        ...
    @property
    def ccw(self) -> GearTable:
        ...
    @property
    def cw(self) -> GearTable:
        ...
    @property
    def ratio(self) -> float:
        ...
class Spring:
    def __init__(self, linear: typing.SupportsFloat | typing.SupportsIndex = 0.0, cubic: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    @property
    def cubic(self) -> float:
        ...
    @property
    def linear(self) -> float:
        ...
class Friction:
    def __init__(self, coulomb: typing.SupportsFloat | typing.SupportsIndex = 0.0, viscous: typing.SupportsFloat | typing.SupportsIndex = 0.0, stribeck: typing.SupportsFloat | typing.SupportsIndex = 0.0, stribeck_velocity: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> None:
        ...
    @property
    def coulomb(self) -> float:
        ...
    @property
    def stribeck(self) -> float:
        ...
    @property
    def stribeck_velocity(self) -> float:
        ...
    @property
    def viscous(self) -> float:
        ...
class Drive:
    def __init__(self, rotor_inertia: typing.SupportsFloat | typing.SupportsIndex = 0.0, joint: Friction = ..., motor: Friction = ...) -> None:
        ...
    @property
    def joint(self) -> Friction:
        ...
    @property
    def motor(self) -> Friction:
        ...
    @property
    def rotor_inertia(self) -> float:
        ...
class Limits:
    def __init__(self, q_min: typing.SupportsFloat | typing.SupportsIndex = ..., q_max: typing.SupportsFloat | typing.SupportsIndex = ..., q_dot_max: typing.SupportsFloat | typing.SupportsIndex = ..., q_ddot_max: typing.SupportsFloat | typing.SupportsIndex = ..., torque_max: typing.SupportsFloat | typing.SupportsIndex = ...) -> None:
        ...
    @property
    def q_ddot_max(self) -> float:
        ...
    @property
    def q_dot_max(self) -> float:
        ...
    @property
    def q_max(self) -> float:
        ...
    @property
    def q_min(self) -> float:
        ...
    @property
    def torque_max(self) -> float:
        ...
class Joint:
    """
    One axis and the link that it moves; link None: its mass is not known.
    """
    def __init__(self, frame: Frame = ..., q_offset: typing.SupportsFloat | typing.SupportsIndex = 0.0, gear: Gear = ..., spring: Spring = ..., drive: Drive = ..., limits: Limits = ..., link: LinkInertia | None = None) -> None:
        ...
    @property
    def drive(self) -> Drive:
        ...
    @property
    def frame(self) -> Frame:
        ...
    @property
    def gear(self) -> Gear:
        ...
    @property
    def limits(self) -> Limits:
        ...
    @property
    def link(self) -> LinkInertia | None:
        ...
    @property
    def q_offset(self) -> float:
        ...
    @property
    def spring(self) -> Spring:
        ...
class Robot:
    """
    A serial robot, checked when it is made and never changed.
    """
    def __init__(self, joints: collections.abc.Sequence[Joint], base: Pose = ..., tool: Pose = ..., gravity: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"] = ...) -> None:
        ...
    @property
    def axes(self) -> int:
        ...
    @property
    def base(self) -> Pose:
        ...
    @property
    def gravity(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        ...
    @property
    def has_masses(self) -> bool:
        ...
    @property
    def joints(self) -> list[Joint]:
        ...
    @property
    def tool(self) -> Pose:
        ...
class ElasticJointModel:
    def __init__(self, robot: Robot, rotor_coupling: bool = False, gear_direction: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex] = [], friction_width: typing.SupportsFloat | typing.SupportsIndex = 0.02) -> None:
        """
        Motors, springs and links of a robot: (2.22) with rotor_coupling, (2.23) without.
        """
    @property
    def axes(self) -> int:
        ...
class ElasticJointDynamics:
    """
    State x = (q, q_dot, theta, theta_dot), acceleration a = (q_ddot, theta_ddot), torques = (external on the links, motors at the shaft).
    """
    def __init__(self, model: ElasticJointModel) -> None:
        ...
    def energy(self, x: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> tuple[float, float, float]:
        """
        Kinetic, gravity and spring energy in J.
        """
    def forward(self, x: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], torques: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    def inverse(self, x: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], a: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    def matrices(self, x: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]]:
        """
        D, C, g of D a + C (q_dot, theta_dot) + g = torques, without friction.
        """
    def rate_jacobian(self, x: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], a: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        d xdot / dx at the accelerations that forward() gave.
        """
class InverseKinematicsStatus:
    """
    Members:
    
      solved
    
      unreachable
    
      singular
    
      joint_limit
    
      not_finite
    """
    __members__: typing.ClassVar[dict[str, InverseKinematicsStatus]]
    joint_limit: typing.ClassVar[InverseKinematicsStatus]
    not_finite: typing.ClassVar[InverseKinematicsStatus]
    singular: typing.ClassVar[InverseKinematicsStatus]
    solved: typing.ClassVar[InverseKinematicsStatus]
    unreachable: typing.ClassVar[InverseKinematicsStatus]
    @typing.overload
    def __eq__(self, other: InverseKinematicsStatus) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: InverseKinematicsStatus) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class InverseKinematicsOptions:
    check_limits: bool
    extrapolate: bool
    def __init__(self) -> None:
        ...
    @property
    def iterations(self) -> int:
        ...
    @iterations.setter
    def iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def largest_jump(self) -> float:
        ...
    @largest_jump.setter
    def largest_jump(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def singular(self) -> float:
        ...
    @singular.setter
    def singular(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def tolerance(self) -> float:
        ...
    @tolerance.setter
    def tolerance(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
class InverseKinematicsReport:
    @property
    def conditioning(self) -> float:
        ...
    @property
    def conditioning_index(self) -> int:
        ...
    @property
    def index(self) -> int:
        ...
    @property
    def iterations(self) -> int:
        ...
    @property
    def joint(self) -> int:
        ...
    @property
    def limit(self) -> float:
        ...
    @property
    def status(self) -> InverseKinematicsStatus:
        ...
    @property
    def value(self) -> float:
        ...
class PlanInput:
    """
    Members:
    
      acceleration
    
      jerk
    """
    __members__: typing.ClassVar[dict[str, PlanInput]]
    acceleration: typing.ClassVar[PlanInput]
    jerk: typing.ClassVar[PlanInput]
    @typing.overload
    def __eq__(self, other: PlanInput) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: PlanInput) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class PlanMethod:
    """
    Members:
    
      stagewise
    
      ipopt
    """
    __members__: typing.ClassVar[dict[str, PlanMethod]]
    ipopt: typing.ClassVar[PlanMethod]
    stagewise: typing.ClassVar[PlanMethod]
    @typing.overload
    def __eq__(self, other: PlanMethod) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: PlanMethod) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class PlanBounds:
    @property
    def q_dot(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @q_dot.setter
    def q_dot(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        ...
    @property
    def q_max(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @q_max.setter
    def q_max(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        ...
    @property
    def q_min(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @q_min.setter
    def q_min(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        ...
    @property
    def theta_dddot(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @theta_dddot.setter
    def theta_dddot(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        ...
    @property
    def theta_ddot(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @theta_ddot.setter
    def theta_ddot(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        ...
    @property
    def theta_dot(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @theta_dot.setter
    def theta_dot(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        ...
    @property
    def theta_max(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @theta_max.setter
    def theta_max(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        ...
    @property
    def theta_min(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @theta_min.setter
    def theta_min(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        ...
class PlanProblem:
    bounds: PlanBounds
    input: PlanInput
    def __init__(self, robot: Robot) -> None:
        ...
    @property
    def direction(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @direction.setter
    def direction(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]) -> None:
        ...
    @property
    def gears(self) -> list[Gear]:
        ...
    @gears.setter
    def gears(self, arg0: collections.abc.Sequence[Gear]) -> None:
        ...
    @property
    def phi_shift(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @phi_shift.setter
    def phi_shift(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]) -> None:
        ...
    @property
    def q_desired(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @q_desired.setter
    def q_desired(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]) -> None:
        ...
    @property
    def q_offset(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        ...
    @q_offset.setter
    def q_offset(self, arg1: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        ...
    @property
    def springs(self) -> list[Spring]:
        ...
    @springs.setter
    def springs(self, arg0: collections.abc.Sequence[Spring]) -> None:
        ...
    @property
    def step(self) -> float:
        ...
    @step.setter
    def step(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def weight(self) -> float:
        ...
    @weight.setter
    def weight(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
class PlanOptions:
    linear_solver: str
    method: PlanMethod
    def __init__(self) -> None:
        ...
    @property
    def iterations(self) -> int:
        ...
    @iterations.setter
    def iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def print_level(self) -> int:
        ...
    @print_level.setter
    def print_level(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def seconds(self) -> float:
        ...
    @seconds.setter
    def seconds(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def threads(self) -> int:
        ...
    @threads.setter
    def threads(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
class PlanMotion:
    @property
    def iterations(self) -> int:
        ...
    @property
    def kkt_complementarity(self) -> float:
        ...
    @property
    def kkt_error(self) -> float:
        ...
    @property
    def kkt_feasibility(self) -> float:
        ...
    @property
    def kkt_stationarity(self) -> float:
        ...
    @property
    def linear_solver(self) -> str:
        ...
    @property
    def message(self) -> str:
        ...
    @property
    def objective(self) -> float:
        ...
    @property
    def objective_scale(self) -> float:
        ...
    @property
    def q(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def q_ddot(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def q_dot(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def seconds(self) -> float:
        ...
    @property
    def stage_multipliers(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def status(self) -> str:
        ...
    @property
    def theta(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def theta_dddot(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def theta_ddot(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
    @property
    def theta_dot(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        ...
def block_recursion(before_last: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], last: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], diagonal: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], right: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    x (N, n, P) of diagonal_t x_t = right_t - last_t x_(t-1) - before_last_t x_(t-2); blocks (N, n, n).
    """
def coriolis_matrix(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], q_dot: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    C(q, q_dot) by Christoffel symbols, (axes, axes).
    """
def delivered_angle(phi: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], order: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], a: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], factor: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], tolerance: typing.SupportsFloat | typing.SupportsIndex, threads: typing.SupportsInt | typing.SupportsIndex = 1) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    x (N,) with x + factor e(x) = phi, factor empty for 1, and the slope s(x) of e there.
    """
def derivative(values: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], time: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], starts: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]) -> numpy.typing.NDArray[numpy.float64]:
    """
    d/dt of samples (N, ...) at time (N,), block by block from each row in starts on.
    """
def dynamics_regressor(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], q_dot: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], q_ddot: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], threads: typing.SupportsInt | typing.SupportsIndex = 1) -> numpy.typing.NDArray[numpy.float64]:
    """
    Y (rows, axes, 10 axes) with tau = Y pi; pi a link: m, m c, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the origin of the link's DH frame.
    """
def forward_kinematics(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], threads: typing.SupportsInt | typing.SupportsIndex = 1) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Positions (rows, 3) in m and rotations (rows, 3, 3) of the target in the measuring frame.
    """
def frame_poses(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Positions (rows, axes + 1, 3) and rotations (rows, axes + 1, 3, 3) of base and frames 1..n.
    """
def friction_torque(friction: Friction, rate: typing.SupportsFloat | typing.SupportsIndex, width: typing.SupportsFloat | typing.SupportsIndex) -> float:
    """
    Friction torque at a rate; width of tanh in rad/s, 0: exact sign.
    """
def gains_by_scale(gram: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], y: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], squares: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    (s, g) each: y' (I / s^2 + H)^-1 y and log det(I + s^2 H) / 2 of blocks H (g, k, k), y (g, k), for
    squares s^2 (s,).
    """
def gear_motor_angle(ratio: typing.SupportsFloat | typing.SupportsIndex, table: GearTable, phi: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Xi(phi): motor angle of each output angle, any shape.
    """
def gear_output_angle(ratio: typing.SupportsFloat | typing.SupportsIndex, table: GearTable, theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Xi^{-1}(theta): output angle of each motor angle.
    """
def gear_outputs(ratio: typing.SupportsFloat | typing.SupportsIndex, table: GearTable, theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Xi^{-1}(theta) (N,) and u there (N,), eight at once.
    """
def gear_ratio(ratio: typing.SupportsFloat | typing.SupportsIndex, table: GearTable, phi: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], order: typing.SupportsInt | typing.SupportsIndex = 0) -> numpy.typing.NDArray[numpy.float64]:
    """
    d^order u / dphi^order at each output angle, order 0 to 3; u = dXi/dphi.
    """
def gear_table(gear: Gear, direction: typing.SupportsInt | typing.SupportsIndex) -> GearTable:
    """
    Table of a direction of motion: -1 cw (the motor angle falls), +1 ccw, 0 the mean of both.
    """
def geometric_jacobian(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], threads: typing.SupportsInt | typing.SupportsIndex = 1) -> numpy.typing.NDArray[numpy.float64]:
    """
    Geometric Jacobians (rows, 6, axes): linear rows, then angular rows.
    """
def gravity_torque(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], threads: typing.SupportsInt | typing.SupportsIndex = 1) -> numpy.typing.NDArray[numpy.float64]:
    """
    Torques g(q) that hold the robot, (rows, axes) in Nm.
    """
def gravity_torque_jacobian(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], threads: typing.SupportsInt | typing.SupportsIndex = 1) -> numpy.typing.NDArray[numpy.float64]:
    """
    dg/dq, (rows, axes, axes).
    """
def identification_columns(axes: typing.SupportsInt | typing.SupportsIndex) -> int:
    ...
def identification_jacobian(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], dq_dratio: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"] = ..., threads: typing.SupportsInt | typing.SupportsIndex = 1) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Positions, rotations and identification Jacobians (rows, 6, columns): per axis d, a, alpha, beta, q, ratio, then base (translation, rotation) and tool (translation, rotation).
    """
def identification_layout(axes: typing.SupportsInt | typing.SupportsIndex) -> dict[str, slice]:
    """
    Columns of the identification Jacobian by what they are derivatives by.
    """
def inertial_parameters(robot: Robot) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    """
    pi of all links, 10 axes numbers.
    """
def inverse_dynamics(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], q_dot: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], q_ddot: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], threads: typing.SupportsInt | typing.SupportsIndex = 1) -> numpy.typing.NDArray[numpy.float64]:
    """
    Joint torques (rows, axes) in Nm: D qdd + C qd + g, link side, without friction.
    """
def inverse_dynamics_derivatives(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], q_dot: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], q_ddot: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], multiplier: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"] = ..., threads: typing.SupportsInt | typing.SupportsIndex = 1) -> dict[str, numpy.typing.NDArray[numpy.float64]]:
    """
    tau (rows, axes), dtau_dq, dtau_dq_dot, mass_matrix (rows, axes, axes); with a multiplier (rows, axes) also the blocks q_q, q_q_dot, q_dot_q_dot, q_q_ddot of the Hessian of multiplier . tau.
    """
def inverse_kinematics_branches(robot: Robot, target: Pose, options: InverseKinematicsOptions = ...) -> list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]]:
    """
    All joint angles that reach one pose within the limits, nearest to their middle first.
    """
def inverse_kinematics_path(robot: Robot, positions: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], rotations: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], start: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], options: InverseKinematicsOptions = ...) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], InverseKinematicsReport]:
    """
    Joint angles (rows, axes) of poses (rows, 3) in m and (rows, 9) row-major rotations, and a report.
    """
def link_inertia(parameters: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[10, 1]"]) -> LinkInertia:
    """
    LinkInertia of ten inertial parameters.
    """
def ma27_available() -> tuple[bool, str]:
    """
    Whether MA27 was found, and if not what was tried.
    """
def mass_matrix(robot: Robot, q: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.c_contiguous"], threads: typing.SupportsInt | typing.SupportsIndex = 1) -> numpy.typing.NDArray[numpy.float64]:
    """
    Mass matrices D(q), (rows, axes, axes).
    """
def plan_motion(robot: Robot, problem: PlanProblem, options: PlanOptions = ...) -> PlanMotion:
    """
    The motor motion that puts the links on the reference; the status says how it ended.
    """
def profile_normal(angle: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], value: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], weight: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], rated: bool, order: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], a: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], level: typing.SupportsFloat | typing.SupportsIndex, with_orders: bool = False) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]]:
    """
    J' W J, J' W r and r of an angle profile at coefficients a, b, level; columns a, b, level and the orders.
    """
def require_gear(name: str, ratio: typing.SupportsFloat | typing.SupportsIndex, table: GearTable) -> None:
    """
    Raises InvalidArgument, naming the gear, unless the table is whole and Xi monotone.
    """
def spring_deflection(linear: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], cubic: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], torque: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    The e with k1 e + k3 e^3 = torque, rad.
    """
def spring_torque(linear: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], cubic: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], deflection: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Any:
    """
    k1 e + k3 e^3 in Nm.
    """
def stop_operator(motion: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], reach: typing.SupportsFloat | typing.SupportsIndex) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Motion (N,) held within +-reach, over the reach, and its derivative by it.
    """
def transmission(x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], order: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], a: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], threads: typing.SupportsInt | typing.SupportsIndex = 1) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Transmission error e (N,) and its slope s (N,) at the output angles x.
    """
def waves(x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], order: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    sin(w x) and cos(w x), (N, m).
    """
